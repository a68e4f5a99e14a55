"""Requests answered: planned, computed, held against the direct sum, and computed anew where that shows them wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from optics.methods.geometric import NoDerivativesError
from optics.methods.method_sampling import Sampling, WithField
from optics.methods.problem import Problem
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, Plan
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.precision import opaque, precision
from optics.point_spread.request import Request
from optics.point_spread.spot_check import spot_check

__all__ = ["PSFPicture", "pictures"]

TRIES = 3  # choice: pictures that are computed before a tolerance is given up
# Choice: after an error f times too large, ask for a tolerance f / 0.3 times smaller, so that one more try is enough.
NEXT_TOLERANCE = 0.3
LAST_TOLERANCE = 1e-2  # choice: of that, once nothing is tried after it


class PSFPicture(NamedTuple):
    """A PSF, flat; its plan; the field whose square it is, carrier included, where that was wanted; and by which
    samples of which problem it was made."""

    image: Array
    plan: Plan
    field: Field | None
    sampling: Sampling
    problem: Problem


@dataclass(frozen=True)
class _Attempt:
    """A picture, and what it was made by.

    request: what it answers; its tolerance may be smaller than what was first asked. image: the PSF, flat.
    """

    request: Request
    plan: Plan
    sampling: Sampling
    image: Array
    field: Field | None = None

    @classmethod
    def at(cls, request: Request, planned: tuple[Plan, Sampling]) -> _Attempt:
        """The picture as planned, or exact where what was picked has no derivatives. Dr.Jit has then recorded it, and
        computes it when it is first looked at."""
        import drjit as dr

        plan, sampling = planned
        problem, beam = request.problem, request.beam
        types = precision(problem.dtype)
        radius = opaque(types, beam.radius)
        area = types.Float(beam.pupil.aperture.area * radius * radius)
        if not request.keeps_field:
            try:
                return cls(request, plan, sampling, sampling.intensity(beam, problem) / area)
            except NoDerivativesError:
                if request.method != "auto":
                    raise
            request = replace(request, method="exact")
            return cls.at(request, request.planned())
        whole = cast(WithField, sampling).field(beam, problem)
        waves = opaque(types, beam.distance) * opaque(types, 1 / problem.wavelength)
        # dr.rsqrt errs by 1e-6 on a GPU, also in float64.
        field = whole * Field.from_waves(1 / dr.sqrt(area), waves, whole.grid, types)
        return cls(request, plan, sampling, field.intensity, field)

    @property
    def approximates(self) -> bool:
        """Whether the method errs however many samples it takes."""
        return self.sampling.model_error > 0

    def stated(self, error: float) -> PSFPicture:
        """The picture, and the plan with the error that is now known."""
        plan = replace(self.plan, predicted_error=error)
        return PSFPicture(self.image, plan, self.field, self.sampling, self.request.problem)

    def repeated(self, error: float, tolerance: float, last: bool) -> _Attempt | None:
        """What to try after the check saw an error above the tolerance: an exact method, or else a smaller tolerance,
        because a dark window needs more digits than a bright one. None where the dtype carries no more digits.

        last: nothing is tried after it, so that it may cost what it takes: rules of nodes come in steps, and a little
            smaller tolerance may get the same nodes
        """
        request, problem = self.request, self.request.problem
        if self.approximates:
            request = replace(request, method="exact")
        else:
            share = (LAST_TOLERANCE if last else 1.0) * NEXT_TOLERANCE
            smaller = max(share * problem.tolerance * tolerance / error, 10 * FLOAT_NOISE[problem.dtype])
            if smaller >= problem.tolerance:
                return None
            # Stated anew: fine detail of the relief counts for more, too.
            problem = Problem.of(request.beam, problem.window, smaller, problem.dtype)
            request = replace(request, problem=problem)
        return _Attempt.at(request, request.planned())


def pictures(requests: Sequence[Request], alike: bool = False) -> list[PSFPicture]:
    """PSFs, flat, and their plans. All are planned before any is computed, so that one that cannot be had is refused at
    once; and all are started before any is waited for.

    alike: whether what does for one request may do for the next, unasked.

    Raises:
        AccuracyError: no method meets a tolerance, or a window is so dark that rounding breaks it.
    """
    import drjit as dr

    planned: list[tuple[Request, tuple[Plan, Sampling]]] = []
    for request in requests:
        told = request.after(planned[-1][0], planned[-1][1][0]) if alike and planned else request
        planned.append((told, told.planned()))
    started = [_Attempt.at(*each) for each in planned]
    for attempt in started:
        dr.eval(
            attempt.image, attempt.field and (attempt.field.re, attempt.field.im)
        )  # one launch each: one kernel for all would be compiled anew for every number of them
    return [_checked(attempt, attempt.request, TRIES) for attempt in started]


def _checked(attempt: _Attempt, asked: Request, tries: int) -> PSFPicture:
    """The picture, or a better one, and its plan with the error that a spot check tells.

    asked: the request in its first form; an approximation that it names stays, however wrong it is seen to be.
    tries: attempts that are left, this one included.

    Raises:
        AccuracyError: the check finds more than the tolerance all the same.
    """
    problem, tolerance = attempt.request.problem, asked.problem.tolerance
    image = attempt.image.numpy()
    error = spot_check(attempt.request.beam, problem, image, attempt.plan.seconds)
    if error is None:
        return attempt.stated(_predicted_error(image, attempt.sampling, problem))
    named = attempt.approximates and asked.method == attempt.plan.method
    if error <= tolerance or named:
        return attempt.stated(error)
    found = (
        f"tolerance = {tolerance:g}: a check against the direct sum finds an error of {error:.1g} by "
        f"{attempt.plan.method} in {problem.dtype}"
    )
    try:
        better = attempt.repeated(error, tolerance, tries == 2) if tries > 1 else None
    except AccuracyError as refused:
        needs = str(refused).partition(": ")[0].partition(" needs ")[2]
        more = f", and to do better needs {needs}" if needs else ""
        raise AccuracyError(f"{found}{more}; widen the tolerance or shrink the window") from None
    if better is None:
        raise AccuracyError(f"{found}; widen the tolerance or ask for another method or dtype")
    return _checked(better, asked, tries - 1)


def _predicted_error(image: np.ndarray, sampling: Sampling, problem: Problem) -> float:
    """The error that the picture itself tells, where no check was made.

    Sampling takes half the tolerance. Rounding adds δU to the field U, as large in a dark window as in a bright one:
    its mean square is ε² times the mean intensity that the pupil's light has where the transform spreads it evenly,
    which is 1/W² in a PSF's units over a plane of width W. The intensity then errs by 2|U| |δU| + |δU|², so that

        rounding = (2 ε √(mean PSF / W²) + ε² / W²) / √(mean PSF²).

    A model that leaves the window dark misses all its light.

    Raises:
        AccuracyError: the window is so dark that rounding breaks the tolerance.
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
            f"{error:.1g}" + ("; dtype='float64' has a 1e6 times lower floor" if problem.dtype == "float32" else "")
        )
    return error + sampling.model_error
