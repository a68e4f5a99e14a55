"""Propagation of a sampled field from one plane to another by its angular spectrum.

The samples define a band-limited function, which is zero outside the sampled area. Its spectrum is multiplied by the
transfer function of free space and transformed onto the output samples:

    U(x, y; z) = F⁻¹{F{U₀} H}     (Goodman, §3.10.2; H in optics.propagation.transfer_function)

A finite transform repeats the field periodically, so light that lands one period away would wrap around into the
window. The period is long enough for light that lands near the window, and a smooth fade in the spectrum removes light
that lands farther away. Neither is possible close to grazing incidence; the predicted error includes such light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, Plan, above
from optics.numerics.arguments import complexes, finite, in_range, shown, vacuum_wavelength, without_derivative
from optics.numerics.fourier import fourier_sum, kept_indices, periodic_spectrum, periodic_sum, predicted_seconds
from optics.numerics.grid import Grid, OnWindow
from optics.numerics.precision import Precision, precision
from optics.numerics.read_only import ReadOnlyArrays
from optics.propagation.transfer_function import EVERYTHING, Passage, TransferFunction, evanescent
from optics.propagation.transform_sampling import TransformSampling, blur_left, blurred_back, most_spare, sampling

__all__ = ["PROPAGATION_METHODS", "WRAP_RIPPLE_PER_TOLERANCE", "PropagationResult", "propagate"]

PROPAGATION_METHODS = ("angular_spectrum", "fresnel")
# Choice: fraction of the removed light that may still reach the window, relative to the tolerance. It is small, because
# the window may contain far less light than is removed.
WRAP_RIPPLE_PER_TOLERANCE = 3e-3
# Choice: initial padding, in units of √(λz), for the blur due to truncation of the spectrum at the Nyquist frequency.
SPARE = 1.0
# Choice: a field is propagated again if the blur, estimated to a factor of two or three, exceeds the limit this much.
CLEARLY = 1.5
# Choice: the evanescent part of the missing light is computed if the missing light exceeds the arriving light by this
# factor. Smaller amounts hardly affect the predicted error.
MUCH = 100.0

HELD = (1e-20, 1e30)  # range of the power Σ|u|² for which float32 can represent the terms of the error estimate
ONE = np.ones(1)  # stands for equal weights in a sum


@dataclass(frozen=True, eq=False)
class PropagationResult(ReadOnlyArrays, OnWindow):
    """A propagated field.

    u: complex field (…, y, x) at the pitch dx [m]. Sample n//2 is the centre.
    plan: method and predicted error.
    window: grid of the samples [m].
    """

    u: np.ndarray
    dx: float
    plan: Plan
    window: Grid
    _source: np.ndarray = field(repr=False)  # (plane, y, x)
    _sampling: TransformSampling = field(repr=False)

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.u.shape))
        error = f"predicted error {self.plan.predicted_error:.1e}"
        return f"<PropagationResult of {size} samples {self.dx:.3g} m apart, {self.plan.method}, {error}>"

    @cached_property
    def evanescent_power(self) -> float:
        """Fraction of the input's power in waves that do not propagate. For several planes, it is the largest fraction.

        In forward propagation, these waves decay. In backward propagation they are omitted, because undoing the decay
        would amplify noise without bound.
        """
        return max(_evanescent_share(plane, self._sampling) for plane in self._source)


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
    """Propagate the field u through free space and return it in a parallel plane, including the carrier exp(ikz).

    u: complex field (…, y, x) at the pitch dx [m]. Sample n//2 is the centre.
    wavelength: wavelength [m] in vacuum.
    distance: distance [m] behind the plane of u; negative for planes in front of it.
    out_dx, out_shape, out_centre: pitch [m], shape (y, x) and centre (x, y) [m] of the output. By default, pitch and
        shape equal those of u, and the centre is on the axis.
    tolerance: relative L2 error of the intensity over the output, for exact samples u. If u contains light at its
        Nyquist frequency, that is, if it is sampled too coarsely, the plan states the additional error.
    method: "auto" and "angular_spectrum" are exact. "fresnel" is the paraxial approximation.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range.
        AccuracyError: no sampling meets the tolerance. The message states which tolerance is possible.
    """
    if not isinstance(method, str) or method not in ("auto", *PROPAGATION_METHODS):
        raise ValueError(f"method = {shown(method)}: must be 'auto' or one of {', '.join(PROPAGATION_METHODS)}")
    for name, value in (("u", u), ("distance", distance), ("medium_n", medium_n)):
        without_derivative(name, value)
    given = _field(u)
    window = Grid(given.shape[-2:] if out_shape is None else out_shape, dx if out_dx is None else out_dx, out_centre)
    lit = _lit(given)
    source = Grid(lit.shape[-2:], dx)
    sources = lit.reshape(-1, *source.shape)
    if np.may_share_memory(sources, given):  # the result stores the sources, so later changes of u must not affect them
        sources = sources.copy()
    in_range("tolerance", tolerance, 10 * FLOAT_NOISE[precision(dtype).dtype], 0.5)
    passage = Passage(
        vacuum_wavelength(wavelength) / in_range("medium_n", medium_n, 1.0, 10.0),
        finite("distance", distance),
        method == "fresnel",
        EVERYTHING,
        WRAP_RIPPLE_PER_TOLERANCE * tolerance,
        window.centre,
    )
    how, planes = _with_padding(sources, passage, (source, window), tolerance, precision(dtype))
    out = np.stack([plane.u for plane in planes]).reshape(*given.shape[:-2], *window.shape)
    error = max(plane.error for plane in planes)
    if not error <= tolerance:
        raise AccuracyError(
            f"tolerance = {tolerance:g}: the error reaches {above(error, tolerance)}, because too much of the light is "
            "near grazing incidence or too little of it hits the window; widen the tolerance or enlarge out_shape"
        )
    plan = _plan(how, error, _sample_note(planes, tolerance), dtype)
    return PropagationResult(out, window.dx, plan, window, sources, how)


def _field(u: np.ndarray) -> np.ndarray:
    field = complexes("u", u)
    if field.ndim < 2 or 0 in field.shape:
        raise ValueError(f"u has shape {field.shape}: must be (…, y, x), not empty")
    if not np.isfinite(field).all():
        raise ValueError("u: must be finite everywhere")
    return field


def _lit(field: np.ndarray) -> np.ndarray:
    """Return the smallest part of a field around the centre sample that contains all light.

    Dark samples outside it would only increase the cost.
    """
    for axis in (-2, -1):
        n = field.shape[axis]
        lit = np.flatnonzero(field.any(axis=tuple(a for a in range(field.ndim) if a != field.ndim + axis)))
        half = int(np.abs(lit - n // 2).max(initial=0))
        if 2 * half + 1 < n:
            field = np.take(field, range(n // 2 - half, n // 2 + half + 1), axis=axis)
    return field


@dataclass(frozen=True)
class _Carried:
    """A propagated plane.

    u: field (y, x).
    error: predicted error of the intensity.
    blur: additional error from light at the Nyquist frequency of the samples.
    """

    u: np.ndarray
    error: float
    blur: float


def _with_padding(
    sources: np.ndarray, passage: Passage, grids: tuple[Grid, Grid], tolerance: float, types: Precision
) -> tuple[TransformSampling, list[_Carried]]:
    """Return the planes, propagated with enough padding for the blur due to light at the Nyquist frequency.

    If even the largest useful padding is insufficient, none is added, because the samples themselves are then too
    coarse.
    """
    most = most_spare(passage, grids[0])
    spare = min(SPARE * math.sqrt(passage.wavelength * abs(passage.z)), most)
    how = sampling(passage, *grids, spare)
    planes = [_one(plane, how, types) for plane in sources]
    blur = max(plane.blur for plane in planes)
    allowed = CLEARLY * (tolerance - max(plane.error for plane in planes))
    if spare < most and blur > allowed and blur * blur_left(how, sampling(passage, *grids, most)) < allowed:
        # The blur is proportional to 1 / spare. Choice: a fifth more padding than this implies.
        how = sampling(passage, *grids, min(1.2 * CLEARLY * blur / allowed * spare, most))
        planes = [_one(plane, how, types) for plane in sources]
    return how, planes


def _one(plane: np.ndarray, how: TransformSampling, types: Precision) -> _Carried:
    given, brightest = plane, 1.0
    with np.errstate(over="ignore"):
        plane = np.ascontiguousarray(given, dtype=types.complex_dtype)
        total = _power(plane)
    # Divide u by its brightest sample, so that float32 can represent the powers.
    if not HELD[0] < total < HELD[1]:
        brightest = float(np.abs(given).max(initial=0.0))
        if brightest == 0:
            return _Carried(np.zeros(how.window.shape, types.complex_dtype), 0.0, 0.0)
        plane = np.ascontiguousarray(given / brightest, dtype=types.complex_dtype)
        total = _power(plane)
    space = _free_space(how, types.dtype)
    if how.step:
        spectrum = periodic_spectrum(plane, how.period, how.across)
    else:
        spectrum = fourier_sum(plane, how.period, (how.across, how.across), -1)
    grazing = _power(spectrum, space.grazing) / how.period**2
    blurred = blurred_back(spectrum, how)
    spectrum *= space.transfer
    # By Parseval's theorem, missing power was either faded out or is evanescent. If no power is missing, the difference
    # is a rounding error of float32, which is small compared with the remainder of the fade.
    faded = max(total - _power(spectrum) * how.period**2, 0.0) if how.passage.band.fade else 0.0
    if how.step:
        result = periodic_sum(spectrum, how.period, how.step, how.window.shape)
    else:
        result = fourier_sum(spectrum, how.period * how.source.dx / how.window.dx, how.window.shape, +1)
    arrived = _power(result) * (how.window.dx / how.source.dx) ** 2
    if not arrived:
        return _Carried(result, math.inf, math.inf)
    if faded > MUCH * arrived:
        faded = max(faded - total * _evanescent_share(plane, how), 0.0)
    rounding = FLOAT_NOISE[types.dtype] * (1 + math.sqrt(total / arrived))
    # Light at the start of a fade is blurred but hardly weaker. It is assumed to be as bright as the light that
    # arrives.
    blurred_by_fade = 2 * how.passage.ripple * (1 + math.sqrt(faded / arrived)) if how.passage.band.fade else 0.0
    error = 2 * math.sqrt(grazing / arrived) + rounding + blurred_by_fade
    result = result if brightest == 1 else result * result.dtype.type(brightest)
    return _Carried(result, error, 2 * math.sqrt(blurred / arrived))


def _evanescent_share(plane: np.ndarray, how: TransformSampling) -> float:
    """Return the evanescent fraction of a plane's power."""
    total = _power(plane)
    if total == 0 or how.passage.paraxial:
        return 0.0
    spectrum = periodic_spectrum(plane, how.period, how.period)
    weights = evanescent(how.period, how.source.dx, how.passage.wavelength)
    lost = float(np.sum(weights * (spectrum.real**2 + spectrum.imag**2), dtype=np.float64)) / how.period**2
    return min(lost / total, 1.0)


