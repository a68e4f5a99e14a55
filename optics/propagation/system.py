"""Propagation of a field from plane to plane through pupils and free space, forwards or backwards."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.refractive_index import Dispersion
from optics.elements.source import PointSource
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, above
from optics.numerics.arguments import complexes, in_range, of_kind, positive, shape_2d, shown, vacuum_wavelength
from optics.numerics.autodiff import Array, Scalar, number
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, precision
from optics.propagation.misalignment import Misaligned
from optics.propagation.plane_step import PlaneField, StepSettings, Stop
from optics.propagation.planes import PupilSampling
from optics.propagation.stack_result import StackResult, SystemStep

__all__ = ["FreeSpace", "propagate_through"]

# Choice: margins of frequencies around geometrical rays [cycles per radius], and the smallest tolerance for which they
# are tried. At smaller tolerances, all light that can reach the next plane is usually necessary.
MARGINS, LEAST_TOLERANCE = (4.0, 8.0, 16.0, 32.0), 5e-3
# Choice: predicted error of a margin, divided by the change from half the margin, and an allowance for light that needs
# more than both margins, for example between opposite rims of two pupils. It was at most 6e-4 in 80 random systems.
CHANGE_MARGIN, OUTSIDE_MARGINS = 4.0, 2e-3


@dataclass(frozen=True)
class FreeSpace:
    """Free space: a `distance` [m] in a medium with the refractive index medium_n.

    The distance may be a Dr.Jit array that carries a derivative.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    distance: Scalar
    medium_n: float = 1.0

    def __post_init__(self) -> None:
        positive("distance", self.distance, carried=True)
        in_range("medium_n", self.medium_n, 1.0, 10.0)


