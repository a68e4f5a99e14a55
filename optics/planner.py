"""Which method, how many samples: the cheapest choice whose predicted error meets the tolerance.

All methods evaluate the same integral (the angular spectrum of the thin-element field, equal to the first
Rayleigh-Sommerfeld integral); they differ in where they sample it:

- "angular_spectrum": pupil -> spectrum -> sensor plane, both planes within one period. Best at short distance.
- "split_angular_spectrum": exp(ikz cos θ) is split into its paraxial part, whose Fourier transform is known, and the
  rest, whose spectrum is narrow. Period and samples no longer grow with the distance.
- "far_field": one Fourier transform onto direction cosines for each of a few nodes of the window, between which the
  slow rest of the kernel is interpolated. Best for small pupils and wide windows. Intensity only.
- "rayleigh_sommerfeld": the direct sum over edge-fitted nodes; needs no grid, costs nodes x outputs. The reference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from optics.angular_spectrum import GridSampling, split, whole
from optics.direct_sum import NodeSampling, nodes
from optics.far_field import FarFieldSampling, far_field
from optics.problem import Problem

__all__ = ["METHODS", "AccuracyError", "Plan", "Sampling", "choose"]

Sampling = GridSampling | NodeSampling | FarFieldSampling
# Each maps a problem to the samplings by which it meets the tolerance: none, one or several.
METHODS: dict[str, Callable[[Problem], Sequence[Sampling]]] = {
    "angular_spectrum": whole,
    "split_angular_spectrum": split,
    "far_field": far_field,
    "rayleigh_sommerfeld": nodes,
}
# Largest square array: 4096² complex64 is 134 MB, and a handful of such arrays live at once.
MOST_SAMPLES = 4096
FLOAT_NOISE = {"float32": 1e-6, "float64": 3e-13}  # relative to the field's root mean square, see tests


class AccuracyError(ValueError):
    """Asked for more than any method can give here; the message says what can be had."""


@dataclass(frozen=True)
class Plan:
    """What was chosen, and why.

    samples: (y, x) samples of the pupil (radial and angular nodes, for the direct sum).
    predicted_error: relative L2 error of the intensity over the window.
    seconds: predicted time on one core.
    """

    method: str
    samples: tuple[int, int]
    dtype: str
    predicted_error: float
    why: str
    seconds: float = 0.0

    def __str__(self) -> str:
        rows = {
            "method": self.method,
            "samples": f"{self.samples[0]} x {self.samples[1]}",
            "dtype": self.dtype,
            "predicted error": f"{self.predicted_error:.1e}",
            "predicted time": f"{self.seconds:.2g} s",
            "why": self.why,
        }
        return "\n".join(f"{name:<17}{value}" for name, value in rows.items())


def choose(problem: Problem, method: str = "auto", most_seconds: float = 60.0) -> tuple[Plan, Sampling]:
    """The cheapest sampling that meets the problem's tolerance, by the named method or by any.

    Raises:
        ValueError: unknown method.
        AccuracyError: nothing within the limits on memory and time meets the tolerance.
    """
    if method not in ("auto", *METHODS):
        raise ValueError(f"method = {method!r}: must be 'auto' or one of {', '.join(METHODS)}")
    _check_dtype(problem)
    asked = tuple(METHODS) if method == "auto" else (method,)
    cheapest = {name: min(found, key=_seconds) for name in asked if (found := METHODS[name](problem))}
    fitting = [option for option in cheapest.values() if _within(option, most_seconds)]
    if not fitting:
        raise AccuracyError(_refusal(problem, list(cheapest.values()), most_seconds))
    best = min(fitting, key=_seconds)
    return _plan(problem, best, [option for option in cheapest.values() if option is not best]), best


def _check_dtype(problem: Problem) -> None:
    floor = 10 * FLOAT_NOISE[problem.dtype]
    if problem.tolerance < floor:
        remedy = f"; dtype='float64' carries {10 * FLOAT_NOISE['float64']:g}" if problem.dtype == "float32" else ""
        raise AccuracyError(f"tolerance = {problem.tolerance:g}: {problem.dtype} carries {floor:g}{remedy}")


def _seconds(option: Sampling) -> float:
    return option.seconds


def _within(option: Sampling, most_seconds: float) -> bool:
    return option.largest <= MOST_SAMPLES and option.seconds <= most_seconds


def _plan(problem: Problem, best: Sampling, others: list[Sampling]) -> Plan:
    lost = ", ".join(f"{other.method} {other.seconds:.2g} s" for other in others)
    why = (
        f"Fresnel number {problem.fresnel_number:.3g}, sine of the steepest ray kept "
        f"{problem.band() * problem.wavelength:.2g}; cheapest at {best.seconds:.2g} s" + (f" ({lost})" if lost else "")
    )
    error = problem.tolerance / 2 + FLOAT_NOISE[problem.dtype]
    return Plan(best.method, best.samples, problem.dtype, error, why, best.seconds)


def _refusal(problem: Problem, found: list[Sampling], most_seconds: float) -> str:
    width = 2 * problem.window.half_width
    if not found:
        return (
            f"tolerance = {problem.tolerance:g} over a window of {width:.3g} m at a distance of "
            f"{problem.distance:.3g} m reaches rays too close to grazing for a sampled spectrum: shrink the window or "
            "ask for method='rayleigh_sommerfeld'"
        )
    least = min(found, key=_seconds)
    return (
        f"tolerance = {problem.tolerance:g} needs {least.largest} samples across and about {least.seconds:.2g} s by "
        f"{least.method}; the limits are {MOST_SAMPLES} and {most_seconds:g} s: widen the tolerance, shrink the window "
        f"({width:.3g} m) or flatten the relief"
    )
