"""The focus of polarised light: three components of the electric field, according to Maxwell's equations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import in_range, of_kind, one_of, positive, shown, vacuum_wavelength, without_derivative
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.number_types import full_precision
from optics.numerics.precision import precision
from optics.point_spread.converging import Converging, VectorFocus

__all__ = ["vector_focus"]

FEWEST_ZONES = 20.0  # choice: smallest Fresnel number of an aplanatic lens whose rays meet in a point
ROUNDING = 1e-9
STEEPEST = 0.98  # choice: largest sine of rays behind the pupil, because fields change abruptly near 1


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
    tolerance: float = 1e-3,
) -> VectorFocus:
    """Return the electric field around the image of a distant point, behind a pupil of any shape.

    Geometrical optics gives the field in the pupil's plane: it is perpendicular to each ray. Smythe's integral (1947)
    then gives the field behind the pupil according to Maxwell's equations. A sum of plane waves, one for each point of
    the pupil (Debye's integral), is much faster. It is used if it meets the tolerance, for example near foci of high
    Fresnel number.

    wavelength: wavelength [m] in vacuum.
    sensor_distance: distance [m] behind the pupil. None: the focus of the ideal lens, or 240 µm if the pupil has no
        ideal lens.
    polarization: polarisation of the light in front of the pupil: a Jones vector (x, y) or Stokes parameters (S0, S1,
        S2, S3). Here S1 = |Ex|² - |Ey|², S2 = 2 Re(Ex* Ey) and S3 = 2 Im(Ex* Ey). None: unpolarised. For oblique light,
        the x and y of these definitions are rotated with the light's direction.
    source_angle: direction (x, y) [rad] of the light, as in `optics.psf`. The window lies around the image.
    apodization: "flat" for uniform light over a flat pupil, or "aplanatic" for light along the axis of a corrected
        objective. A ray of an aplanatic lens that leaves the pupil at the distance ξ from the axis goes to the focus.
        The sine of its angle to the axis is ξ/z, where z is the distance of the focus behind the pupil. The light is a
        sum of plane waves, one for each such ray (Richards and Wolf 1959).
    dx, shape: pitch [m] and number of samples (y, x) of the window.
    tolerance: relative L2 error of the intensity over the window.

    Raises:
        ValueError: an argument is invalid, the relief is pixelated, or a parameter carries derivatives. With
            "aplanatic" apodization, the pupil must have a focal length and no relief, wavefront or mask, its light must
            travel along the axis, and its radius must be smaller than the sensor distance.
        AccuracyError: no method meets the tolerance within the limits on memory and time. With "flat" apodization, the
            sine of a ray's angle to the axis must not exceed 0.98 behind the pupil. With "aplanatic" apodization, the
            Fresnel number must be at least 20, because otherwise the rays do not meet in a point.
        BackendError: see `optics.psf`.
    """
    of_kind("pupil", pupil, Pupil, "Pupil(25e-6)")
    lambda_ = vacuum_wavelength(wavelength)
    source = PointSource(math.inf, without_derivative("source_angle", source_angle)).plain
    one_of("apodization", apodization, ("flat", "aplanatic"))
    z = pupil.image_distance(math.inf) if sensor_distance is None else positive("sensor_distance", sensor_distance)
    _check_plain(pupil, lambda_)
    if pupil.pixels:
        raise ValueError("height is a PixelRelief: must be smooth, for each point to have one ray")
    tolerance = in_range("tolerance", tolerance, 1e-12, 0.5)
    beam = Beam(pupil, source, lambda_, z)
    _check_aplanatic(beam) if apodization == "aplanatic" else _check_rays(beam)
    amplitudes, shares = _polarised(polarization)
    towards = Converging(beam, apodization == "aplanatic", amplitudes, shares, tolerance)
    return towards.onto(Grid(shape, dx, towards.image))


def _check_plain(pupil: Pupil, wavelength: float) -> None:
    """Raise a ValueError if a parameter of the pupil carries a derivative."""
    types = precision("float64")
    at, middle = types.Float64(0.5), types.Float64(0.0)
    path = pupil.path(at * pupil.radius, middle, wavelength, PointSource())
    for part in (pupil.aperture_radius, path, pupil.amplitude(at, middle)):
        without_derivative("pupil", part)


def _check_rays(beam: Beam) -> None:
    """Raise an AccuracyError if, for a ray behind the pupil, the sine of its angle to the axis exceeds STEEPEST.

    Evanescent light, for which the sine is above 1, is refused as well.
    """
    steepest = beam.pupil.slopes(beam.wavelength, beam.source).steepest_inside / beam.index
    if steepest > STEEPEST:
        raise AccuracyError(
            f"rays leave the pupil with a sine of {steepest:.3g}: must be at most {STEEPEST:g}, "
            "beyond which light has no direction"
        )


def _check_aplanatic(beam: Beam) -> None:
    pupil, z = beam.pupil, number(beam.distance)
    zones = pupil.radius**2 * beam.index / (beam.wavelength * z)
    if zones < FEWEST_ZONES:
        raise AccuracyError(f"Fresnel number {zones:.3g}: must be at least {FEWEST_ZONES:g} for rays to meet; use psf")
    plain = pupil.height is None and pupil.wavefront is None and pupil.mask is None
    if not plain or beam.source.angle != (0.0, 0.0) or pupil.thin_lens_focal_length is None or pupil.radius >= z:
        raise ValueError(
            f"apodization = 'aplanatic': must be an ideal lens without relief, wavefront or mask, lit along its axis, "
            f"its radius {pupil.radius:.3g} m below the distance {z:.3g} m"
        )


def _polarised(polarization: Any) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """Return the Jones vectors of the light's polarised parts, (part, 2), and the Stokes parameters divided by S0.

    Polarised light has one part. Other light is the sum of two polarised parts that do not interfere.

    Raises:
        ValueError: `polarization` is neither a Jones vector nor Stokes parameters.
    """
    polarization = full_precision("polarization", without_derivative("polarization", polarization))
    try:
        given = np.asarray((1, 0, 0, 0) if polarization is None else polarization, dtype=complex)
    except (TypeError, ValueError, OverflowError):
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
            f"polarization = {shown(polarization)}: must be a Jones vector (x, y), not (0, 0), or Stokes parameters "
            "(S0, S1, S2, S3), with S0 positive and not below the norm of the others"
        )
    _, s1, s2, s3 = (float(part) for part in real / real[0])
    coherency = np.array([[1 + s1, s2 - 1j * s3], [s2 + 1j * s3, 1 - s1]]) / 2
    sizes, vectors = np.linalg.eigh(coherency)
    kept = sizes > ROUNDING
    return (np.sqrt(sizes[kept]) * vectors[:, kept]).T, (1.0, s1, s2, s3)
