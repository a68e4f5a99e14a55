"""The parameters of a PSF."""

from __future__ import annotations

from dataclasses import dataclass, replace

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.ray_field import RayField
from optics.elements.source import PointSource
from optics.methods.method_sampling import Sampling
from optics.methods.problem import Problem
from optics.numerics.accuracy import MOST_SECONDS, AccuracyError, Plan
from optics.numerics.arguments import one_of
from optics.numerics.autodiff import Scalar, carries_derivative, number
from optics.numerics.cost import PSF_CALL
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread.planner import EXACT, METHODS, choose
from optics.point_spread.window_cost import check_window, window_seconds

__all__ = ["Request", "Setup", "sensor_place"]

MOST_SECONDS_OF_JUMPS = 2.0  # choice: time limit for a height map with jumps [s]
GROWN = 1.25  # choice: factor in time, relative to the previous wavelength, above which methods are compared again


@dataclass(frozen=True)
class Request:
    """A request for one monochromatic PSF.

    beam: the light, with the pupil and the distance of the sensor.
    problem: numbers that describe the light, the window and the tolerance.
    method: "auto", "exact" or a method's name.
    most_seconds: time limit of the PSF [s].
    keeps_field: True to return the complex amplitude as well.
    like: a plan whose method is tried before all methods are compared.
    """

    beam: Beam
    problem: Problem
    method: str = "auto"
    most_seconds: float = MOST_SECONDS
    keeps_field: bool = False
    like: Plan | None = None

    def after(self, other: Request, plan: Plan) -> Request:
        """Return this request, changed so that the method of `plan`, the plan of the `other` request, is tried first.

        This request is returned unchanged in three cases. The requests differ in pupil, source, distance of the sensor
        or `keeps_field`. The `method` of one of them is not "auto". The method of `plan` is approximate.

        A method that is suitable for one wavelength is usually suitable for the next. Trying it first saves the
        comparison of methods, which takes as long as a small PSF.
        """
        mine, its = self.beam, other.beam
        same = mine.pupil is its.pupil and mine.source == its.source and mine.distance is its.distance
        alike = self.method == other.method == "auto" and self.keeps_field == other.keeps_field
        return replace(self, like=plan) if same and alike and plan.method in EXACT else self

    def planned(self) -> tuple[Plan, Sampling]:
        """Return the plan, and the samples of the pupil with which the PSF is computed.

        Raises:
            AccuracyError: no method meets the tolerance within the limits on memory and time. The time limit is shorter
                than usual if the pupil's height map has jumps between neighbouring samples.
        """
        pupil = self.beam.pupil
        jump = 0.0 if pupil.height is None else pupil.height.jump
        try:
            plan, sampling = self._as_before() or choose(self.problem, self._methods, self.most_seconds)
        except AccuracyError as error:
            bent = " and ".join(name for name in ("height", "wavefront") if getattr(pupil, name) is not None)
            advice = _wrapped(pupil) if jump else f"a flatter {bent} needs less" if bent else ""
            advice = "" if "use method=" in str(error) else advice  # another method helps, and not another relief
            seconds = None if jump and (error.seconds or 0) > MOST_SECONDS_OF_JUMPS else error.seconds
            raise AccuracyError(f"{error}; {advice}" if advice else str(error), seconds=seconds) from None
        if jump and plan.seconds > MOST_SECONDS_OF_JUMPS:
            raise AccuracyError(f"about {plan.seconds:.2g} s by {plan.method}: {_wrapped(pupil)}")
        return plan, sampling

    @property
    def _methods(self) -> str:
        return "field" if self.keeps_field and self.method in ("auto", "exact") else self.method

    def _as_before(self) -> tuple[Plan, Sampling] | None:
        if self.like is None:
            return None
        try:
            plan, sampling = choose(self.problem, self.like.method, self.most_seconds)
        except AccuracyError:
            return None
        fixed = PSF_CALL + window_seconds(self.problem)  # the same for all methods
        if plan.seconds - fixed > GROWN * (self.like.seconds - fixed):
            return None
        return replace(plan, why=plan.why.replace("requested", "same method as at the previous wavelength")), sampling


def _wrapped(pupil: Pupil) -> str:
    """Return advice on a height map that jumps from sample to sample.

    The advice is to use a PixelRelief, which represents steps. If the mask is a RayField, which requires one ray at
    each point, the advice is to use a smooth height map, because a step has no ray.
    """
    rows, columns = pupil.height.samples.shape
    remedy = "optics.PixelRelief(height) represents the steps"
    if isinstance(pupil.mask, RayField):
        remedy = "must be smooth, for each point to have one ray"
    elif rows != columns:
        remedy += " of as many rows as columns"
    return (
        f"height jumps by {pupil.height.jump:.3g} m from sample to sample, as in a wrapped lens, and HeightMap "
        f"connects them by steep slopes: {remedy}"
    )


def sensor_place(pupil: Pupil, sensor_distance: Scalar | None, source_distance: Scalar) -> Scalar:
    """Return the distance [m] of the sensor.

    If `sensor_distance` is None, this is the distance at which the pupil's ideal lens images the source, or
    240 µm if the pupil has no lens.

    Raises:
        ValueError: no distance is given, and the default would depend on a number that carries a derivative; or the
            lens forms no real image.
    """
    if sensor_distance is not None:
        return sensor_distance
    focal = pupil.thin_lens_focal_length
    for name, value in (("thin_lens_focal_length", focal), ("source_distance", source_distance)):
        if focal is not None and carries_derivative(value):
            raise ValueError(
                f"sensor_distance is missing: {name} carries a derivative, but the default distance of the sensor, "
                "which depends on it, carries none; specify the distance [m], which may carry a derivative"
            )
    return pupil.image_distance(number(source_distance))


@dataclass(frozen=True)
class Setup:
    """Parameters of a PSF, except the pupil and the wavelength.

    sensor_distance: distance [m] of the sensor behind the pupil.
    window: samples on the sensor.

    See `optics.psf` for the other parameters.
    """

    sensor_distance: Scalar
    source: PointSource
    window: Grid
    tolerance: float
    method: str
    dtype: str

    def __post_init__(self) -> None:
        one_of("method", self.method, ("auto", "exact", *METHODS))
        precision(self.dtype)
        check_window(self.window, self.dtype)

    def request(self, pupil: Pupil, wavelength: float) -> Request:
        """Return the request for the PSF of a pupil at a vacuum wavelength [m].

        Raises:
            ValueError: an argument is invalid; the message names it with its value and valid range.
        """
        beam = Beam(pupil, self.source, wavelength, self.sensor_distance)
        return Request(beam, Problem.from_beam(beam, self.window, self.tolerance, self.dtype), self.method)
