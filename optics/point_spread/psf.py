"""The point spread function of a pupil on a plane behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.problem import Problem
from optics.methods.sampling import Sampling
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, Plan
from optics.numerics.arguments import vacuum_wavelength, vacuum_wavelengths
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, precision
from optics.point_spread.planner import choose
from optics.point_spread.spot_check import spot_check

__all__ = ["PSFResult", "pictures", "plan", "psf", "spread"]

TRIES = 3


@dataclass(frozen=True, eq=False)
class PSFResult:
    """PSF on a grid of sensor positions, sample n//2 at `centre` (x, y) [m], row and y growing together.

    tensor: the PSF as a Dr.Jit tensor (wavelength, y, x) that carries the derivatives of what it was made from.
    psf: the same as a NumPy array [1/m²]; its integral over an unbounded plane is the fraction of the pupil's power
        that arrives (evanescent light does not). Never renormalised.
    plans: one per wavelength; `plan` is the least accurate of them.
    """

    tensor: Array
    dx: float
    wavelengths: np.ndarray
    sensor_distance: Scalar
    pupil: Pupil
    plans: tuple[Plan, ...]
    centre: tuple[float, float] = (0.0, 0.0)

    @cached_property
    def psf(self) -> np.ndarray:
        return self.tensor if isinstance(self.tensor, np.ndarray) else np.asarray(self.tensor.numpy())

    @property
    def plan(self) -> Plan:
        return max(self.plans, key=lambda plan: plan.predicted_error)

    @property
    def x(self) -> np.ndarray:
        return Grid(self.tensor.shape[1:], self.dx, self.centre).x

    @property
    def y(self) -> np.ndarray:
        return Grid(self.tensor.shape[1:], self.dx, self.centre).y

    @property
    def power(self) -> np.ndarray:
        """Fraction of the pupil's power inside the window, per wavelength."""
        return self.psf.sum(axis=(1, 2), dtype=np.float64) * self.dx**2


def psf(
    pupil: Pupil,
    wavelengths: Sequence[float] | np.ndarray = (550e-9,),
    sensor_distance: Scalar = 240e-6,
    source_distance: Scalar = math.inf,
    source_angle: tuple[float, float] = (0.0, 0.0),
    dx: float = 0.25e-6,
    shape: tuple[int, int] = (129, 129),
    tolerance: float = 1e-3,
    method: str = "auto",
    dtype: str = "float32",
    centre: tuple[float, float] = (0.0, 0.0),
) -> PSFResult:
    """|U|² / (pupil area) of the field U that a unit-amplitude wave makes behind the pupil.

    wavelengths: vacuum [m]. sensor_distance [m] behind the pupil. dx [m], shape (y, x), centre (x, y) [m]: the window.
    source_distance [m], source_angle [rad]: see PointSource.
    tolerance: relative L2 error of the intensity over the window.
    method: "auto", "exact" (nothing approximate), or one of planner.METHODS. An approximation asked for by its name
        answers however wrong it is: the tolerance is then that of its sampling, and the plan tells the error.
    Both distances, as what the pupil is made of, may be Dr.Jit arrays that carry derivatives: see PSFResult.tensor.

    Raises:
        ValueError: bad argument, named with its value and valid range.
        AccuracyError: no method meets the tolerance within the limits on memory and time.
    """
    window = Grid(shape, dx, centre)
    source = PointSource(source_distance, source_angle)
    lambdas = np.atleast_1d(vacuum_wavelengths(wavelengths))
    if lambdas.size == 0:
        raise ValueError("wavelengths is empty: must hold at least one wavelength [m]")
    if lambdas.ndim > 1:
        raise ValueError(f"wavelengths has shape {lambdas.shape}: must be one wavelength [m], or a row of them")
    beams = [Beam(pupil, source, float(at), sensor_distance) for at in lambdas]
    tasks = [Problem.of(beam, window, tolerance, dtype) for beam in beams]
    return spread(beams, tasks, method)


def plan(
    pupil: Pupil,
    wavelength: float = 550e-9,
    sensor_distance: Scalar = 240e-6,
    source_distance: Scalar = math.inf,
    source_angle: tuple[float, float] = (0.0, 0.0),
    dx: float = 0.25e-6,
    shape: tuple[int, int] = (129, 129),
    tolerance: float = 1e-3,
    method: str = "auto",
    dtype: str = "float32",
    centre: tuple[float, float] = (0.0, 0.0),
) -> Plan:
    """What `psf` would do at one wavelength, without doing it: see there for arguments and errors."""
    beam = Beam(pupil, PointSource(source_distance, source_angle), vacuum_wavelength(wavelength), sensor_distance)
    return choose(Problem.of(beam, Grid(shape, dx, centre), tolerance, dtype), method)[0]


