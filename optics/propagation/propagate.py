"""Propagation of a sampled field from one plane to another, by its angular spectrum or by matrix products.

The given samples define a band-limited function, which is zero at all sampling points beyond them. Its spectrum is
multiplied by the transfer function of free space and transformed onto the output samples:

    U(x, y; z) = F⁻¹{F{U₀} H}     (Goodman, §3.10.2; H in optics.propagation.transfer_function)

A finite transform repeats the field periodically, so light that lands one period away would wrap around into the
window. The period is long enough for light that lands near the window, and a smooth fade in the spectrum removes light
that lands farther away. Neither of them keeps light close to grazing incidence away from the window. The predicted
error includes the effect of this light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, Plan, above
from optics.numerics.arguments import complexes, finite, in_range, shown, vacuum_wavelength, without_derivative
from optics.numerics.grid import Grid, OnWindow
from optics.numerics.precision import Precision, precision
from optics.numerics.read_only import ReadOnlyArrays
from optics.propagation.field_derivatives import LinearMap
from optics.propagation.misalignment import Depths
from optics.propagation.separable_kernel import SeparableSampling, separable
from optics.propagation.spectrum_filter import PropagatedPlane, evanescent_share, filtered, linear_map
from optics.propagation.transfer_function import EVERYTHING, Passage
from optics.propagation.transform_sampling import TransformSampling, blur_left, most_spare, sampling

__all__ = [
    "PROPAGATION_METHODS",
    "WRAP_RIPPLE_PER_TOLERANCE",
    "PropagationResult",
    "lit_part",
    "propagate",
    "propagated_between_depths",
    "propagated_field",
    "step_map",
]

PROPAGATION_METHODS = ("angular_spectrum", "fresnel")
# Choice: fraction of the removed light that may still reach the window, relative to the tolerance. It is small, because
# the window may contain far less light than is removed.
WRAP_RIPPLE_PER_TOLERANCE = 3e-3
# Choice: initial padding, in units of √(λz), for the blur due to truncation of the spectrum at the Nyquist frequency.
SPARE = 1.0
# Choice: a field is propagated again if the blur exceeds the limit by this factor. The blur is an estimate, which is
# correct to a factor of two or three.
CLEARLY = 1.5
# Choice: fraction of the tolerance for the part of the kernel that is not separable.
SEPARABLE_SHARE = 0.7


@dataclass(frozen=True, eq=False)
class PropagationResult(ReadOnlyArrays, OnWindow):
    """A propagated field.

    u: complex field (…, y, x) at the pitch dx [m], with the carrier exp(ikz). Sample n//2 is at `window.centre`.
    plan: method and predicted error. For "fresnel", the error of the paraxial approximation is not included.
    window: grid of the samples [m].
    """

    u: np.ndarray
    dx: float
    plan: Plan
    window: Grid
    _source: np.ndarray = field(repr=False)  # (plane, y, x)
    _sampling: TransformSampling | SeparableSampling = field(repr=False)

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
        how = self._sampling
        return max(evanescent_share(plane, how.period, how.source.dx, how.passage) for plane in self._source)


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

    u: complex field (…, y, x) at the pitch dx [m]. Sample n//2 is on the axis, and the field is 0 beyond the samples.
    wavelength: wavelength [m] in vacuum.
    distance: distance [m] behind the plane of u; negative for planes in front of it.
    out_dx, out_shape, out_centre: pitch [m], shape (y, x) and centre (x, y) [m] of the output. By default, pitch and
        shape equal those of u, and the centre is on the axis.
    tolerance: relative L2 error of the intensity over the output, for exact samples u. The smallest tolerance is 1e-5
        for float32 and 3e-12 for float64. If u contains light at the Nyquist frequency, its samples are too coarse.
        This light causes an additional error. The result's `plan` states this error if it exceeds the tolerance.
    method: "angular_spectrum" is exact and uses Fourier transforms. "auto" is exact as well. If the output is far away
        or far from the axis, "auto" uses matrix products if they are faster. "fresnel" is the paraxial approximation.
    medium_n: refractive index of the space, 1 to 10.
    dtype: "float32" or "float64", the precision of the result.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range.
        AccuracyError: no sampling meets the tolerance. The message states the error, or the number of samples that
            would be necessary.
        BackendError: see `optics.psf`.
    """
    if not isinstance(method, str) or method not in ("auto", *PROPAGATION_METHODS):
        raise ValueError(f"method = {shown(method)}: must be 'auto' or one of {', '.join(PROPAGATION_METHODS)}")
    for name, value in (("u", u), ("distance", distance), ("medium_n", medium_n)):
        without_derivative(name, value)
    given = _field(u)
    window = Grid(given.shape[-2:] if out_shape is None else out_shape, dx if out_dx is None else out_dx, out_centre)
    in_range("tolerance", tolerance, 10 * FLOAT_NOISE[precision(dtype).dtype], 0.5)
    passage = Passage(
        vacuum_wavelength(wavelength) / in_range("medium_n", medium_n, 1.0, 10.0),
        finite("distance", distance),
        method == "fresnel",
        EVERYTHING,
        WRAP_RIPPLE_PER_TOLERANCE * tolerance,
        window.centre,
        by_transforms=method == "angular_spectrum",
    )
    return propagated_field(given, dx, passage, window, tolerance, dtype)


