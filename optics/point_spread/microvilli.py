"""Receptors that know polarisation: pigment in microvilli absorbs light that swings along them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.numerics.arguments import in_range, of_kind, positive, without_derivative
from optics.numerics.grid import Grid
from optics.point_spread.vector_focus import VectorFocus

__all__ = ["Microvilli"]


@dataclass(frozen=True)
class Microvilli:
    """Parallel microvilli across the light's axis, as those of a rhabdomere.

    azimuth_deg: their direction, from x to y. dichroic_ratio: what they absorb of light that swings along them, over
        what they absorb of light that swings across; from 1, no preference, to infinite.

    Raises:
        ValueError: names argument, value and valid range.
    """

    azimuth_deg: float = 0.0
    dichroic_ratio: float = 10.0

    def __post_init__(self) -> None:
        in_range("azimuth_deg", without_derivative("azimuth_deg", self.azimuth_deg), -360, 360)
        ratio = without_derivative("dichroic_ratio", self.dichroic_ratio)
        if not (isinstance(ratio, float) and math.isinf(ratio) and ratio > 0):
            in_range("dichroic_ratio", ratio, 1.0, 1e12)

    def absorbed(self, light: VectorFocus) -> np.ndarray:
        """Light that is absorbed, (y, x) [1/m²], where all of it would be that swings along the microvilli:
        |E·m|² + (|E|² - |E·m|²)/ratio."""
        of_kind("light", light, VectorFocus, "vector_focus(pupil)")
        along = (np.abs(self._along(light)) ** 2).sum(axis=0)
        found: np.ndarray = along + (light.psf - along) / self.dichroic_ratio
        return found

    def signal(self, light: VectorFocus, radius: float) -> float:
        """Share of the light on the pupil that a round receptor of a radius [m] about the window's middle absorbs."""
        return float((self.absorbed(light) * _disk(light, radius)).sum()) * light.dx**2

    def polarization_sensitivity(self, light: VectorFocus, radius: float) -> float:
        """Largest over least signal as the plane of linear polarisation turns before the pupil: the dichroic ratio
        where rays are flat, and less where they are steep.

        Raises:
            ValueError: light that is not unpolarised, of which alone both planes are known.
        """
        of_kind("light", light, VectorFocus, "vector_focus(pupil)")
        if any(light.polarization[1:]):
            raise ValueError("light is polarised: must be vector_focus(pupil, polarization=None), which has all planes")
        disk, along = _disk(light, radius), self._along(light)
        every = np.einsum("pcyx,qcyx,yx->pq", light.parts, light.parts.conj(), disk).real
        own = np.einsum("pyx,qyx,yx->pq", along, along.conj(), disk).real
        least, most = np.linalg.eigvalsh(own + (every - own) / self.dichroic_ratio)
        return float(most / least)

    def _along(self, light: VectorFocus) -> np.ndarray:
        """E·m of each part, (part, y, x)."""
        turn = math.radians(self.azimuth_deg)
        found: np.ndarray = math.cos(turn) * light.parts[:, 0] + math.sin(turn) * light.parts[:, 1]
        return found


def _disk(light: VectorFocus, radius: float) -> np.ndarray:
    """1 on a receptor, (y, x).

    Raises:
        ValueError: the window does not hold it, or it holds no sample but the middle.
    """
    positive("radius", without_derivative("radius", radius))
    if radius < light.dx or radius > (min(light.scalar.shape) - 1) / 2 * light.dx:
        raise ValueError(
            f"radius = {radius:.3g} m: must lie between the samples' distance of {light.dx:.3g} m and the window's rim"
        )
    own = Grid(light.grid.shape, light.dx)
    return (np.hypot(own.x, own.y[:, None]) <= radius).astype(float)
