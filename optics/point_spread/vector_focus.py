"""The focus as Maxwell's equations have it: three components of the electric field."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.richards_wolf import Light, focal_integrals
from optics.methods.vector_sum import VectorSum
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import of_kind, one_of, positive, shown, vacuum_wavelength, without_derivative
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

__all__ = ["VectorFocus", "vector_focus"]

FEWEST_ZONES = 20.0  # choice: Fresnel number from which rays meet as in the Debye integral, to 1/(2 number)
ROUNDING = 1e-9
PATH_SAMPLES = 513  # choice: along a radius, at which the path is looked at


@dataclass(frozen=True, eq=False)
class VectorFocus:
    """intensity: |Ex|², |Ey|², |Ez|² over the pupil's area, (3, y, x) [1/m²]; what a molecule sees whose dipole lies
    along x, y or z. scalar: what scalar theory says, (y, x). field: Ex, Ey, Ez, (3, y, x); None unless the light is
    fully polarised. parts: fields that do not interfere and together are the light, (part, 3, y, x): one, or two.
    centre: (x, y) [m] of the middle sample. polarization: of the light before the pupil, Stokes' parameters over the
    first.
    """

    intensity: np.ndarray
    scalar: np.ndarray
    dx: float
    field: np.ndarray | None
    parts: np.ndarray
    centre: tuple[float, float]
    polarization: tuple[float, float, float, float]

    def __repr__(self) -> str:
        height, width = self.scalar.shape
        return f"<VectorFocus {height} x {width} samples {self.dx:.3g} m apart, scalar error {self.scalar_error:.1e}>"

    @cached_property
    def psf(self) -> np.ndarray:
        """Of all components, (y, x) [1/m²]."""
        total: np.ndarray = self.intensity.sum(axis=0)
        return total

    @property
    def grid(self) -> Grid:
        """Where the samples lie [m]."""
        height, width = self.scalar.shape
        return Grid((height, width), self.dx, self.centre)

    @property
    def scalar_error(self) -> float:
        """Relative L2 error that scalar theory makes over the window."""
        return float(np.linalg.norm(self.scalar - self.psf) / np.linalg.norm(self.psf))


def vector_focus(
    pupil: Pupil,
    wavelength: float = 550e-9,
    sensor_distance: float | None = None,
    *,
    polarization: Sequence[complex] | None = None,
    source_angle: tuple[float, float] = (0.0, 0.0),
    apodization: str = "flat",
    dx: float = 0.05e-6,
    shape: tuple[int, int] = (65, 65),
) -> VectorFocus:
    """Electric field behind a pupil of any shape about the image of a point far away.

    The Debye integral of plane waves, one for each ray: right to about 1/(2 Fresnel number). Along the axis of a circle
    or ring it is Richards and Wolf's (1959), elsewhere a sum over the pupil's points.

    sensor_distance: [m]; None: the lens' focus. polarization: of the light before the pupil, Jones' vector (x, y) or
        Stokes' parameters (S0, S1, S2, S3) with S1 = |Ex|² - |Ey|², S2 = 2 Re(Ex* Ey), S3 = 2 Im(Ex* Ey); None:
        unpolarised. In light aslant x and y are turned with it. source_angle: (x, y) [rad], as of `optics.psf`; the
        window then lies about the image. apodization: "flat", even light over a flat pupil; "aplanatic", as behind a
        corrected objective and on its axis: the pupil is then seen from the focus under the sine ξ/z.

    Raises:
        ValueError: a bad argument, a relief of pixels, or a derivative.
        AccuracyError: a Fresnel number below 20, where rays do not meet in a point.
    """
    of_kind("pupil", pupil, Pupil, "Pupil(25e-6)")
    lambda_, source = vacuum_wavelength(wavelength), PointSource(math.inf, source_angle)
    one_of("apodization", apodization, ("flat", "aplanatic"))
    z = pupil.image_distance(math.inf) if sensor_distance is None else positive("sensor_distance", sensor_distance)
    _check_plain(pupil, lambda_)
    if pupil.pixels:
        raise ValueError("height is a PixelRelief: must be smooth, for each point to have one ray")
    index = pupil.index_behind(lambda_)
    zones = pupil.radius**2 * index / (lambda_ * z)
    if zones < FEWEST_ZONES:
        raise AccuracyError(f"Fresnel number {zones:.3g}: must be at least {FEWEST_ZONES:g} for rays to meet; use psf")
    if apodization == "aplanatic":
        _check_aplanatic(pupil, z, source.angle)
    amplitudes, shares = _polarised(polarization)
    along_axis = source.angle == (0.0, 0.0) and len(pupil.aperture.rings) == 1
    if along_axis and pupil.rotationally_symmetric(lambda_):
        window = Grid(shape, dx)
        found = _symmetric(pupil, lambda_, z, window, apodization)
    else:
        beam = Beam(pupil, source, lambda_, z)
        window = Grid(shape, dx, _image(beam))
        found = VectorSum(beam, window, apodization == "aplanatic").components()
    parts = np.tensordot(amplitudes, found[:6].reshape(2, 3, *window.shape), axes=1)
    intensity, pure = (np.abs(parts) ** 2).sum(axis=0), parts[0] if len(parts) == 1 else None
    return VectorFocus(intensity, np.abs(found[6]) ** 2, window.dx, pure, parts, window.centre, shares)


def _symmetric(pupil: Pupil, wavelength: float, z: float, window: Grid, apodization: str) -> np.ndarray:
    """See `VectorSum.components`, by Richards and Wolf's integrals."""
    ends, light = _aplanatic(pupil, z) if apodization == "aplanatic" else _flat(pupil, wavelength, z)
    x, y = window.x[None, :], window.y[:, None]
    radii, back = np.unique(np.round(np.hypot(x, y) / window.dx, 9), return_inverse=True)
    wavenumber = 2 * math.pi * pupil.index_behind(wavelength) / wavelength
    found = focal_integrals(radii * window.dx, wavenumber, z, ends, light)
    along, axial, twice, scalar = found[:, back.reshape(window.shape)] / math.sqrt(pupil.area)
    phi = np.arctan2(y, x)
    by_x = along + twice * np.cos(2 * phi), twice * np.sin(2 * phi), -2j * axial * np.cos(phi)
    by_y = twice * np.sin(2 * phi), along - twice * np.cos(2 * phi), -2j * axial * np.sin(phi)
    return np.array([*by_x, *by_y, scalar])


