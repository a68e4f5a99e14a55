"""A sampled field carried from plane to plane by its angular spectrum.

The samples stand for the band-limited function through them, zero outside. Their spectrum is multiplied by the transfer
function of free space and summed again wherever the result is wanted:

    U(x, y; z) = F⁻¹{F{U₀} H}     (Goodman, §3.10.2; H in optics.free_space)

A finite transform repeats the field every period. The period is chosen so that light aimed anywhere near the window
lands there once; light aimed farther is faded out before it can wrap around, and what the spectrum holds too near to
grazing for either is counted into the predicted error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from optics.arguments import finite, in_range, positive
from optics.fourier import (
    fast_length,
    fourier_sum,
    kept_indices,
    periodic_spectrum,
    periodic_sum,
    predicted_seconds,
)
from optics.free_space import EVERYTHING, STEEPEST_SINE, Passage, TransferFunction, kept_band, kept_square, walk
from optics.grid import Grid
from optics.planner import FLOAT_NOISE, MOST_SAMPLES, AccuracyError, Plan
from optics.precision import Precision, precision

__all__ = ["PROPAGATION_METHODS", "RIPPLE_PER_TOLERANCE", "PropagationResult", "propagate"]

PROPAGATION_METHODS = ("angular_spectrum", "fresnel")
# Share of faded light that strays into the window: small, because the window may hold far less than is faded.
RIPPLE_PER_TOLERANCE = 3e-3
# Pitches are one and the same where they differ by less than this share of a sample over the whole window.
SAME_PITCH = 1e-9


ONE = np.ones(1)  # the weight of what counts whole


@dataclass(frozen=True, eq=False)
class PropagationResult:
    """u: complex field (…, y, x) at pitch dx [m], centre sample n//2. plan: how it was computed, and how well.

    evanescent_power: fraction of the input's power in waves that do not propagate. Forwards they decay; backwards they
        are dropped, since undoing the decay would amplify noise without bound.
    """

    u: np.ndarray
    dx: float
    plan: Plan
    evanescent_power: float


@dataclass(frozen=True)
class _Sampling:
    """period: in samples of the source; across: frequencies kept along each axis; step: the window's pitch in samples
    of the source where it is a whole number of them, else 0."""

    passage: Passage
    source: Grid
    window: Grid
    period: int
    across: int
    step: int

    @property
    def method(self) -> str:
        return "fresnel" if self.passage.paraxial else "angular_spectrum"


def propagate(
    u: np.ndarray,
    *,
    dx: float,
    wavelength: float,
    distance: float,
    out_dx: float | None = None,
    out_shape: tuple[int, int] | None = None,
    out_centre: tuple[float, float] = (0.0, 0.0),
    medium_n: float = 1.0,
    tolerance: float = 1e-3,
    method: str = "auto",
    dtype: str = "float32",
) -> PropagationResult:
    """Field at `distance` [m] behind (or, negative, before) the plane in which it is u, carrier exp(ikz) included.

    u: complex (…, y, x), pitch dx [m], centre sample n//2. wavelength: vacuum [m].
    out_dx, out_shape, out_centre: pitch, shape (y, x) and centre (x, y) [m] wanted; default as u's, on the axis.
    tolerance: relative L2 error of the intensity over the window, beyond that of the sampling of u itself.
    method: "auto" and "angular_spectrum" are exact; "fresnel" is the paraxial approximation, only on request.

    Raises:
        ValueError: bad argument, named with its value and valid range.
        AccuracyError: the tolerance cannot be met; says what can.
    """
    if method not in ("auto", *PROPAGATION_METHODS):
        raise ValueError(f"method = {method!r}: must be 'auto' or one of {', '.join(PROPAGATION_METHODS)}")
    field = _field(u)
    window = Grid(out_shape or field.shape[-2:], dx if out_dx is None else out_dx, out_centre)
    field = _lit(field)
    source = Grid(field.shape[-2:], dx)
    in_range("tolerance", tolerance, 10 * FLOAT_NOISE[precision(dtype).dtype], 0.5)
    how = _sampling(
        "angular_spectrum" if method == "auto" else method,
        source,
        window,
        positive("wavelength", wavelength) / in_range("medium_n", medium_n, 1.0, 10.0),
        finite("distance", distance),
        RIPPLE_PER_TOLERANCE * tolerance,
    )
    types = precision(dtype)
    planes = [_one(plane, how, types) for plane in field.reshape(-1, *source.shape)]
    out = np.stack([plane for plane, _, _ in planes]).reshape(*field.shape[:-2], *window.shape)
    error = max(error for _, error, _ in planes) + FLOAT_NOISE[dtype]
    if error > tolerance:
        raise AccuracyError(
            f"tolerance = {tolerance:g}: too much of the light leaves so flat, or so little of it meets the window, "
            f"that the error reaches {error:.1g}; ask for that, or for a larger out_shape"
        )
    return PropagationResult(out, window.dx, _plan(how, error, dtype), max(lost for _, _, lost in planes))


def _field(u: np.ndarray) -> np.ndarray:
    field = np.asarray(u)
    if field.ndim < 2 or 0 in field.shape:
        raise ValueError(f"u has shape {field.shape}: must be (…, y, x), not empty")
    if not np.isfinite(field).all():
        raise ValueError("u: must be finite everywhere")
    return field


def _lit(field: np.ndarray) -> np.ndarray:
    """The smallest part around the centre sample that holds all light: darkness around it would be carried at the same
    cost."""
    for axis in (-2, -1):
        n = field.shape[axis]
        lit = np.flatnonzero(field.any(axis=tuple(a for a in range(field.ndim) if a != field.ndim + axis)))
        half = int(np.abs(lit - n // 2).max(initial=0))
        if 2 * half + 1 < n:
            field = np.take(field, range(n // 2 - half, n // 2 + half + 1), axis=axis)
    return field


@lru_cache(maxsize=64)
def _sampling(method: str, source: Grid, window: Grid, wavelength: float, distance: float, ripple: float) -> _Sampling:
    z, nyquist, paraxial = abs(distance), math.sqrt(0.5) / source.dx, method == "fresnel"  # along the diagonal
    halves = [
        (n // 2 + 1) * source.dx + (m // 2) * window.dx + abs(middle)
        for n, m, middle in zip(source.shape, window.shape, window.centre[::-1], strict=True)
    ]
    corner = source.half_diagonal + source.dx + window.half_diagonal
    bands = (
        kept_square(max(halves), wavelength, z, ripple, paraxial),
        kept_band(corner, wavelength, z, ripple, paraxial),
    )
    band = min(bands, key=lambda band: band.walk)
    far = band.walk
    # Where nothing can fade, all that the samples hold may matter.
    if band.end >= (0.5 / source.dx if band.square else nyquist):
        end = nyquist if paraxial else min(nyquist, STEEPEST_SINE / wavelength)
        # To the corner's walk along either axis: what ends at Nyquist's frequency as if cut blurs far.
        band, far = EVERYTHING, walk(end, wavelength, z, paraxial)
    least = max(max(halves) + far, 2 * (max(source.shape) // 2 + 1) * source.dx)
    samples = fast_length(least / source.dx)
    # Evanescent waves are kept for their power, which is reported.
    highest = max(band.end, 0 if paraxial else 1 / wavelength)
    half = highest * samples * source.dx  # as a float: it may be infinite
    across = 2 * math.ceil(half) + 1 if band.fade and 2 * half + 2 < samples else samples
    if max(across, *window.shape) > MOST_SAMPLES:
        raise AccuracyError(
            f"distance = {distance:g} m over a window of {2 * window.half_width:.3g} m needs {across} samples across; "
            f"the limit is {MOST_SAMPLES}: shrink the window, or sample u more coarsely if it allows"
        )
    step = round(window.dx / source.dx)
    exactly = abs(window.dx - step * source.dx) <= SAME_PITCH * source.dx / max(window.shape)
    passage = Passage(wavelength, distance, paraxial, band, ripple, window.centre)
    return _Sampling(passage, source, window, samples, across, step if exactly else 0)


def _one(plane: np.ndarray, how: _Sampling, types: Precision) -> tuple[np.ndarray, float, float]:
    """The propagated plane, the predicted error of its intensity, and the fraction of evanescent power."""
    plane = np.ascontiguousarray(plane, dtype=types.complex_dtype)
    total = _power(plane)
    if total == 0:
        return np.zeros(how.window.shape, types.complex_dtype), 0.0, 0.0
    space = _free_space(how, types.dtype)
    if how.step:
        spectrum = periodic_spectrum(plane, how.period, how.across)
    else:
        spectrum = fourier_sum(plane, how.period, (how.across, how.across), -1)
    grazing, evanescent = (_power(spectrum, weight) / how.period**2 for weight in (space.grazing, space.evanescent))
    spectrum *= space.transfer
    # Parseval: what neither passes nor is evanescent was faded. In float32 the difference is rounding, which is little
    # beside what the fade leaves of it.
    faded = max(total - _power(spectrum) * how.period**2 - evanescent, 0.0) if how.passage.band.fade else 0.0
    if how.step:
        result = periodic_sum(spectrum, how.period, how.step, how.window.shape)
    else:
        result = fourier_sum(spectrum, how.period * how.source.dx / how.window.dx, how.window.shape, +1)
    arrived = _power(result) * (how.window.dx / how.source.dx) ** 2
    if not arrived:
        return result, math.inf, min(evanescent / total, 1.0)
    rounding = FLOAT_NOISE[types.dtype] * math.sqrt(total / arrived)
    error = 2 * math.sqrt(grazing / arrived) + rounding + 2 * how.passage.ripple * math.sqrt(faded / arrived)
    return result, error, min(evanescent / total, 1.0)


def _power(u: np.ndarray, weight: np.ndarray | None = ONE) -> float:
    """Σ w |u|², weights (y, 2 x) of real and imaginary parts; 0 without a weight."""
    if weight is None:
        return 0.0
    if weight is ONE:
        return float(np.vdot(u, u).real)
    parts = u.view(weight.dtype)
    return float(np.dot((parts * parts).ravel(), weight.ravel()))


@lru_cache(maxsize=4)
def _free_space(how: _Sampling, dtype: str) -> TransferFunction:
    """Over the spectrum, with the sums' scale. The same distance is often travelled again; the transfer function costs
    more than the transforms."""
    step = 1 / (how.period * how.source.dx)
    if how.step:
        fx, fy = (kept_indices(how.period, n) * step for n in (how.across, how.period))
    else:
        fx = fy = Grid.square(how.across, step).x
    space = how.passage.over(fx, fy, precision(dtype))
    space.transfer[:] *= 1 / how.period**2
    return space


def _plan(how: _Sampling, error: float, dtype: str) -> Plan:
    band = how.passage.band
    kept = f"band {band.kept * how.passage.wavelength:.2g} n/λ" if band.fade else "the whole spectrum of u"
    period = how.period * how.source.dx
    why = f"period {period:.3g} m, {kept}" + ("; paraxial, as asked" if how.passage.paraxial else "")
    spectrum = how.across, how.across
    seconds = predicted_seconds(how.source.shape, how.period, spectrum)
    seconds += predicted_seconds(spectrum, period / how.window.dx, how.window.shape)
    any_samples: Any = (how.period, how.period)
    return Plan(how.method, any_samples, dtype, error, why, seconds)
