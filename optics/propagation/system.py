"""Propagation of a field from plane to plane through pupils and free space, forwards or backwards."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.elements.source import PointSource
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, above
from optics.numerics.arguments import in_range, of_kind, shown, vacuum_wavelength
from optics.numerics.autodiff import Array, number
from optics.numerics.field import Field
from optics.numerics.precision import opaque, precision
from optics.propagation.plane_step import PlaneField, StepSettings, Stop
from optics.propagation.planes import PupilSampling
from optics.propagation.stack_result import StackResult, SystemStep
from optics.propagation.system_elements import Element, light_in_front, medium_index, stops_of

__all__ = ["propagate_through", "propagate_through_batch"]

# Choice: margins of frequencies around geometrical rays [cycles per radius], and the smallest tolerance for which they
# are tried. At smaller tolerances, all light that can reach the next plane is usually necessary.
MARGINS, LEAST_TOLERANCE = (4.0, 8.0, 16.0, 32.0), 5e-3
# Choice: smallest tolerance for which the first margin is tried. Below, it was never sufficient.
LEAST_FOR_FIRST = 0.03
# Choice: predicted error of a margin, divided by the change from half the margin, and an allowance for light that needs
# more than both margins, for example between opposite rims of two pupils. In 44 random systems, the actual error was at
# most 0.37 times the predicted one.
CHANGE_MARGIN, OUTSIDE_MARGINS = 2.0, 2e-3


def propagate_through(
    elements: Sequence[Element],
    u: np.ndarray | None = None,
    *,
    wavelength: float,
    dx: float | None = None,
    source: PointSource | None = None,
    out_dx: float | None = None,
    out_shape: tuple[int, int] | None = None,
    tolerance: float = 1e-3,
    dtype: str = "float32",
    backward: bool = False,
) -> StackResult:
    """Return the field behind a system of pupils and free space, including the carrier exp(ikz).

    elements: elements in the order in which light passes them in forward propagation. All lie in the same medium.
    u: complex field (y, x) in front of the first element, at the pitch dx [m]; the field is zero outside. If u is None,
        the first element must be a pupil, which `source` illuminates (by default, a plane wave of unit amplitude).
    wavelength: wavelength [m] in vacuum.
    out_dx, out_shape: pitch [m] and shape (y, x) of the output. By default, they equal those of u. They are required if
        u is None.
    tolerance: relative L2 error of the intensity over the window, in addition to the error of the samples u. For the
        smallest tolerance and for dtype, see `optics.propagate`.
    backward: True if u is the field behind the last element, which is propagated back to the plane in front of the
        first element. Propagation and phases are reversed. Light that apertures blocked or that decayed is not
        restored.

    Raises:
        ValueError: an argument is invalid (named with its value and valid range), u, the source or a misalignment
            carries derivatives, two pupils touch, a pupil of pixels lies in the plane of the output or its radius
            carries a derivative, or the medium is dispersive or differs between elements.
        AccuracyError: no sampling meets the tolerance, or a pupil is tilted too much to meet it.
        BackendError: see `optics.psf`.
    """
    light = _Light(u, wavelength, dx, source, out_dx, out_shape, tolerance, dtype, backward)
    return light.through(elements)[0]


def propagate_through_batch(
    systems: Sequence[Sequence[Element]],
    *,
    wavelength: float,
    out_dx: float,
    out_shape: tuple[int, int],
    source: PointSource | None = None,
    tolerance: float = 1e-3,
    dtype: str = "float32",
) -> list[StackResult]:
    """Return the fields behind similar systems, for example behind one lens with random errors of its elements.

    Each result meets the tolerance, as in `propagate_through`. At tolerances of 5e-3 and above, diffracted light is
    included only as far from the geometrical rays as the tolerance requires. The range of directions that was necessary
    for one system is tried first for the next one, which saves time.

    systems: lists of elements, each as in `propagate_through`. The first element of each is a pupil.

    Raises:
        ValueError: an argument is invalid, see `propagate_through`. The message states the index of the system.
        AccuracyError: no sampling meets the tolerance for one of the systems.
        BackendError: see `optics.psf`.
    """
    if isinstance(systems, str) or not isinstance(systems, Sequence):
        raise ValueError(f"systems = {shown(systems)}: must be a list of systems, each a list of elements")
    light = _Light(None, wavelength, None, source, out_dx, out_shape, tolerance, dtype, False)
    found, margin = [], MARGINS[0]
    for i, elements in enumerate(systems):
        try:
            result, margin = light.through(elements, margin)
        except ValueError as error:
            raise type(error)(f"systems[{i}]: {error}") from None
        found.append(result)
    return found


@dataclass(frozen=True)
class _Light:
    """Arguments of `propagate_through` except `elements`: the light that enters a system, and the requested output."""

    u: np.ndarray | None
    wavelength: float
    dx: float | None
    source: PointSource | None
    out_dx: float | None
    out_shape: tuple[int, int] | None
    tolerance: float
    dtype: str
    backward: bool

    def through(self, elements: Sequence[Element], margin: float = MARGINS[0]) -> tuple[StackResult, float]:
        """Return the field behind a system, and the margin of frequencies to try first for a similar system.

        The margin [cycles per pupil radius] is the amount by which frequencies of diffracted light may exceed those of
        geometrical rays. Light of higher frequencies is removed. If a margin is not sufficient for the tolerance, a
        larger one is tried.

        margin: smallest margin to try for this system.

        Raises:
            ValueError: see `propagate_through`.
            AccuracyError: see `propagate_through`.
        """
        if isinstance(elements, str) or not isinstance(elements, Sequence):
            raise ValueError(f"elements = {shown(elements)}: must be a list of Pupil, Misaligned and FreeSpace")
        source = self.source
        if source is not None:
            source = of_kind("source", source, PointSource, "PointSource(), a plane wave").require_plain()
        field, window, brightest = light_in_front(self.u, self.dx, self.out_dx, self.out_shape)
        if self.backward and field is None:
            raise ValueError("u = None: must be given, behind the last element, for backward propagation")
        stops = stops_of(elements, self.backward, window)
        if field is None and (stops[0].pupil is None or stops[0].distance != 0):
            raise ValueError(
                "u = None: must be given unless the first element is a Pupil, which a source can illuminate"
            )
        if field is not None and source is not None:
            raise ValueError("source: must not be given with u")
        settings = self._settings(elements, len(stops), margin)
        found = _converged(stops, field, source or PointSource(), settings, self.tolerance)
        power, u, tracked = brightest**2, found.field.u, found.field.tracked
        steps = (replace(one, power_in=one.power_in * power, power_out=one.power_out * power) for one in found.steps)
        carried = (None, None) if tracked is None else _with_carrier(tracked.scaled(brightest), stops, settings)
        scaled = u * u.dtype.type(brightest)
        return StackResult(scaled, window.dx, tuple(steps), found.error, window, *carried), found.first_margin

    def _settings(self, elements: Sequence[Element], stops: int, margin: float) -> StepSettings:
        noise = 10 * FLOAT_NOISE[precision(self.dtype).dtype]
        each = in_range("tolerance", self.tolerance, noise, 0.5) / (2 * stops)
        wavelength = vacuum_wavelength(self.wavelength)
        return StepSettings(wavelength, medium_index(elements), self.backward, max(each, noise), self.dtype, margin)


def _with_carrier(tracked: Field, stops: list[Stop], settings: StepSettings) -> tuple[tuple[Array, Array], Array]:
    """Return the field (real and imaginary part) and its intensity, with all derivatives, as tensors (y, x).

    tracked: the field. It lacks the derivative of its carrier exp(ikz) with respect to the distances, which this
        function adds.
    """
    types = tracked.types
    change = sum(opaque(types, stop.along) - number(stop.along) for stop in stops)
    waves = change * (settings.medium_n / settings.wavelength)
    carrier = Field.from_waves(1.0, waves, tracked.grid, types)
    return (tracked * carrier).tensors(), types.Tensor(tracked.intensity, tracked.grid.shape)


@dataclass(frozen=True)
class _Passed:
    """The field behind a system.

    error: predicted error of the intensity. `_passed` does not include the error due to diffracted light that was
        removed. `_converged` adds this error.
    complete: True if no light was removed that can reach the next plane.
    first_margin: smallest `StepSettings.margin` that is worth trying for a similar system.
    """

    field: PlaneField
    steps: tuple[SystemStep, ...]
    error: float
    complete: bool
    first_margin: float


def _converged(
    stops: list[Stop], field: PlaneField | None, source: PointSource, settings: StepSettings, tolerance: float
) -> _Passed:
    """Return the field with as much diffracted light as the tolerance requires.

    Most light follows geometrical rays. Diffracted light is included if its spatial frequency is above the frequencies
    of the rays by at most `StepSettings.margin`. The margin is doubled until the predicted error meets the tolerance.
    This error is estimated from the change of the intensity due to the last doubling. All light that can reach the next
    plane is included if no margin is sufficient, if the tolerance is below LEAST_TOLERANCE, or if derivatives are
    requested.
    """
    before, differentiated = None, any(stop.carries_derivatives(settings.wavelength) for stop in stops)
    for margin in MARGINS if tolerance >= LEAST_TOLERANCE and not differentiated else ():
        if margin < max(settings.margin, MARGINS[tolerance < LEAST_FOR_FIRST]):
            continue
        try:
            found = _passed(stops, field, source, replace(settings, margin=margin), tolerance)
        except AccuracyError:
            before = None
            continue
        if found.complete:
            return found
        if before is not None:
            error = found.error + OUTSIDE_MARGINS + CHANGE_MARGIN * _change(before.field.u, found.field.u)
            if error <= tolerance:
                return replace(found, error=error, first_margin=before.first_margin)
        before = found
    return _passed(stops, field, source, replace(settings, margin=math.inf), tolerance)


def _change(before: np.ndarray, after: np.ndarray) -> float:
    """Return the relative L2 difference of two intensities."""
    old, new = (np.square(u.real) + np.square(u.imag) for u in (before, after))
    size = float(np.linalg.norm(new))
    return float(np.linalg.norm(new - old)) / size if size else math.inf


def _passed(
    stops: list[Stop], field: PlaneField | None, source: PointSource, settings: StepSettings, tolerance: float
) -> _Passed:
    """Return the field behind the last stop."""
    steps: list[SystemStep] = []
    edges: list[float] = []
    complete, tilted, edge = True, 0.0, settings.edge_error
    for i, stop in enumerate(stops):
        if stop.window is None:
            at = source if field is None else PointSource()
            sampling = PupilSampling.for_stop(stop, stops[i + 1], settings, at, field)
            complete = complete and sampling.kept is None
        if field is not None:
            out, tracked = settings.carried(field, stop, sampling.grid if stop.window is None else stop.window)
            arrived = PlaneField(out.u, out.dx, field.band, field.rays, tracked=tracked)
            steps.append(SystemStep(stop.distance, out.plan, field.power, arrived.power, out.evanescent_power))
            edges.append(edge)
            field = arrived
        if stop.window is None:
            field, edge = sampling.transmitted(field, settings), sampling.error(settings)
            tilted += stop.alignment.error(settings.steep(field))
    assert field is not None
    return _Passed(field, tuple(steps), _error(steps, edges, tolerance, tilted), complete, settings.margin)


def _error(steps: list[SystemStep], edges: list[float], tolerance: float, tilted: float) -> float:
    """Return the error of a result: the sum of the errors due to the steps, to soft edges and to tilts of pupils.

    A soft edge is the smoothed edge of the aperture from which a step starts. Errors are relative to the light at their
    step. If only a fraction of this light arrives at the end, the relative error of the result is larger, so each error
    is divided by the square root of this fraction.

    edges: error of the soft edge at the start of each step.
    tilted: sum of the errors due to tilts of pupils.

    Raises:
        AccuracyError: the sum exceeds the tolerance.
    """
    last = steps[-1].power_out
    if last == 0:
        return 0.0
    error = sum(step.plan.predicted_error * math.sqrt(max(step.power_out / last, 1)) for step in steps)
    error += tilted + sum(
        edge * math.sqrt(max(step.power_in / last, 1)) for edge, step in zip(edges, steps, strict=True)
    )
    if not error <= tolerance:
        raise AccuracyError(
            f"tolerance = {tolerance:g}: the error reaches {above(error, tolerance)}, because too little of the light "
            "hits the last window, or a pupil is tilted too much; widen the tolerance or enlarge out_shape"
        )
    return error