def propagated_field(
    given: np.ndarray, dx: float, passage: Passage, window: Grid, tolerance: float, dtype: str
) -> PropagationResult:
    """Return the field (…, y, x) propagated onto the window. The arguments are not checked.

    Raises:
        AccuracyError: no sampling meets the tolerance.
    """
    lit = lit_part(given)
    source = Grid(lit.shape[-2:], dx)
    sources = lit.reshape(-1, *source.shape)
    if np.may_share_memory(sources, given):  # the result stores the sources, so later changes of u must not affect them
        sources = sources.copy()
    how, planes = _propagated(sources, passage, (source, window), tolerance, precision(dtype))
    out = np.stack([plane.u for plane in planes]).reshape(*given.shape[:-2], *window.shape)
    return PropagationResult(out, window.dx, _plan(how, planes, tolerance, dtype), window, sources, how)


def propagated_between_depths(
    u: np.ndarray, how: TransformSampling, depths: Depths, tolerance: float, dtype: str
) -> PropagationResult:
    """Return the field (y, x) after a step between tilted planes, see optics.propagation.misalignment.

    Raises:
        AccuracyError: the predicted error exceeds the tolerance.
    """
    how = replace(how, step=0)
    planes = [filtered(u, how, precision(dtype), depths)]
    return PropagationResult(planes[0].u, how.window.dx, _plan(how, planes, tolerance, dtype), how.window, u[None], how)


def step_map(result: PropagationResult, shape: tuple[int, int], depths: Depths | None) -> LinearMap:
    """Return a linear map of fields (y, x) that repeats the propagation from which `result` was computed.

    The propagation must have used Fourier transforms, not matrix products.

    shape: shape (y, x) of the fields before the propagation.
    depths: if a plane is tilted, the depths at which fields are computed, and between which they are interpolated.
    """
    how = result._sampling
    assert isinstance(how, TransformSampling)
    return linear_map(how, shape, precision(result.u.real.dtype.name), depths)


def _field(u: np.ndarray) -> np.ndarray:
    field = complexes("u", u)
    if field.ndim < 2 or 0 in field.shape:
        raise ValueError(f"u has shape {field.shape}: must be (…, y, x), not empty")
    if not np.isfinite(field).all():
        raise ValueError("u: must be finite everywhere")
    return field


