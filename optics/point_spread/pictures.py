"""Computation of requested PSFs.

Each PSF is planned, computed and, unless this would take too long, compared at a few points with the direct sum, the
most accurate method. If the comparison fails, the PSF is computed again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from optics.elements.beam import Beam
from optics.methods.geometric import NoDerivativesError
from optics.methods.method_sampling import Sampling, WithField
from optics.methods.problem import Problem
from optics.methods.window_plan import TIGHTEST
from optics.methods.window_sampling import WindowSampling
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, Plan, above
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.precision import opaque, padded_for_packets, precision
from optics.point_spread.request import Request
from optics.point_spread.spot_check import spot_check
from optics.point_spread.window_cost import check_window

__all__ = ["PSFPicture", "pictures"]

TRIES = 3  # choice: number of attempts to meet a tolerance
# Choice: if an error is f times too large, the next tolerance is f / 0.3 times smaller. The next attempt is then
# usually sufficient.
NEXT_TOLERANCE = 0.3
LAST_TOLERANCE = 1e-2  # choice: additional factor on the tolerance of the last attempt


class PSFPicture(NamedTuple):
    """A computed PSF, as a flat array, and its plan.

    field: complex amplitude, including the carrier wave exp(ikz), if it was requested; else None.
    sampling, problem: samples and problem from which the PSF was computed.
    """

    image: Array
    plan: Plan
    field: Field | None
    sampling: Sampling
    problem: Problem


@dataclass(frozen=True)
class _Attempt:
    """A PSF, and the parameters from which it was computed.

    request: the request, whose tolerance may be smaller than that of the user's request.
    image: the PSF as a flat array, of Dr.Jit or, without derivatives, of NumPy.
    """

    request: Request
    plan: Plan
    sampling: Sampling
    image: Array
    field: Field | None = None

    @classmethod
    def at(cls, request: Request, planned: tuple[Plan, Sampling]) -> _Attempt:
        """Return the PSF, computed by the planned method.

        If "auto" chose a method that cannot provide the required derivatives on the selected device, an exact method is
        used instead.

        If Dr.Jit computes the PSF, it only records the computation here, and executes it when the PSF is first read.

        Raises:
            NoDerivativesError: the user requested a method that has no derivatives on the selected device.
        """
        import drjit as dr

        plan, sampling = planned
        problem, beam = request.problem, request.beam
        if not request.keeps_field:
            try:
                if isinstance(sampling, WindowSampling) and not problem.differentiated:
                    return cls(request, plan, sampling, sampling.plain_intensity(beam, problem) / beam.pupil.area)
                return cls(request, plan, sampling, sampling.intensity(beam, problem) / _area(beam, problem))
            except NoDerivativesError:
                if request.method != "auto":
                    raise
            request = replace(request, method="exact")
            return cls.at(request, request.planned())
        whole = cast(WithField, sampling).field(beam, problem)
        types, area = precision(problem.dtype), _area(beam, problem)
        waves = opaque(types, beam.distance) * opaque(types, 1 / problem.wavelength)
        # dr.rsqrt has an error of 1e-6 on a GPU, also in float64.
        field = whole * Field.from_waves(1 / dr.sqrt(area), waves, whole.grid, types)
        return cls(request, plan, sampling, field.intensity, field)

    @property
    def approximates(self) -> bool:
        """True if the method has an error even with infinitely many samples."""
        return self.sampling.model_error > 0

    def stated(self, error: float) -> PSFPicture:
        """Return the PSF together with its plan, whose predicted error is replaced by `error`."""
        plan, types = replace(self.plan, predicted_error=error), precision(self.request.problem.dtype)
        plain = isinstance(self.image, np.ndarray)
        image = types.Float(padded_for_packets(self.image)) if plain else self.image
        return PSFPicture(image, plan, self.field, self.sampling, self.request.problem)

    @property
    def for_window(self) -> bool:
        """True if the samples of the pupil are too coarse for light that arrives outside the PSF's window."""
        return isinstance(self.sampling, WindowSampling)

    def repeated(self, error: float, tolerance: float, last: bool) -> _Attempt | None:
        """Return the next attempt, after a check at some points has found an error above the tolerance.

        If the method was an approximation, the next attempt uses an exact method. If the method was exact, the next
        attempt has a smaller tolerance. In a window with little light, an error of the field is larger relative to the
        field, so a smaller error of the field is needed. The result is None if the dtype is not precise enough for this
        tolerance.

        Some methods use samples of the pupil that resolve only the light which arrives in the window. Such samples do
        not support very small tolerances. If such a tolerance would be necessary, the next attempt resolves all light
        instead, at the original tolerance.

        error: the error that was found.
        tolerance: tolerance of the user's request.
        last: True if the next attempt is the last. Its tolerance is then much smaller than in other attempts, because
            quadrature rules change in steps and a slightly smaller tolerance may give the same nodes.
        """
        request, problem = self.request, self.request.problem
        if self.approximates:
            request = replace(request, method="exact")
        else:
            factor = (LAST_TOLERANCE if last else 1.0) * NEXT_TOLERANCE
            smaller = max(factor * problem.tolerance * tolerance / error, 10 * FLOAT_NOISE[problem.dtype])
            if smaller >= problem.tolerance:
                return None
            whole = problem.all_light or (self.for_window and smaller < TIGHTEST)
            wanted = tolerance if whole and self.for_window else smaller
            # The problem is derived again, because a smaller tolerance includes finer detail of the relief.
            problem = Problem.from_beam(request.beam, problem.window, wanted, problem.dtype)
            problem = replace(problem, all_light=whole, steep=request.problem.steep)
            request = replace(request, problem=problem)
        return _Attempt.at(request, request.planned())


