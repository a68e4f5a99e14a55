"""The point spread function of a pupil on a plane behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.arguments import in_range, positive
from optics.beam import Beam
from optics.grid import Grid
from optics.planner import FLOAT_NOISE, AccuracyError, Plan, choose
from optics.precision import precision
from optics.problem import Problem
from optics.pupil import Pupil
from optics.source import PointSource

__all__ = ["PSFResult", "psf"]


@dataclass(frozen=True, eq=False)
class PSFResult:
    """PSF on a grid of sensor positions, sample n//2 on the axis, row and y growing together.

    psf: (wavelength, y, x) [1/m²]; its integral over an unbounded plane is the fraction of the pupil's power that
        arrives (evanescent light does not). Never renormalised.
    plans: one per wavelength; `plan` is the least accurate of them.
    """

    psf: np.ndarray
    dx: float
    wavelengths: np.ndarray
    sensor_distance: float
    pupil: Pupil
    plans: tuple[Plan, ...]

    @property
    def plan(self) -> Plan:
        return max(self.plans, key=lambda plan: plan.predicted_error)

    @property
    def x(self) -> np.ndarray:
        return Grid(self.psf.shape[1:], self.dx).x

    @property
    def y(self) -> np.ndarray:
        return Grid(self.psf.shape[1:], self.dx).y

    @property
    def power(self) -> np.ndarray:
        """Fraction of the pupil's power inside the window, per wavelength."""
        return self.psf.sum(axis=(1, 2), dtype=np.float64) * self.dx**2


def psf(
    pupil: Pupil,
    wavelengths: Sequence[float] | np.ndarray = (550e-9,),
    sensor_distance: float = 240e-6,
    source_distance: float = math.inf,
    source_angle: tuple[float, float] = (0.0, 0.0),
    dx: float = 0.25e-6,
    shape: tuple[int, int] = (129, 129),
    tolerance: float = 1e-3,
    method: str = "auto",
    dtype: str = "float32",
) -> PSFResult:
    """|U|² / (pupil area) of the field U that a unit-amplitude wave makes behind the pupil.

    wavelengths: vacuum [m]. sensor_distance [m] behind the pupil. dx [m], shape (y, x): the window.
    source_distance [m], source_angle [rad]: see PointSource.
    tolerance: relative L2 error of the intensity over the window.
    method: "auto" or one of planner.METHODS.

    Raises:
        ValueError: bad argument, named with its value and valid range.
        AccuracyError: no method meets the tolerance within the limits on memory and time.
    """
    source = PointSource(source_distance, source_angle)
    window = Grid(shape, dx)
    lambdas = np.atleast_1d(np.asarray(wavelengths, dtype=np.float64))
    if lambdas.size == 0:
        raise ValueError("wavelengths is empty: must hold at least one wavelength [m]")
    images, plans = [], []
    for wavelength in lambdas:
        beam = Beam(pupil, source, float(positive("wavelength", wavelength)))
        image, plan = monochromatic(beam, problem(beam, sensor_distance, window, tolerance, dtype), method)
        images.append(image)
        plans.append(plan)
    return PSFResult(np.stack(images), dx, lambdas, sensor_distance, pupil, tuple(plans))


def problem(beam: Beam, distance: float, window: Grid, tolerance: float, dtype: str = "float32") -> Problem:
    """The numbers that decide the sampling."""
    pupil, wavelength = beam.pupil, beam.wavelength
    positive("sensor_distance", distance)
    in_range("tolerance", tolerance, 1e-12, 0.5)
    precision(dtype)
    steepest = pupil.slopes(wavelength, beam.source).steepest / wavelength
    band = 1.02 * steepest + pupil.bandwidth(wavelength, tolerance / 10)
    return Problem(pupil.aperture_radius, wavelength / pupil.medium_n, distance, window, band, tolerance, dtype)


def monochromatic(
    beam: Beam, task: Problem, method: str = "auto", most_seconds: float = 60.0
) -> tuple[np.ndarray, Plan]:
    """PSF over the window, and the plan with the error that the picture itself tells: rounding is as large in a dark
    window as in a bright one, so there it weighs more.

    Raises:
        AccuracyError: no method meets the tolerance, or the window is so dark that rounding breaks it.
    """
    plan, sampling = choose(task, method, most_seconds)
    image = (sampling.intensity(beam, task).numpy() / beam.pupil.area).reshape(task.window.shape)
    mean, mean_square = float(image.mean(dtype=np.float64)), float(np.mean(np.square(image, dtype=np.float64)))
    bright = 1 / sampling.plane(task) ** 2  # mean PSF over the plane that the transform spans
    noise = FLOAT_NOISE[task.dtype]
    rounding = 2 * noise * math.sqrt(bright * mean) + noise**2 * bright
    error = task.tolerance / 2 + rounding / math.sqrt(mean_square) if mean_square > 0 else math.inf
    if error > task.tolerance:
        raise AccuracyError(
            f"tolerance = {task.tolerance:g}: the window is so dark that {task.dtype} rounding reaches {error:.1g}"
            + ("; dtype='float64' has a 1e6 times lower floor" if task.dtype == "float32" else "")
        )
    return image, replace(plan, predicted_error=error)
