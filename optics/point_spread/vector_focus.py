"""The focus as Maxwell's equations have it: three components of the electric field, for symmetric pupils."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.richards_wolf import Light, focal_integrals
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import of_kind, one_of, positive, shown, vacuum_wavelength, without_derivative
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

__all__ = ["VectorFocus", "vector_focus"]

FEWEST_ZONES = 20.0  # choice: Fresnel number from which rays meet as in the Debye integral, to 1/(2 number)
PATH_SAMPLES = 513  # choice: along a radius, at which the path is looked at


@dataclass(frozen=True, eq=False)
class VectorFocus:
    """intensity: |Ex|², |Ey|², |Ez|² over the pupil's area, (3, y, x) [1/m²]; what a molecule sees whose dipole lies
    along x, y or z. scalar: what scalar theory says, (y, x). field: Ex, Ey, Ez, (3, y, x); None in unpolarised light.
    """

    intensity: np.ndarray
    scalar: np.ndarray
    dx: float
    field: np.ndarray | None = None

    @cached_property
    def psf(self) -> np.ndarray:
        """Of all components, (y, x) [1/m²]."""
        total: np.ndarray = self.intensity.sum(axis=0)
        return total

    @property
    def scalar_error(self) -> float:
        """Relative L2 error that scalar theory makes over the window."""
        return float(np.linalg.norm(self.scalar - self.psf) / np.linalg.norm(self.psf))


def vector_focus(
    pupil: Pupil,
    wavelength: float = 550e-9,
    sensor_distance: float | None = None,
    *,
    polarization: tuple[complex, complex] | None = None,
    apodization: str = "flat",
    dx: float = 0.05e-6,
    shape: tuple[int, int] = (65, 65),
) -> VectorFocus:
    """Electric field near the axis behind a circle or ring whose light comes along the axis (Richards & Wolf 1959).

    The Debye integral of plane waves, one for each ray: right to about 1/(2 Fresnel number).

    sensor_distance: [m]; None: the lens' focus. polarization: Jones vector (x, y) of the light before the pupil; None:
        unpolarised. apodization: "flat", even light over a flat pupil; "aplanatic", as behind a corrected objective:
        the pupil is then seen from the focus under the sine R/z.

    Raises:
        ValueError: a bad argument, or a pupil that is not the same all around.
        AccuracyError: a Fresnel number below 20, where rays do not meet in a point.
    """
    of_kind("pupil", pupil, Pupil, "Pupil(25e-6)")
    lambda_ = vacuum_wavelength(wavelength)
    one_of("apodization", apodization, ("flat", "aplanatic"))
    if not pupil.rotationally_symmetric(lambda_) or len(pupil.aperture.rings) > 1:
        raise ValueError(f"pupil = {shown(pupil)}: must be the same all around, a circle or ring with such a relief")
    z = pupil.image_distance(math.inf) if sensor_distance is None else positive("sensor_distance", sensor_distance)
    _check_plain(pupil, lambda_)
    index = pupil.index_behind(lambda_)
    zones = pupil.radius**2 * index / (lambda_ * z)
    if zones < FEWEST_ZONES:
        raise AccuracyError(f"Fresnel number {zones:.3g}: must be at least {FEWEST_ZONES:g} for rays to meet; use psf")
    ends, light = _aplanatic(pupil, z) if apodization == "aplanatic" else _flat(pupil, lambda_, z)
    window = Grid(shape, dx)
    x, y = window.x[None, :], window.y[:, None]
    radii, back = np.unique(np.round(np.hypot(x, y) / dx, 9), return_inverse=True)
    found = focal_integrals(radii * dx, 2 * math.pi * index / lambda_, z, ends, light)
    found = found[:, back.reshape(window.shape)] / math.sqrt(pupil.area)
    return _components(found, np.arctan2(y, x), polarization, window.dx)


def _check_plain(pupil: Pupil, wavelength: float) -> None:
    """ValueError if the pupil carries a derivative."""
    types = precision("float64")
    at, middle = types.Float64(0.5), types.Float64(0.0)
    path = pupil.path(at * pupil.radius, middle, wavelength, PointSource(), types)
    for part in (pupil.aperture_radius, path, pupil.amplitude(at, middle, types)):
        without_derivative("pupil", part)


def _flat(pupil: Pupil, wavelength: float, z: float) -> tuple[tuple[float, float], Light]:
    """r = z tan θ; W is what the path through the pupil and on to the axis has more than the axial one."""
    types = precision("float64")
    inner = pupil.aperture.rings[0][0] * pupil.radius
    r = np.linspace(inner, pupil.radius, PATH_SAMPLES)

    def waves(r: np.ndarray) -> np.ndarray:
        path = pupil.path(types.Float64(r), types.Float64(0 * r), wavelength, PointSource(), types).numpy()
        found: np.ndarray = (path + pupil.index_behind(wavelength) * r * r / (np.sqrt(r * r + z * z) + z)) / wavelength
        return found

    def passed(r: np.ndarray) -> np.ndarray:
        found: np.ndarray = pupil.amplitude(types.Float64(r / pupil.radius), types.Float64(0 * r), types).numpy()
        return found

    def at(theta: np.ndarray) -> np.ndarray:
        found: np.ndarray = passed(z * np.tan(theta)) * np.exp(2j * np.pi * waves(z * np.tan(theta))) / np.cos(theta)
        return found

    turns = float(np.abs(np.diff(waves(r))).max()) * (PATH_SAMPLES - 1)
    return (math.atan2(inner, z), math.atan2(pupil.radius, z)), Light(at, turns)


def _aplanatic(pupil: Pupil, z: float) -> tuple[tuple[float, float], Light]:
    """r = z sin θ, all rays in phase."""
    bare = pupil.height is None and pupil.wavefront is None and pupil.mask is None
    if not bare or pupil.thin_lens_focal_length is None or pupil.radius >= z:
        raise ValueError(
            f"apodization = 'aplanatic': must be an ideal lens without relief or wavefront or mask, its radius "
            f"{pupil.radius:.3g} m below the distance {z:.3g} m"
        )
    inner = pupil.aperture.rings[0][0] * pupil.radius
    return (math.asin(inner / z), math.asin(pupil.radius / z)), Light(lambda theta: np.sqrt(np.cos(theta)))


def _components(found: np.ndarray, phi: np.ndarray, polarization: Any, dx: float) -> VectorFocus:
    along, axial, twice, scalar = found
    by_x = np.array([along + twice * np.cos(2 * phi), twice * np.sin(2 * phi), -2j * axial * np.cos(phi)])
    by_y = np.array([twice * np.sin(2 * phi), along - twice * np.cos(2 * phi), -2j * axial * np.sin(phi)])
    without_derivative("polarization", polarization)
    if polarization is None:
        both = (np.abs(by_x) ** 2 + np.abs(by_y) ** 2) / 2
        return VectorFocus(both, np.abs(scalar) ** 2, dx)
    try:
        jones = np.asarray(polarization, dtype=complex)
    except (TypeError, ValueError):
        jones = np.zeros(2)
    if jones.shape != (2,) or not np.isfinite(jones).all() or not np.abs(jones).any():
        raise ValueError(f"polarization = {shown(polarization)}: must be a Jones vector (x, y), not (0, 0)")
    jones = jones / np.linalg.norm(jones)
    field = jones[0] * by_x + jones[1] * by_y
    return VectorFocus(np.abs(field) ** 2, np.abs(scalar) ** 2, dx, field)
