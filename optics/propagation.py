"""A sampled field carried from plane to plane by its angular spectrum.

The samples stand for the band-limited function through them, zero outside. Their spectrum is multiplied by the transfer
function of free space and summed again wherever the result is wanted:

    U(x, y; z) = F⁻¹{F{U₀} H},   H = exp(2πi z √((n/λ)² - fx² - fy²))     (Goodman, §3.10.2)

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
from optics.field import Field
from optics.fourier import fast_length, fourier_sum, predicted_seconds
from optics.grid import Grid
from optics.planner import FLOAT_NOISE, MOST_SAMPLES, AccuracyError, Plan
from optics.precision import Precision, opaque, precision

__all__ = ["PROPAGATION_METHODS", "RIPPLE_PER_TOLERANCE", "PropagationResult", "kept_band", "propagate"]

PROPAGATION_METHODS = ("angular_spectrum", "fresnel")
# Steepest light that the period makes room for, as sin θ; z tan θ has no bound beyond.
STEEPEST_SINE = 0.995
# Share of faded light that strays into the window: small, because the window may hold far less than is faded.
RIPPLE_PER_TOLERANCE = 3e-3


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
    """period [m]; spectrum: the grid of frequencies; band, fade [1/m]: kept up to band, gone at band + fade."""

    method: str
    source: Grid
    window: Grid
    wavelength: float
    distance: float
    period: float
    spectrum: Grid
    band: float
    fade: float
    ripple: float


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
    source = Grid(field.shape[-2:], dx)
    window = Grid(out_shape or source.shape, dx if out_dx is None else out_dx, out_centre)
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


@lru_cache(maxsize=64)
def _sampling(method: str, source: Grid, window: Grid, wavelength: float, distance: float, ripple: float) -> _Sampling:
    z, nyquist = abs(distance), math.sqrt(0.5) / source.dx  # along the diagonal
    paraxial = method == "fresnel"
    corner = source.half_diagonal + source.dx + window.half_diagonal
    band, fade = kept_band(corner, wavelength, z, ripple, paraxial)
    end = band + fade
    if end >= nyquist or (not paraxial and end * wavelength >= STEEPEST_SINE):
        band, fade = math.inf, 0.0  # nothing to fade: all that the samples hold may matter
        end = nyquist if paraxial else min(nyquist, STEEPEST_SINE / wavelength)
    halves = [
        (n // 2 + 1) * source.dx + (m // 2) * window.dx + abs(middle)
        for n, m, middle in zip(source.shape, window.shape, window.centre[::-1], strict=True)
    ]
    walk = _walk(end, wavelength, z, paraxial)
    least = max(max(halves) + walk, 2 * (max(source.shape) // 2 + 1) * source.dx)
    samples = fast_length(least / source.dx)
    period = samples * source.dx
    across = samples if math.isinf(band) else min(samples, 2 * math.ceil(end * period) + 1)
    if max(across, *window.shape) > MOST_SAMPLES:
        raise AccuracyError(
            f"distance = {distance:g} m over a window of {2 * window.half_width:.3g} m needs {across} samples across; "
            f"the limit is {MOST_SAMPLES}: shrink the window, or sample u more coarsely if it allows"
        )
    spectrum = Grid.square(across, 1 / period)
    return _Sampling(method, source, window, wavelength, distance, period, spectrum, band, fade, ripple)


def _walk(frequency: float, wavelength: float, z: float, paraxial: bool) -> float:
    """How far [m] to the side light of a spatial frequency [1/m] travels."""
    sine = frequency * wavelength
    return z * (sine if paraxial else sine / math.sqrt(1 - sine * sine))


def kept_band(corner: float, wavelength: float, z: float, ripple: float, paraxial: bool = False) -> tuple[float, float]:
    """Band kept whole for light that may walk `corner` [m] to the side over z, and the width [1/m] of the fade beyond
    it, that need the shortest period; (infinite, 0) where nothing may fade.

    A narrow fade blurs far, so that the band must reach as far outside the window; a wide one lets light walk far
    before it is gone. Either way the period has to hold what is not gone.
    """
    blur = 2 * math.log(1 / ripple) / math.pi
    if z == 0:
        return math.inf, 0.0
    best = (math.inf, math.inf, 0.0)
    for fade in np.geomspace(0.003, 0.6, 33) / wavelength:
        reach = corner + blur / fade
        band = reach / (z if paraxial else math.hypot(reach, z)) / wavelength
        if paraxial or (band + fade) * wavelength < STEEPEST_SINE:
            best = min(best, (_walk(band + fade, wavelength, z, paraxial), band, float(fade)))
    return best[1:]


def _one(plane: np.ndarray, how: _Sampling, types: Precision) -> tuple[np.ndarray, float, float]:
    """The propagated plane, the predicted error of its intensity, and the fraction of evanescent power."""
    plane = np.ascontiguousarray(plane, dtype=types.complex_dtype)
    spectrum = fourier_sum(plane, round(how.period / how.source.dx), how.spectrum.shape, -1)
    total = _power(plane) * how.source.dx**2
    if total == 0:
        return np.zeros(how.window.shape, types.complex_dtype), 0.0, 0.0
    space, window = _free_space(how, types.dtype), how.window
    unit = how.source.dx**4 / how.period**2
    shares = [_power(spectrum, weight) * unit for weight in (space.grazing, space.faded, space.evanescent)]
    spectrum *= space.transfer
    result = fourier_sum(spectrum, how.period / window.dx, window.shape, +1)
    arrived = _power(result) * window.dx**2
    loose, faded, evanescent = shares
    if not arrived:
        return result, math.inf, evanescent / total
    rounding = FLOAT_NOISE[types.dtype] * math.sqrt(total / arrived)
    error = 2 * math.sqrt(loose / arrived) + rounding + 2 * how.ripple * math.sqrt(faded / arrived)
    return result, error, evanescent / total


def _power(u: np.ndarray, weight: np.ndarray | None = ONE) -> float:
    """Σ w |u|² in float64; 0 without a weight."""
    if weight is None:
        return 0.0
    flat = u.view(u.real.dtype)
    if weight is ONE:
        return float(np.einsum("ij,ij->", flat, flat, dtype=np.float64))
    return float(np.dot((u.real**2 + u.imag**2).ravel(), weight.ravel()))


@dataclass(frozen=True, eq=False)
class _FreeSpace:
    """Free space between two planes, over the spectrum: the transfer function, with everything that does not depend on
    the field, and how much of each frequency is too near grazing, in the fade, or evanescent (None: nothing is)."""

    transfer: np.ndarray
    grazing: np.ndarray | None
    faded: np.ndarray | None
    evanescent: np.ndarray | None


@lru_cache(maxsize=4)
def _free_space(how: _Sampling, dtype: str) -> _FreeSpace:
    """The same distance is often travelled again; the transfer function costs more than the transforms."""
    types = precision(dtype)
    sine = np.hypot(how.spectrum.x[None, :], how.spectrum.y[:, None]) * how.wavelength
    every = math.isinf(how.band) and how.distance != 0 and how.method != "fresnel"
    grazing = (sine > STEEPEST_SINE) & (sine < 1) if every else None
    faded = sine > how.band * how.wavelength if how.fade else None
    # A frequency's cell on the circle f = n/λ counts by how far it reaches outside: the error falls with its width².
    outside = np.clip((sine - 1) / (how.spectrum.dx * how.wavelength) + 0.5, 0, 1)
    weights = (
        None if weight is None or not weight.any() else np.ascontiguousarray(weight, dtype=dtype)
        for weight in (grazing, faded, outside)
    )
    return _FreeSpace(_transfer(how, types), *weights)


def _transfer(how: _Sampling, types: Precision) -> np.ndarray:
    """H under the fade, over the spectrum's grid, with the sums' scale and the way to the window's centre; whole waves
    are dropped in float64."""
    import drjit as dr

    fx, fy = how.spectrum.coordinates(types)
    f2 = fx * fx + fy * fy
    s2 = f2 * opaque(types, how.wavelength**2)
    z = opaque(types, how.distance / how.wavelength)
    if how.method == "fresnel":
        waves, decay = z * (1 - s2 / 2), types.Float64(1)
    else:
        waves = z * dr.sqrt(dr.maximum(1 - s2, 0))
        gone = dr.exp(-2 * math.pi * dr.abs(z) * dr.sqrt(dr.maximum(s2 - 1, 0)))
        decay = dr.select(s2 < 1, 1, gone if how.distance >= 0 else 0)
    if how.fade:
        steepness = 2 * math.sqrt(math.log(1 / how.ripple)) / how.fade
        middle = how.band + how.fade / 2
        decay *= (1 - dr.erf((dr.sqrt(f2) - opaque(types, middle)) * opaque(types, steepness))) / 2
    waves += fx * opaque(types, how.window.centre[0]) + fy * opaque(types, how.window.centre[1])
    scale = opaque(types, (how.source.dx / how.period) ** 2)
    return Field.from_waves(decay * scale, waves, how.spectrum, types).numpy()


def _plan(how: _Sampling, error: float, dtype: str) -> Plan:
    kept = f"band {how.band * how.wavelength:.2g} n/λ" if how.fade else "the whole spectrum of u"
    why = f"period {how.period:.3g} m, {kept}" + ("; paraxial, as asked" if how.method == "fresnel" else "")
    samples = round(how.period / how.source.dx)
    seconds = predicted_seconds(how.source.shape, samples, how.spectrum.shape)
    seconds += predicted_seconds(how.spectrum.shape, how.period / how.window.dx, how.window.shape)
    any_samples: Any = (samples, samples)
    return Plan(how.method, any_samples, dtype, error, why, seconds)
