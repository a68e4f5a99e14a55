"""The point spread function of a pupil on a plane behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.accuracy import Plan
from optics.numerics.arguments import flag, of_kind, vacuum_wavelength, wavelength_row
from optics.numerics.autodiff import Scalar
from optics.numerics.grid import Grid
from optics.point_spread.planner import FIELDS
from optics.point_spread.psf_result import PSFResult, spread
from optics.point_spread.request import Setup, sensor_place

__all__ = ["plan", "psf"]


def psf(
    pupil: Pupil,
    wavelengths: Sequence[float] | np.ndarray = (550e-9,),
    sensor_distance: Scalar | None = None,
    source_distance: Scalar = math.inf,
    source_angle: tuple[Scalar, Scalar] = (0.0, 0.0),
    dx: float = 0.25e-6,
    shape: tuple[int, int] = (129, 129),
    tolerance: float = 1e-3,
    method: str = "auto",
    dtype: str = "float32",
    centre: tuple[float, float] = (0.0, 0.0),
    field: bool = False,
) -> PSFResult:
    """Return the PSF |U|² / (pupil area) of a pupil. U is the field on the sensor for incident light of amplitude 1.

    wavelengths: one or several wavelengths [m] in vacuum. With eight or more, each wavelength uses the method of the
        preceding wavelength, to save the comparison of methods. Methods are compared again if that method is an
        approximation, does not meet the tolerance, or would take much longer than at the preceding wavelength.
    sensor_distance: distance [m] of the sensor behind the pupil. None: the distance at which the pupil's ideal lens
        images the source, or 240 µm without such a lens.
    source_distance, source_angle: distance [m] of the source, and direction (x, y) [rad] of its light, see PointSource.
    dx, shape, centre: pitch [m], number of samples (y, x) and position (x, y) [m] of sample n//2 of the window.
    tolerance: relative L2 error of the intensity over the window, 1e-12 to 0.5.
    method: "auto", "exact" (no approximations), or one of planner.METHODS. If an approximation is requested by name, it
        runs regardless of its error. The tolerance then applies only to the error due to finite samples, and
        `PSFResult.plan` states the whole error. The samples of "geometric", which "auto" may choose, and of "pinhole"
        are means over squares of side dx (`PSFResult.holds_cells`). The samples of all other methods are values at
        points.
    dtype: "float32" or "float64".
    field: True to return the complex amplitude U/√(pupil area) as well (`PSFResult.field`). This takes no additional
        time, but only methods that compute the amplitude are compared.

    Both distances, the angle and all parameters of the pupil may be Dr.Jit arrays that carry derivatives: see
    PSFResult.tensor. For tensors of PyTorch, use `optics.torch.psf`.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range.
        AccuracyError: no method meets the tolerance within the limits on memory and time, or the window is too large
            or too dark.
        BackendError: Dr.Jit has no usable LLVM library or GPU, or an array is on another device.
    """
    source = PointSource(source_distance, source_angle)
    at = sensor_place(of_kind("pupil", pupil, Pupil, "Pupil(25e-6)"), sensor_distance, source.distance)
    setup = Setup(at, source, Grid(shape, dx, centre), tolerance, method, dtype)
    lambdas = wavelength_row(wavelengths)
    if flag("field", field) and method not in ("auto", "exact", *FIELDS):
        raise ValueError(
            f"method = {method!r} has no phase: with field=True must be 'auto' or one of {', '.join(FIELDS)}"
        )
    requests = [setup.request(pupil, float(wavelength)) for wavelength in lambdas]
    return spread([replace(request, keeps_field=True) for request in requests] if field else requests)


def plan(
    pupil: Pupil,
    wavelength: float = 550e-9,
    sensor_distance: Scalar | None = None,
    source_distance: Scalar = math.inf,
    source_angle: tuple[Scalar, Scalar] = (0.0, 0.0),
    dx: float = 0.25e-6,
    shape: tuple[int, int] = (129, 129),
    tolerance: float = 1e-3,
    method: str = "auto",
    dtype: str = "float32",
    centre: tuple[float, float] = (0.0, 0.0),
) -> Plan:
    """Return the plan of `psf` at one wavelength without computing the PSF. Arguments and errors: see `psf`.

    `psf` also checks its result at some points against a more accurate sum. `PSFResult.plan` therefore states the error
    that the check found. It names another method if the method that was planned failed the check.
    """
    source = PointSource(source_distance, source_angle)
    at = sensor_place(of_kind("pupil", pupil, Pupil, "Pupil(25e-6)"), sensor_distance, source.distance)
    setup = Setup(at, source, Grid(shape, dx, centre), tolerance, method, dtype)
    return setup.request(pupil, vacuum_wavelength(wavelength)).planned()[0]