def _area(beam: Beam, problem: Problem) -> Array:
    """Return the area of the open pupil [m²], with derivatives with respect to its radius."""
    types = precision(problem.dtype)
    radius = opaque(types, beam.radius)
    return types.Float(beam.pupil.aperture.area * radius * radius)


def pictures(requests: Sequence[Request], alike: bool = False) -> list[PSFPicture]:
    """Return PSFs as flat arrays, each with its plan, which states the method and the predicted error.

    All PSFs are planned before the first is computed, so an impossible request raises its error at once. All
    computations are started before the first result is awaited.

    alike: True if each request may reuse the method of the preceding request.

    Raises:
        AccuracyError: no method meets a tolerance, the error still exceeds the tolerance in the last of several
            attempts, or a window is so dark that rounding errors exceed the tolerance.
    """
    import drjit as dr

    if requests:
        problem = requests[0].problem
        check_window(problem.window, problem.dtype, len(requests))
    planned: list[tuple[Request, tuple[Plan, Sampling]]] = []
    for request in requests:
        own = request.after(planned[-1][0], planned[-1][1][0]) if alike and planned else request
        planned.append((own, own.planned()))
    started = [_Attempt.at(*each) for each in planned]
    for attempt in started:
        if not isinstance(attempt.image, np.ndarray):
            # Each PSF has its own kernel launch, since a joint kernel would be compiled again for every number of PSFs.
            dr.eval(attempt.image, attempt.field and (attempt.field.re, attempt.field.im))
    return [_checked(attempt, attempt.request, TRIES) for attempt in started]


def _checked(attempt: _Attempt, asked: Request, tries: int) -> PSFPicture:
    """Return the PSF and its plan, after the PSF's error has been determined.

    The PSF is compared at some points with a more accurate sum over the pupil. If the error exceeds the tolerance, the
    PSF is computed again, more accurately. The plan contains the error of the returned PSF. If the comparison is
    impossible or would take too long, the plan contains a predicted error instead.

    asked: the user's request. If it names an approximate method, the result is accepted regardless of its error.
    tries: number of remaining attempts, including this one.

    Raises:
        AccuracyError: the error of the last attempt also exceeds the tolerance, or the next attempt is impossible. See
            also `_predicted_error`.
    """
    problem, tolerance = attempt.request.problem, asked.problem.tolerance
    image = attempt.image if isinstance(attempt.image, np.ndarray) else attempt.image.numpy()
    if isinstance(attempt.sampling, WindowSampling):
        error = attempt.sampling.error(attempt.request.beam, problem, image)
    else:
        error = spot_check(attempt.request.beam, problem, image, attempt.sampling.seconds)
    if error is None:
        return attempt.stated(_predicted_error(image, attempt.sampling, problem))
    named = attempt.approximates and asked.method == attempt.plan.method
    if error <= tolerance or named:
        return attempt.stated(error)
    found = (
        f"tolerance = {tolerance:g}: a check against the direct sum finds an error of {above(error, tolerance)} by "
        f"{attempt.plan.method} in {problem.dtype}"
    )
    left = tries - (not attempt.for_window)  # attempts with samples of the window's light are quick
    try:
        better = attempt.repeated(error, tolerance, left == 1) if left > 0 else None
    except AccuracyError as refused:
        needs = str(refused).partition(": ")[0].partition(" needs ")[2]
        more = f", and a smaller error needs {needs}" if needs else ""
        raise AccuracyError(f"{found}{more}; widen the tolerance or shrink the window") from None
    if better is None:
        raise AccuracyError(f"{found}; widen the tolerance or use another method or dtype")
    return _checked(better, asked, left)


def _predicted_error(image: np.ndarray, sampling: Sampling, problem: Problem) -> float:
    """Return the error of a PSF, estimated from the PSF's brightness and not by comparison with another method.

    Sampling causes an error of up to half the tolerance. Rounding adds an error δU to the field U, which is as large in
    a dark window as in a bright one. Assume that the method spreads this error evenly over a square of width W
    (`Sampling.plane`). If all light of the pupil were spread evenly over this square, the PSF would be 1/W². In units
    in which |U|² is the PSF, the mean square of δU is therefore ε²/W², with ε the relative rounding error. The error of
    the intensity is 2|U| |δU| + |δU|². Relative to the PSF, it is

        rounding = (2 ε √(mean PSF / W²) + ε² / W²) / √(mean PSF²).

    The error of an approximate method is added. If an approximation predicts no light in the window, its error counts
    as at least 1, because it may miss all light there.

    Raises:
        AccuracyError: the window is so dark that rounding errors exceed the tolerance.
    """
    mean, mean_square = float(image.mean(dtype=np.float64)), float(np.mean(np.square(image, dtype=np.float64)))
    if mean_square == 0 and sampling.model_error:
        return max(sampling.model_error, 1.0)
    even = 1 / sampling.plane(problem) ** 2
    noise = FLOAT_NOISE[problem.dtype]
    rounding = 2 * noise * math.sqrt(even * mean) + noise**2 * even
    error = problem.tolerance / 2 + rounding / math.sqrt(mean_square) if mean_square > 0 else math.inf
    if error > problem.tolerance:
        raise AccuracyError(
            f"tolerance = {problem.tolerance:g}: the window is so dark that {problem.dtype} rounding reaches "
            f"{above(error, problem.tolerance)}"
            + ("; dtype='float64' rounds 1e6 times more finely" if problem.dtype == "float32" else "")
        )
    return error + sampling.model_error