def _power(u: np.ndarray, weight: np.ndarray | None = ONE) -> float:
    """Return Σ w |u|². The weights are for real and imaginary parts. The result is 0 if the weight is None."""
    if weight is None:
        return 0.0
    if weight is ONE:
        return float(np.vdot(u, u).real)
    parts = u.view(weight.dtype)
    return float(np.dot((parts * parts).ravel(), weight.ravel()))


@lru_cache(maxsize=4)
def _free_space(how: TransformSampling, dtype: str) -> TransferFunction:
    """Return the transfer function over the spectrum, including the normalisation of the transforms.

    It is cached, because it takes more time than the transforms, and the same distance is often used again.
    """
    step = 1 / (how.period * how.source.dx)
    if how.step:  # the axes of the spectrum are (fx, fy)
        fx, fy = (kept_indices(n) * step for n in (how.across, how.period))
        space = replace(how.passage, centre=how.passage.centre[::-1]).over(fy, fx, precision(dtype))
    else:
        fx = fy = Grid.square(how.across, step).x
        space = how.passage.over(fx, fy, precision(dtype))
    space.transfer[:] *= 1 / how.period**2
    return space


def _sample_note(planes: list[_Carried], tolerance: float) -> str:
    """Return a note on the error of coarse input samples if it exceeds the tolerance, else an empty string.

    The predicted error does not include this error.
    """
    blur = max(plane.blur for plane in planes)
    if blur <= tolerance:
        return ""
    error = above(blur, tolerance)
    return f"; light at u's Nyquist frequency adds an error of about {error}: sample u more finely or soften its edges"


def _plan(how: TransformSampling, error: float, note: str, dtype: str) -> Plan:
    band = how.passage.band
    kept = f"band {band.kept * how.passage.wavelength:.2g} n/λ" if band.fade else "the whole spectrum of u"
    period = how.period * how.source.dx
    why = f"period {period:.3g} m, {kept}" + ("; paraxial, as requested" if how.passage.paraxial else "") + note
    spectrum = how.across, how.across
    seconds = predicted_seconds(how.source.shape, how.period, spectrum)
    seconds += predicted_seconds(spectrum, period / how.window.dx, how.window.shape)
    any_samples: Any = (how.period, how.period)
    return Plan(how.method, any_samples, dtype, error, why, seconds)
