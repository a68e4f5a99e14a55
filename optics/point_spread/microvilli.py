"""Receptors with polarisation sensitivity: pigment in microvilli absorbs mainly light that is polarised along them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.numerics.arguments import flag, in_range, of_kind, without_derivative
from optics.point_spread.converging import VectorFocus
from optics.point_spread.disk_sum import DiskSum

__all__ = ["Microvilli"]


@dataclass(frozen=True)
class Microvilli:
    """Parallel microvilli, perpendicular to the light's axis, as in a rhabdomere.

    azimuth_deg: direction of the microvilli [degrees], from x towards y, -360 to 360.
    dichroic_ratio: absorption of light polarised along the microvilli, divided by absorption of light polarised across
        them. It ranges from 1 (no preference) to infinity.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    azimuth_deg: float = 0.0
    dichroic_ratio: float = 10.0

    def __post_init__(self) -> None:
        in_range("azimuth_deg", without_derivative("azimuth_deg", self.azimuth_deg), -360, 360)
        ratio = without_derivative("dichroic_ratio", self.dichroic_ratio)
        if not (isinstance(ratio, float) and math.isinf(ratio) and ratio > 0):
            in_range("dichroic_ratio", ratio, 1.0, 1e12)

    def absorbed(self, light: VectorFocus) -> np.ndarray:
        """Return the absorbed light, (y, x) [1/m²], if all light polarised along the microvilli is absorbed.

        With the field E and the direction m of the microvilli, it is |E·m|² + (|E|² - |E·m|²)/`dichroic_ratio`.

        Raises:
            ValueError: `light` is not a VectorFocus.
        """
        of_kind("light", light, VectorFocus, "vector_focus(pupil)")
        along = (np.abs(self._along(light)) ** 2).sum(axis=0)
        found: np.ndarray = along + (light.psf - along) / self.dichroic_ratio
        return found

    def signal(
        self,
        light: VectorFocus,
        radius: float,
        centre: tuple[float, float] | None = None,
        with_error: bool = False,
    ) -> Any:
        """Return the fraction of the pupil's light that a round receptor absorbs.

        The result does not depend on the samples of the light. If they are too coarse, or too few around the receptor,
        the light is recomputed.

        radius: radius [m] of the receptor.
        centre: centre (x, y) [m] of the receptor. None: `light.centre`.
        with_error: True to return (value, predicted error). The predicted error includes the errors of the sum over
            samples and of `vector_focus`.

        Raises:
            ValueError: an argument is invalid, or the receptor extends beyond the outermost samples.
            AccuracyError: the receptor is so large that too many samples are required, or `light` is not from
                `vector_focus`.
        """
        of_kind("light", light, VectorFocus, "vector_focus(pupil)")
        flag("with_error", with_error)
        disk = DiskSum.over(light, radius, centre)
        found = disk.integrate(self.absorbed(disk.light))
        return found if with_error else found[0]

    def polarization_sensitivity(
        self, light: VectorFocus, radius: float, centre: tuple[float, float] | None = None
    ) -> float:
        """Return the polarisation sensitivity: the largest signal for linearly polarised light divided by the smallest.

        All planes of polarisation in front of the pupil are considered. The result equals the dichroic ratio if rays
        are nearly parallel to the axis, and is smaller if rays are steep. For the arguments, see `signal`.

        Raises:
            ValueError: `light` is at least partly polarised: only unpolarised light contains all planes of polarisation
                equally. See also `signal`.
            AccuracyError: see `signal`.
        """
        of_kind("light", light, VectorFocus, "vector_focus(pupil)")
        if any(light.polarization[1:]):
            raise ValueError("light is polarised: must be vector_focus(pupil, polarization=None), which has all planes")
        disk = DiskSum.over(light, radius, centre)
        parts, along = disk.light.parts, self._along(disk.light)
        every = np.einsum("pcyx,qcyx,yx->pq", parts, parts.conj(), disk.share).real
        own = np.einsum("pyx,qyx,yx->pq", along, along.conj(), disk.share).real
        least, most = np.linalg.eigvalsh(own + (every - own) / self.dichroic_ratio)
        return float(most / least)

    def _along(self, light: VectorFocus) -> np.ndarray:
        """Return the component of the field along the microvilli, (part, y, x).

        The parts of the light do not interfere with each other, see `VectorFocus.parts`.
        """
        turn = math.radians(self.azimuth_deg)
        found: np.ndarray = math.cos(turn) * light.parts[:, 0] + math.sin(turn) * light.parts[:, 1]
        return found
