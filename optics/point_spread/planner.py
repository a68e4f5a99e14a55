"""Choice of a PSF's method and samples: the fastest combination whose predicted error is within the tolerance.

All exact methods evaluate the first Rayleigh-Sommerfeld integral of the field behind the pupil, or its equivalent, the
angular spectrum. The methods differ in the samples of the pupil or of its spectrum:

- "hankel": two one-dimensional transforms along the radius. It requires a rotationally symmetric pupil and light along
    its axis.
- "low_rank": one matrix product. The kernel is a Fourier kernel times a second factor, which varies slowly over the
    window and therefore has a low rank. The method is best near the focus of lenses and for small pupils: the phases of
    lens and path are added, and samples must resolve only the sum, which varies far less than either phase.
- "far_field": Fourier transforms onto direction cosines. One transform is computed for each of a few points (nodes) of
    the window. Between the nodes, the factor of the kernel that varies slowly over the window is interpolated. The
    method is best for small pupils and wide windows. It computes the intensity but not the complex field.
- "angular_spectrum": two transforms, from the pupil to its spectrum and from there to the sensor's plane, on grids with
    the same period. It is best at short distances, and the only method for eyes with steep reliefs.
- "split_angular_spectrum": the same with a transfer function exp(ikz cos θ) that is split into two factors. The Fourier
    transform of the paraxial factor is known. Multiplication by the other factor shifts light only a short way to the
    side. Period and number of samples then do not grow with the distance.
- "rayleigh_sommerfeld": the direct sum over quadrature nodes that are fitted to the pupil's edge. Its time is
    proportional to the number of nodes times the number of output samples. It is the reference for all other methods.

Approximate methods are faster, and their error is predicted. "auto" uses one of them only if its error is within the
tolerance. If the user requests one by name, it runs regardless of its error, and the plan states the error:

- "fresnel": the paraxial integral.
- "fraunhofer": the paraxial far field.
- "geometric": the density of rays, without diffraction. It suits shadows and windows with coarse samples.
- "pinhole": all light in one sample of the window.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

from optics.methods.angular_spectrum import split_spectrum, whole_spectrum
from optics.methods.far_field import far_field
from optics.methods.fresnel import fraunhofer, fresnel
from optics.methods.geometric import geometric, pinhole
from optics.methods.hankel import hankel
from optics.methods.low_rank import low_rank
from optics.methods.method_sampling import Sampling
from optics.methods.pixelated_spectrum import split_pixel_spectrum, whole_pixel_spectrum
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import nodes
from optics.methods.smooth_spectrum import smooth_spectrum
from optics.methods.window_rank import DERIVATIVE_ERROR
from optics.methods.window_sampling import WindowSampling, window_sampling
from optics.numerics.accuracy import FLOAT_NOISE, MOST_BYTES, MOST_SECONDS, AccuracyError, Option, Plan, size_of
from optics.numerics.cost import CALL, DFT_CALL, PAIRS_PER_SECOND, PSF_CALL, WINDOW_SAMPLE
from optics.point_spread.window_cost import check_seconds, check_window, window_bytes, window_seconds

__all__ = ["APPROXIMATE", "EXACT", "FIELDS", "METHODS", "choose"]

# Each function returns the samplings with which its method meets a problem's tolerance. There may be none or several.
EXACT: dict[str, Callable[[Problem], Sequence[Sampling]]] = {
    "hankel": hankel,
    "low_rank": low_rank,
    "far_field": far_field,
    "angular_spectrum": whole_spectrum,
    "split_angular_spectrum": split_spectrum,
    "rayleigh_sommerfeld": nodes,
}
APPROXIMATE: dict[str, Callable[[Problem], Sequence[Sampling]]] = {
    "fresnel": fresnel,
    "fraunhofer": fraunhofer,
    "geometric": geometric,
    "pinhole": pinhole,
}
METHODS = EXACT | APPROXIMATE
FIELDS = tuple(name for name in EXACT if name != "far_field")  # methods that can return the complex field
# Reasons why a method may have no sampling.
UNSUITED = {
    "hankel": "requires a circle or ring with a rotationally symmetric relief and light along the axis",
    "low_rank": "the matrix between this pupil and this wide window exceeds the limit on entries",
    "far_field": "for interpolation in angle, the window is too wide or too near, or the tolerance too small",
}
# Methods with nodes within pixels. A grid cannot represent a field that jumps from pixel to pixel.
FOR_PIXELS: dict[str, Callable[[Problem], Sequence[Sampling]]] = {
    "low_rank": low_rank,
    "angular_spectrum": whole_pixel_spectrum,
    "split_angular_spectrum": split_pixel_spectrum,
    "rayleigh_sommerfeld": nodes,
}
# Methods that need only samples of the light that arrives in the window, however steep the pupil is.
FOR_STEEP: dict[str, Callable[[Problem], Sequence[Sampling]]] = {"angular_spectrum": smooth_spectrum}


@dataclass(frozen=True)
class Weighing:
    """Lower bound on the time that a method takes. It is known before the method plans its samples.

    least: shortest possible time of a PSF [s].
    per_sample: time per sample of the window [s].
    asking: assumed time [s] to plan the method's samples. Some methods usually turn out to be unsuitable once their
        samples are planned. For these methods, the assumed time exceeds the actual time, so that they are tried less
        often.
    """

    least: float
    per_sample: float = 0.0
    asking: float = 0.0

    def pays(self, best: float, outputs: int) -> bool:
        """Return whether the method may be faster than `best` [s], including the time to plan its samples."""
        return self.least + outputs * self.per_sample + self.asking < best


# Methods are compared in this order. For approximations, `asking` is three times the actual time (a choice), because
# most of them turn out to be too inaccurate.
WEIGHING = {
    "hankel": Weighing(CALL["hankel"]),
    "low_rank": Weighing(CALL["low_rank"]),
    "rayleigh_sommerfeld": Weighing(CALL["rayleigh_sommerfeld"], 1 / PAIRS_PER_SECOND["float32"], 1e-4),
    "fresnel": Weighing(CALL["fresnel"] + DFT_CALL, 0.0, 3e-3),
    "fraunhofer": Weighing(CALL["fresnel"] + DFT_CALL, 0.0, 3e-3),
    "geometric": Weighing(CALL["geometric"], 0.0, 3e-3),
    "pinhole": Weighing(CALL["pinhole"], 0.0, math.inf),
    "far_field": Weighing(CALL["far_field"] + 2 * DFT_CALL, WINDOW_SAMPLE, 6e-4),
    "angular_spectrum": Weighing(CALL["angular_spectrum"] + 2 * DFT_CALL, 0.0, 6e-4),
    "split_angular_spectrum": Weighing(CALL["angular_spectrum"] + 3 * DFT_CALL, 0.0, 6e-4),
}
OTHERS, OTHERS_IF_DIVIDED = 4e-3, 15e-3  # choices: time [s] of planning other methods after "low_rank", see `choose`


@lru_cache(maxsize=256)
def choose(problem: Problem, method: str = "auto", most_seconds: float = MOST_SECONDS) -> tuple[Plan, Sampling]:
    """Return the plan and the fastest sampling that meets the problem's tolerance. Plans are cached.

    method: "auto" compares all methods (only exact methods if the PSF carries derivatives). "exact" compares only exact
        methods, and "field" only the exact methods that compute a complex field. Methods that cannot be faster than
        the best one so far are skipped. A method's name selects that method alone. If the named method is an
        approximation, only the error due to its samples must be within the tolerance. The error of the approximation
        itself may be larger.

    Raises:
        ValueError: the method is unknown.
        AccuracyError: no sampling within the limits on memory and time meets the tolerance.
    """
    # Approximations predict the error of the intensity, and not that of its derivatives.
    everything = tuple(EXACT if problem.differentiated else METHODS)
    asked = {"auto": everything, "exact": tuple(EXACT), "field": FIELDS}.get(method, (method,))
    if asked[0] not in METHODS:
        raise ValueError(f"method = {method!r}: must be 'auto', 'exact' or one of {', '.join(METHODS)}")
    _check_dtype(problem)
    check_window(problem.window, problem.dtype)
    allowed, outputs = _model_tolerance(problem) if method == "auto" else math.inf, math.prod(problem.window.shape)
    known = FOR_STEEP if problem.steep else FOR_PIXELS if problem.divided else METHODS
    weighed: dict[str, Sampling] = {}
    best: Sampling | None = None
    coarse = window_sampling(problem) if {"low_rank"} <= {*asked} & {*known} else None
    others = 0.0 if coarse is None else OTHERS_IF_DIVIDED if problem.divided else OTHERS
    names = sorted({*asked} & {*known}, key=list(WEIGHING).index)
    names.sort(key=lambda name: name != "low_rank" or coarse is None)
    for name in names:
        if best is not None and not WEIGHING[name].pays(best.seconds - others, outputs):
            continue
        if name == "fraunhofer" and "fresnel" in weighed and weighed["fresnel"].model_error > allowed:
            continue  # Fraunhofer's integral is less accurate than Fresnel's
        samplings = [coarse] if coarse is not None and name == "low_rank" else known[name](problem)
        if not samplings:
            continue
        weighed[name] = option = min(samplings, key=lambda each: _cost(each, problem))
        if _within(option, problem, most_seconds) and (best is None or option.seconds < best.seconds):
            best = option if option.model_error <= allowed else best
    if best is None:
        candidates = [option for option in weighed.values() if option.model_error <= allowed]
        in_memory = [_seconds(each, problem) for each in candidates if _bytes(each, problem) <= MOST_BYTES]
        raise AccuracyError(_refusal(problem, candidates, most_seconds, method), seconds=min(in_memory, default=None))
    in_order = {name: weighed[name] for name in asked if name in weighed}
    return _plan(problem, best, in_order, most_seconds, len(asked) > 1), best


def _check_dtype(problem: Problem) -> None:
    floor = 10 * FLOAT_NOISE[problem.dtype]
    if problem.tolerance < floor:
        remedy = f"; dtype='float64' allows {10 * FLOAT_NOISE['float64']:g}" if problem.dtype == "float32" else ""
        raise AccuracyError(f"tolerance = {problem.tolerance:g}: {problem.dtype} allows at least {floor:g}{remedy}")


def _model_tolerance(problem: Problem) -> float:
    """Return the largest permitted error of an approximation: the tolerance minus errors of sampling and rounding."""
    return problem.tolerance - _sampling_error(problem)


def _sampling_error(problem: Problem) -> float:
    return problem.tolerance / 2 + FLOAT_NOISE[problem.dtype]


def _seconds(option: Sampling, problem: Problem) -> float:
    """Return the time [s] that a PSF takes in all: for planning, computation, copying and a check of some points."""
    return PSF_CALL + option.seconds + window_seconds(problem) + check_seconds(problem, option)


def _bytes(option: Sampling, problem: Problem) -> float:
    return option.bytes + window_bytes(problem, option)


def _cost(option: Sampling, problem: Problem) -> tuple[bool, float]:
    return _bytes(option, problem) > MOST_BYTES, option.seconds


def _within(option: Sampling, problem: Problem, most_seconds: float) -> bool:
    return _bytes(option, problem) <= MOST_BYTES and _seconds(option, problem) <= most_seconds


def _plan(problem: Problem, best: Sampling, weighed: dict[str, Sampling], most_seconds: float, auto: bool) -> Plan:
    options = [
        Option(
            name,
            option.samples,
            _sampling_error(problem) + option.model_error,
            _seconds(option, problem),
            _verdict(option, best, problem, most_seconds),
        )
        for name, option in weighed.items()
    ]
    why = (
        f"Fresnel number {problem.fresnel_number:.3g}, largest sine of the included light "
        f"{problem.band() * problem.wavelength:.2g}; "
        + ("cheapest method that meets the tolerance" if auto else "requested")
        + _why_for_derivatives(problem, best)
    )
    error = _sampling_error(problem) + best.model_error
    sampled = best.method, best.samples, problem.dtype, error, why, _seconds(best, problem)
    factor = DERIVATIVE_ERROR if isinstance(best, WindowSampling) else 1.0
    derivatives = factor * problem.tolerance if problem.differentiated and not best.model_error else None
    return Plan(*sampled, tuple(options), best.padding, problem.scalar_error, derivatives)


def _why_for_derivatives(problem: Problem, best: Sampling) -> str:
    """Return how derivatives affected the choice of the method, in words; empty if none are requested."""
    if not problem.differentiated:
        return ""
    if best.model_error:
        return "; an approximation predicts no error of derivatives"
    if problem.knots is None:
        return "; derivatives exclude approximations"
    needed = "more samples" if isinstance(best, WindowSampling) else "nodes in each cell between knots"
    return f"; derivatives with respect to samples of maps need {needed} ({problem.knots.maps})"


def _verdict(option: Sampling, best: Sampling, problem: Problem, most_seconds: float) -> str:
    if option is best:
        return "chosen"
    if _bytes(option, problem) > MOST_BYTES:
        return f"too large: {size_of(_bytes(option, problem))}, at most {size_of(MOST_BYTES)}"
    if _seconds(option, problem) > most_seconds:
        return f"too slow: at most {most_seconds:g} s"
    if option.model_error > _model_tolerance(problem):
        return f"approximation with an error of {option.model_error:.2g}"
    return f"{_seconds(option, problem) / _seconds(best, problem):.1f} times as slow"


def _count(sampling: Sampling) -> str:
    """Return the number of samples in words; for a Hankel transform, the numbers of radii and angles."""
    if sampling.method == "hankel":
        return f"integrals over {sampling.samples[0]:.2g} radii and {sampling.samples[1]:.2g} angles"
    if sampling.samples[1] == 1:
        return f"{sampling.samples[0]} nodes"
    return f"{max(sampling.samples)} samples across"


def _refusal(problem: Problem, found: list[Sampling], most_seconds: float, method: str) -> str:
    width = 2 * problem.window.half_width
    if not found and problem.knots is not None and method in {*METHODS} - {*FOR_PIXELS}:
        return (
            f"method = {method!r}: cannot compute derivatives with respect to samples of maps ({problem.knots.maps}); "
            f"use method='auto' or one of {', '.join(FOR_PIXELS)}"
        )
    if not found and problem.knots is not None:
        return (
            f"tolerance = {problem.tolerance:g}: derivatives with respect to samples of maps ({problem.knots.maps}) "
            f"need too many nodes: widen the tolerance, or shrink the window ({width:.3g} m) or the pupil (radius "
            f"{problem.radius:.3g} m)"
        )
    if not found and problem.pixelated is not None:
        return (
            "this method cannot sample a pixelated relief within its limits; use method='auto' or one of "
            f"{', '.join(FOR_PIXELS)}"
        )
    if not found and method in UNSUITED and not (method == "hankel" and problem.symmetric):
        return f"method = {method!r}: {UNSUITED[method]}; use method='auto' or 'exact'"
    if not found:
        return (
            f"tolerance = {problem.tolerance:g} over a window of {width:.3g} m at a distance of "
            f"{problem.distance:.3g} m reaches rays too close to grazing for a sampled spectrum: shrink the window or "
            "use method='rayleigh_sommerfeld'"
        )
    least = min(found, key=lambda option: option.seconds)
    maps = "" if problem.knots is None else f" for derivatives with respect to samples of maps ({problem.knots.maps})"
    return (
        f"tolerance = {problem.tolerance:g}{maps} needs {_count(least)}, {size_of(_bytes(least, problem))} and "
        f"about {_seconds(least, problem):.2g} s by {least.method}; the limits are {size_of(MOST_BYTES)} and "
        f"{most_seconds:g} s: widen the tolerance, shrink the window ({width:.3g} m) or the pupil (radius "
        f"{problem.radius:.3g} m, Fresnel number {problem.fresnel_number:.3g})"
    )