def _image(beam: Beam) -> tuple[float, float]:
    """Where (x, y) [m] the ray through the pupil's centre lands (Snell's law)."""
    x, y = (math.tan(angle) for angle in beam.source.angle)
    bent = beam.pupil.index_before(beam.wavelength) / beam.index / math.hypot(1, x, y)
    axial = math.sqrt(max(1 - bent**2 * (x * x + y * y), 1e-6))
    return number(beam.distance) * bent * x / axial, number(beam.distance) * bent * y / axial


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


def _check_aplanatic(pupil: Pupil, z: float, angle: tuple[float, float]) -> None:
    bare = pupil.height is None and pupil.wavefront is None and pupil.mask is None and angle == (0.0, 0.0)
    if not bare or pupil.thin_lens_focal_length is None or pupil.radius >= z:
        raise ValueError(
            f"apodization = 'aplanatic': must be an ideal lens without relief, wavefront or mask, lit along its axis, "
            f"its radius {pupil.radius:.3g} m below the distance {z:.3g} m"
        )


def _aplanatic(pupil: Pupil, z: float) -> tuple[tuple[float, float], Light]:
    """r = z sin θ, all rays in phase."""
    inner = pupil.aperture.rings[0][0] * pupil.radius
    return (math.asin(inner / z), math.asin(pupil.radius / z)), Light(lambda theta: np.sqrt(np.cos(theta)))


def _polarised(polarization: Any) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """Jones vectors of light's parts that do not interfere, (part, 2), and Stokes' parameters over the first."""
    without_derivative("polarization", polarization)
    try:
        given = np.asarray((1, 0, 0, 0) if polarization is None else polarization, dtype=complex)
    except (TypeError, ValueError):
        given = np.zeros(0)
    known = given.shape in ((2,), (4,)) and bool(np.isfinite(given).all())
    if known and given.shape == (2,) and np.abs(given).any():
        one = given / np.linalg.norm(given)
        cross = one[0].conj() * one[1]
        stokes = 1.0, float(abs(one[0]) ** 2 - abs(one[1]) ** 2), float(2 * cross.real), float(2 * cross.imag)
        return one[None], stokes
    real = given.real
    polarised = float(np.linalg.norm(real[1:])) if known else 0.0
    if not known or given.shape == (2,) or given.imag.any() or real[0] <= 0 or polarised > real[0] * (1 + ROUNDING):
        raise ValueError(
            f"polarization = {shown(polarization)}: must be a Jones vector (x, y), not (0, 0), or Stokes' parameters "
            "(S0, S1, S2, S3), S0 positive and the others together no longer"
        )
    _, s1, s2, s3 = (float(part) for part in real / real[0])
    coherency = np.array([[1 + s1, s2 - 1j * s3], [s2 + 1j * s3, 1 - s1]]) / 2
    sizes, vectors = np.linalg.eigh(coherency)
    kept = sizes > ROUNDING
    return (np.sqrt(sizes[kept]) * vectors[:, kept]).T, (1.0, s1, s2, s3)