def lit_part(field: np.ndarray) -> np.ndarray:
    """Return the smallest part of a field (…, y, x) that has the same centre sample and contains all lit samples.

    Dark samples outside this part would only increase the cost.
    """
    for axis in (-2, -1):
        n = field.shape[axis]
        lit = np.flatnonzero(field.any(axis=tuple(a for a in range(field.ndim) if a != field.ndim + axis)))
        half = int(np.abs(lit - n // 2).max(initial=0))
        if 2 * half + 1 < n:
            field = np.take(field, range(n // 2 - half, n // 2 + half + 1), axis=axis)
    return field


def _propagated(
    sources: np.ndarray, passage: Passage, grids: tuple[Grid, Grid], tolerance: float, types: Precision
) -> tuple[TransformSampling | SeparableSampling, list[PropagatedPlane]]:
    """Return the sampling of the propagation, and the propagated fields. `sources` holds the fields, (field, y, x).

    Matrix products are used if they are possible and predicted to be faster, and Fourier transforms otherwise.
    """
    direct = separable(passage, *grids, SEPARABLE_SHARE * tolerance)
    if direct is None:
        return _with_padding(sources, passage, grids, tolerance, types)
    try:
        how = sampling(passage, *grids, 0.0)
    except AccuracyError:
        how = None
    count = len(sources)
    if how is None or direct.seconds(types.dtype, count) < how.seconds(types.dtype, count):
        return direct, [direct.propagated(plane, types) for plane in sources]
    return how, [filtered(plane, how, types) for plane in sources]


def _with_padding(
    sources: np.ndarray, passage: Passage, grids: tuple[Grid, Grid], tolerance: float, types: Precision
) -> tuple[TransformSampling, list[PropagatedPlane]]:
    """Return the sampling and the propagated fields, with enough padding to keep a blur away from the window.

    The spectrum is truncated at the Nyquist frequency. Light at this frequency therefore causes a blur, which becomes
    weaker if the padding of the Fourier transform is increased.

    If even the largest useful padding (`most_spare`) is insufficient, the samples themselves are too coarse. An initial
    padding of about √(λz) is then kept.
    """
    most = most_spare(passage, grids[0])
    spare = min(SPARE * math.sqrt(passage.wavelength * abs(passage.z)), most)
    how = sampling(passage, *grids, spare)
    planes = [filtered(plane, how, types) for plane in sources]
    blur = max(plane.blur for plane in planes)
    allowed = CLEARLY * (tolerance - max(plane.error for plane in planes))
    if spare < most and blur > allowed and blur * blur_left(how, sampling(passage, *grids, most)) < allowed:
        # The blur is proportional to 1 / spare. Choice: a fifth more padding than this implies.
        how = sampling(passage, *grids, min(1.2 * CLEARLY * blur / allowed * spare, most))
        planes = [filtered(plane, how, types) for plane in sources]
    return how, planes


def _sample_note(planes: list[PropagatedPlane], tolerance: float) -> str:
    """Return a note on the error of coarse input samples if it exceeds the tolerance, else an empty string.

    The predicted error does not include this error.
    """
    blur = max(plane.blur for plane in planes)
    if blur <= tolerance:
        return ""
    error = above(blur, tolerance)
    return f"; light at u's Nyquist frequency adds an error of about {error}: sample u more finely or soften its edges"


def _plan(
    how: TransformSampling | SeparableSampling, planes: list[PropagatedPlane], tolerance: float, dtype: str
) -> Plan:
    """Return the plan of a propagation.

    Raises:
        AccuracyError: the predicted error exceeds the tolerance.
    """
    error = max(plane.error for plane in planes)
    if not error <= tolerance:
        raise AccuracyError(
            f"tolerance = {tolerance:g}: the error reaches {above(error, tolerance)}, because too much of the light is "
            "near grazing incidence or too little of it hits the window; widen the tolerance or enlarge out_shape"
        )
    return Plan(
        how.method,
        how.samples,
        dtype,
        error,
        how.why + _sample_note(planes, tolerance),
        how.seconds(dtype, len(planes)),
    )