Element = Pupil | Misaligned | FreeSpace


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
    tolerance: relative L2 error of the intensity over the window, in addition to the error of the samples u. For its
        smallest value and dtype, see `optics.propagate`.
    backward: True if u is the field behind the last element, which is propagated back to the plane in front of the
        first element. Propagation and phases are reversed. Light that apertures blocked or that decayed is not
        restored.

    Raises:
        ValueError: an argument is invalid (named with its value and valid range), a parameter carries derivatives, two
            pupils touch, a relief has pixels, or the medium is dispersive or differs between elements.
        AccuracyError: no sampling meets the tolerance, or a tilt is too large for it.
        BackendError: see `optics.psf`.
    """
    if isinstance(elements, str) or not isinstance(elements, Sequence):
        raise ValueError(f"elements = {shown(elements)}: must be a list of Pupil, Misaligned and FreeSpace")
    if source is not None:
        source = of_kind("source", source, PointSource, "PointSource(), a plane wave").require_plain()
    field, window, brightest = _start(u, dx, out_dx, out_shape)
    if backward and field is None:
        raise ValueError("u = None: must be given, behind the last element, for backward propagation")
    stops = _stops(elements, backward, window)
    if field is None and (stops[0].pupil is None or stops[0].distance != 0):
        raise ValueError("u = None: must be given unless the first element is a Pupil, which a source can illuminate")
    if field is not None and source is not None:
        raise ValueError("source: must not be given with u")
    each = in_range("tolerance", tolerance, 10 * FLOAT_NOISE[precision(dtype).dtype], 0.5) / (2 * len(stops))
    settings = StepSettings(
        vacuum_wavelength(wavelength), _medium(elements), backward, max(each, 10 * FLOAT_NOISE[dtype]), dtype
    )
    found = _converged(stops, field, source or PointSource(), settings, tolerance)
    power, u, tracked = brightest**2, found.field.u, found.field.tracked
    steps = (replace(one, power_in=one.power_in * power, power_out=one.power_out * power) for one in found.steps)
    carried = () if tracked is None else _with_carrier(tracked.scaled(brightest), stops, settings)
    return StackResult(u * u.dtype.type(brightest), window.dx, tuple(steps), found.error, window, *carried)


def _with_carrier(tracked: Field, stops: list[Stop], settings: StepSettings) -> tuple[tuple[Array, Array], Array]:
    """Return the real and imaginary part, and the intensity, as tensors (y, x) with derivatives.

    tracked: the field, without the derivative of its carrier exp(ikz) with respect to the distances.
    """
    types = tracked.types
    change = sum(opaque(types, stop.along) - number(stop.along) for stop in stops)
    waves = change * (settings.medium_n / settings.wavelength)
    carrier = Field.from_waves(1.0, waves, tracked.grid, types)
    return (tracked * carrier).tensors(), types.Tensor(tracked.intensity, tracked.grid.shape)


@dataclass(frozen=True)
class _Passed:
    """The field behind a system.

    error: predicted error of the intensity, without that of removed light.
    complete: True if all light is included that can reach the next plane.
    """

    field: PlaneField
    steps: tuple[SystemStep, ...]
    error: float
    complete: bool


def _converged(
    stops: list[Stop], field: PlaneField | None, source: PointSource, settings: StepSettings, tolerance: float
) -> _Passed:
    """Return the field with as much diffracted light as the tolerance requires.

    Most light follows geometrical rays. The margin of frequencies around them is doubled until the intensity changes by
    less than the tolerance. If this does not happen, or if derivatives are requested, all light is included that can
    reach the next plane.
    """
    before, differentiated = None, any(stop.carries_derivatives(settings.wavelength) for stop in stops)
    for margin in MARGINS if tolerance >= LEAST_TOLERANCE and not differentiated else ():
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
                return replace(found, error=error)
        before = found
    return _passed(stops, field, source, settings, tolerance)


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
    complete, tilted = True, 0.0
    for i, stop in enumerate(stops):
        if stop.window is None:
            at = source if field is None else PointSource()
            sampling = PupilSampling.for_stop(stop, stops[i + 1], settings, at, field)
            complete = complete and sampling.kept is None
        if field is not None:
            out, tracked = settings.carried(field, stop, sampling.grid if stop.window is None else stop.window)
            arrived = PlaneField(out.u, out.dx, field.band, field.rays, tracked=tracked)
            steps.append(SystemStep(stop.distance, out.plan, field.power, arrived.power, out.evanescent_power))
            field = arrived
        if stop.window is None:
            field = sampling.transmitted(field, settings)
            tilted += stop.alignment.error(settings.steep(field))
    assert field is not None
    return _Passed(field, tuple(steps), _error(steps, tolerance, settings, tilted), complete)


def _start(
    u: np.ndarray | None, dx: float | None, out_dx: float | None, out_shape: tuple[int, int] | None
) -> tuple[PlaneField | None, Grid, float]:
    """Return the field in front of the first stop, the output window, and the modulus of the field's brightest sample.

    The field is None if a source illuminates the first pupil. Otherwise it is divided by this modulus, because float32
    cannot represent the power of every field.
    """
    if u is None:
        if out_dx is None or out_shape is None:
            raise ValueError("out_dx, out_shape: must be given if u is not")
        return None, Grid(shape_2d("out_shape", out_shape), positive("out_dx", out_dx)), 1.0
    samples = complexes("u", u)
    if samples.ndim != 2 or samples.size == 0 or not np.isfinite(samples).all():
        raise ValueError(f"u has shape {samples.shape}: must be (y, x), not empty, and finite everywhere")
    if dx is None:
        raise ValueError("dx: must be given with u")
    brightest = float(np.abs(samples).max()) or 1.0
    field = PlaneField(samples / brightest, positive("dx", dx), math.sqrt(0.5) / dx, math.sqrt(0.5) / dx)
    shape = (samples.shape[0], samples.shape[1]) if out_shape is None else shape_2d("out_shape", out_shape)
    window = Grid(shape, field.dx if out_dx is None else positive("out_dx", out_dx))
    return field, window, brightest


def _stops(elements: Sequence[Element], backward: bool, window: Grid) -> list[Stop]:
    """Return the stops: the pupils, each with the distance in front of it, and the output window as the last stop.

    Distances of adjacent elements of free space are added, which is exact.
    """
    if not elements:
        raise ValueError("elements is empty: must hold at least one Pupil or FreeSpace")
    stops: list[Stop] = []
    sign, touching = -1 if backward else 1, False
    distance: Scalar = 0.0
    for element in reversed(elements) if backward else elements:
        if isinstance(element, FreeSpace):
            distance, touching = distance + sign * element.distance, False
        elif not isinstance(element, (Pupil, Misaligned)):
            raise ValueError(f"elements holds {element!r}: must be Pupil, Misaligned or FreeSpace")
        elif touching:
            raise ValueError("elements: two pupils touch; put FreeSpace between them, or make them one Pupil")
        else:
            stops.append(Stop.at(element, distance))
            distance, touching = 0.0, True
    return [*stops, Stop(number(distance), None, window.half_width, window, along=distance)]


def _medium(elements: Sequence[Element]) -> float:
    found = set()
    for element in (one.pupil if isinstance(one, Misaligned) else one for one in elements):
        index = element.medium_n
        if isinstance(index, Dispersion) or (isinstance(element, Pupil) and element.object_n is not None):
            raise ValueError(
                "elements: only psf supports dispersive media, and media that differ before and behind a pupil"
            )
        found.add(float(index))
    media = sorted(found)
    if len(media) > 1:
        raise ValueError(f"medium_n = {', '.join(f'{n:g}' for n in media)}: must be the same throughout the elements")
    return media[0]


def _error(steps: list[SystemStep], tolerance: float, settings: StepSettings, tilted: float) -> float:
    """Return the sum of the errors of the steps and of the soft edges between them.

    Errors are relative to the light at their step. If only a fraction of this light arrives at the end, the relative
    error of the result is larger, so each error is divided by the square root of this fraction.

    tilted: sum of the errors due to tilts.

    Raises:
        AccuracyError: the sum exceeds the tolerance.
    """
    last = steps[-1].power_out
    if last == 0:
        return 0.0
    error = sum(step.plan.predicted_error * math.sqrt(max(step.power_out / last, 1)) for step in steps)
    edges = 8 * settings.edge_ripple + 4 * FLOAT_NOISE[settings.dtype]
    error += tilted + sum(edges * math.sqrt(max(step.power_in / last, 1)) for step in steps)
    if not error <= tolerance:
        raise AccuracyError(
            f"tolerance = {tolerance:g}: the error reaches {above(error, tolerance)}, because too little of the light "
            "hits the last window, or a pupil is tilted too much; widen the tolerance or enlarge out_shape"
        )
    return error