def spread(beams: list[Beam], tasks: list[Problem], method: str = "auto", most_seconds: float = 60.0) -> PSFResult:
    """PSFs of several wavelengths over one window.

    Raises:
        AccuracyError: no method meets the tolerance, or a window is so dark that rounding breaks it.
    """
    import drjit as dr

    flat, plans = zip(*pictures(beams, tasks, method, most_seconds), strict=True)
    window, types = tasks[0].window, precision(tasks[0].dtype)
    tensor = types.Tensor(flat[0] if len(flat) == 1 else dr.concat(flat), (len(flat), *window.shape))
    wavelengths = np.array([beam.wavelength for beam in beams])
    return PSFResult(tensor, window.dx, wavelengths, beams[0].distance, beams[0].pupil, tuple(plans), window.centre)


def pictures(
    beams: Sequence[Beam], tasks: Sequence[Problem], method: str = "auto", most_seconds: float = 60.0
) -> list[tuple[Array, Plan]]:
    """PSFs, flat, and their plans: all are refused before anything is computed, and all started before any is waited
    for.

    Raises:
        AccuracyError: see `spread`.
    """
    import drjit as dr

    chosen = [choose(task, method, most_seconds) for task in tasks]
    started = [_picture(beam, task, sampling) for beam, task, (_, sampling) in zip(beams, tasks, chosen, strict=True)]
    for image in started:
        dr.eval(image)  # one launch each: together they would be one kernel, compiled anew for every number of them
    asked = method, most_seconds
    return [_checked(*each, asked) for each in zip(beams, tasks, chosen, started, strict=True)]


def _picture(beam: Beam, task: Problem, sampling: Sampling) -> Array:
    types = precision(task.dtype)
    radius = opaque(types, beam.radius)
    return sampling.intensity(beam, task) / types.Float(beam.pupil.aperture.area * radius * radius)


def _checked(
    beam: Beam, task: Problem, chosen: tuple[Plan, Sampling], image: Array, asked: tuple[str, float]
) -> tuple[Array, Plan]:
    """The PSF, flat, and the plan with the error that a spot check tells. What does not meet the tolerance is planned
    again: by an exact method, and for a smaller tolerance, because a dark window needs more digits than a bright one.
    An approximation asked for by its name stays, however wrong it is seen to be.

    Raises:
        AccuracyError: the check finds more than the tolerance all the same.
    """
    sampled = task
    for _ in range(TRIES):
        plan, sampling = chosen
        picture = image.numpy()
        seen = spot_check(beam, sampled, picture, plan.seconds)
        if seen is None:
            return image, replace(plan, predicted_error=_predicted_error(picture, sampling, sampled))
        if seen <= task.tolerance or (sampling.model_error and asked[0] == plan.method):
            return image, replace(plan, predicted_error=seen)
        if sampling.model_error:
            asked = ("exact", asked[1])
        else:
            least = max(0.3 * sampled.tolerance * task.tolerance / seen, 10 * FLOAT_NOISE[task.dtype])
            if least >= sampled.tolerance:
                break
            sampled = Problem.of(beam, task.window, least, task.dtype)  # fine detail counts for more, too
        chosen = choose(sampled, *asked)
        image = _picture(beam, sampled, chosen[1])
    raise AccuracyError(
        f"tolerance = {task.tolerance:g}: a check against the direct sum finds an error of {seen:.1g} by "
        f"{plan.method} in {task.dtype}; widen the tolerance or ask for another method or dtype"
    )


def _predicted_error(image: np.ndarray, sampling: Sampling, task: Problem) -> float:
    """The error that the picture itself tells: rounding is as large in a dark window as in a bright one, so there it
    weighs more. A model that leaves the window dark misses all its light.

    Raises:
        AccuracyError: the window is so dark that rounding breaks the tolerance.
    """
    mean, mean_square = float(image.mean(dtype=np.float64)), float(np.mean(np.square(image, dtype=np.float64)))
    if mean_square == 0 and sampling.model_error:
        return max(sampling.model_error, 1.0)
    bright = 1 / sampling.plane(task) ** 2  # mean PSF over the plane that the transform spans
    noise = FLOAT_NOISE[task.dtype]
    rounding = 2 * noise * math.sqrt(bright * mean) + noise**2 * bright
    error = task.tolerance / 2 + rounding / math.sqrt(mean_square) if mean_square > 0 else math.inf
    if error > task.tolerance:
        raise AccuracyError(
            f"tolerance = {task.tolerance:g}: the window is so dark that {task.dtype} rounding reaches {error:.1g}"
            + ("; dtype='float64' has a 1e6 times lower floor" if task.dtype == "float32" else "")
        )
    return error + sampling.model_error
