"""The point spread function of a pupil on a plane behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.accuracy import Plan
from optics.numerics.arguments import vacuum_wavelength, vacuum_wavelengths
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread.pictures import pictures
from optics.point_spread.request import Request, Setup

__all__ = ["PSFResult", "plan", "psf", "spread"]


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

    wavelengths: in vacuum [m], one or a row of them.
    sensor_distance: [m] behind the pupil.
    source_distance, source_angle: [m], (x, y) [rad]: see PointSource.
    dx, shape, centre: of the window: pitch [m], samples (y, x), position of sample n//2 (x, y) [m].
    tolerance: relative L2 error of the intensity over the window.
    method: "auto", "exact" (nothing approximate), or one of planner.METHODS. An approximation asked for by its name
        answers however wrong it is: the tolerance is then that of its sampling, and the plan tells the error.
    Both distances, as what the pupil is made of, may be Dr.Jit arrays that carry derivatives: see PSFResult.tensor.

    Raises:
        ValueError: bad argument, named with its value and valid range.
        AccuracyError: no method meets the tolerance within the limits on memory and time.
    """
    source = PointSource(source_distance, source_angle)
    setup = Setup(sensor_distance, source, Grid(shape, dx, centre), tolerance, method, dtype)
    lambdas = np.atleast_1d(vacuum_wavelengths(wavelengths))
    if lambdas.size == 0:
        raise ValueError("wavelengths is empty: must hold at least one wavelength [m]")
    if lambdas.ndim > 1:
        raise ValueError(f"wavelengths has shape {lambdas.shape}: must be one wavelength [m], or a row of them")
    return spread([setup.request(pupil, float(wavelength)) for wavelength in lambdas])


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
    source = PointSource(source_distance, source_angle)
    setup = Setup(sensor_distance, source, Grid(shape, dx, centre), tolerance, method, dtype)
    return setup.request(pupil, vacuum_wavelength(wavelength)).planned()[0]


def spread(requests: Sequence[Request]) -> PSFResult:
    """PSFs of one pupil at several wavelengths, over one window.

    Raises:
        AccuracyError: no method meets the tolerance, or a window is so dark that rounding breaks it.
    """
    import drjit as dr

    flat, plans = zip(*pictures(requests), strict=True)
    beam, window, types = requests[0].beam, requests[0].problem.window, precision(requests[0].problem.dtype)
    tensor = types.Tensor(flat[0] if len(flat) == 1 else dr.concat(flat), (len(flat), *window.shape))
    wavelengths = np.array([request.beam.wavelength for request in requests])
    return PSFResult(tensor, window.dx, wavelengths, beam.distance, beam.pupil, tuple(plans), window.centre)
