"""A step of a system: the propagation of a field from one plane to the next.

The samples of the next plane are as dense as its pupil requires. The Fourier transforms of the propagation repeat the
field periodically. The pitch of the next plane's samples is reduced a little, so that the period is a whole multiple of
the pitches of both planes. Fast Fourier transforms can then compute both the spectrum and the field that follows from
it.

Fields on tilted planes are interpolated between several depths (optics.propagation.misalignment). All depths of a step
share one period, so each needs one transform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from optics.apertures.aperture import EDGE_REACH, LEAST_RIPPLE
from optics.elements.beam import Beam
from optics.elements.derivative_knots import carries_derivatives
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError
from optics.numerics.autodiff import Scalar, carries_derivative, number
from optics.numerics.field import Field
from optics.numerics.fourier import fast_length
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.propagation.field_derivatives import mapped
from optics.propagation.misalignment import ALIGNED, Alignment, Depths, Misaligned, slowness
from optics.propagation.propagate import (
    WRAP_RIPPLE_PER_TOLERANCE,
    PropagationResult,
    propagated_between_depths,
    propagated_field,
    step_map,
)
from optics.propagation.transfer_function import EVERYTHING, Passage, kept_band, kept_square, limited_band
from optics.propagation.transform_sampling import kept_light, sampling

__all__ = ["PlaneField", "StepSettings", "Stop"]

RIPPLE_OF_LIMITED = 0.03  # choice: WRAP_RIPPLE_PER_TOLERANCE of fields without part of their diffracted light
REACH_MARGIN = 1.02  # choice: factor on the planes' half widths, because `propagate` extends each plane by a sample
PITCHES = 4  # choice: pitches to try, because the period depends on the pitch through the outermost sample


@dataclass(frozen=True)
class PlaneField:
    """The field on the samples of a plane.

    band: highest frequency [1/m] in the field.
    rays: highest frequency [1/m] of geometrical rays in the field.
    kept: frequency [1/m] above which the next step will fade out the light. The fade ends at `band`, where no light is
        left. None: the field needs no fade.
    alignment: centre of the plane relative to the axis, and the plane's tilt. Sample n//2 is at this centre.
    tracked: the field u with its derivatives; None if u carries no derivatives.
    """

    u: np.ndarray
    dx: float
    band: float
    rays: float
    kept: float | None = None
    alignment: Alignment = ALIGNED
    tracked: Field | None = None

    @property
    def half_width(self) -> float:
        return Grid(self.u.shape, self.dx).half_width

    @property
    def power(self) -> float:
        return float(np.sum(np.abs(self.u) ** 2, dtype=np.float64)) * self.dx**2


@dataclass(frozen=True)
class Stop:
    """A pupil, or the output window, at a distance from the previous stop.

    distance: distance [m] from the previous stop, negative for backward propagation.
    pupil: the pupil; None for the output window.
    half_width: half width [m] of the pupil with its soft edge, or of the window.
    window: grid of the output window; None for a pupil.
    alignment: centre of the pupil relative to the axis, and the pupil's tilt.
    along: the distance with its derivative.
    """

    distance: float
    pupil: Pupil | None
    half_width: float
    window: Grid | None = None
    alignment: Alignment = ALIGNED
    along: Scalar = 0.0

    @classmethod
    def at(cls, element: Pupil | Misaligned, along: Scalar) -> Stop:
        """Return the stop of a pupil.

        along: distance [m] from the previous stop. It may carry a derivative.
        """
        if isinstance(element, Misaligned):
            pupil, alignment = element.pupil, Alignment.from_element(element)
        else:
            pupil, alignment = element, ALIGNED
        return cls(number(along), pupil, (1 + EDGE_REACH) * pupil.radius, None, alignment, along)

    def carries_derivatives(self, wavelength: float) -> bool:
        """Return whether the distance or any number of the pupil carries a derivative."""
        pupil = self.pupil
        light = pupil is not None and carries_derivatives(Beam(pupil, PointSource(), wavelength, math.inf))
        return light or carries_derivative(self.along)

    def apart(self, other: Alignment) -> float:
        """Return the distance [m] from the stop's centre to another plane's centre, along x or y, whichever is more."""
        return max(map(abs, self.alignment.beside(other)))


@dataclass(frozen=True)
class StepSettings:
    """Settings that are the same at every plane.

    tolerance: largest relative L2 error of the intensity that each step from plane to plane may add.
    wavelength: wavelength in vacuum [m].
    margin: amount [cycles per radius of a pupil]. Light is removed behind the pupil if its frequency exceeds the
        highest frequency of the geometrical rays by more than this amount. Infinite: all light that can reach the next
        plane is propagated.
    """

    wavelength: float
    medium_n: float
    backward: bool
    tolerance: float
    dtype: str
    margin: float = math.inf

    @property
    def ripple(self) -> float:
        return (WRAP_RIPPLE_PER_TOLERANCE if math.isinf(self.margin) else RIPPLE_OF_LIMITED) * self.tolerance

    @property
    def edge_ripple(self) -> float:
        """Relative ripple of the light behind soft edges, at least LEAST_RIPPLE because of rounding errors."""
        return max(self.ripple, LEAST_RIPPLE)

    @property
    def edge_error(self) -> float:
        """Relative error of the intensity behind a soft edge, including rounding errors."""
        return 8 * self.edge_ripple + 4 * FLOAT_NOISE[self.dtype]

    def reaching(self, half_widths: float, distance: float) -> float:
        """Return the highest frequency [1/m] in the light that `propagate` carries to the next plane.

        Light of high frequencies is so oblique that it misses the next plane, so `propagate` fades it out. The result
        is the frequency at which this fade ends. If the planes are so close that there is no such fade, evanescent
        waves reach the next plane before they decay. The result is then the highest frequency of these waves. It is
        infinite if both planes coincide.

        half_widths: sum of the half widths of the two planes [m].
        """
        z, wavelength = abs(distance), self.wavelength / self.medium_n
        if z == 0:
            return math.inf
        round_, square = (
            kept(REACH_MARGIN * widths, wavelength, z, self.ripple)
            for kept, widths in ((kept_band, math.sqrt(2) * half_widths), (kept_square, half_widths))
        )
        if math.isfinite(round_.kept):
            return max(round_.end, square.diagonal(wavelength) if math.isfinite(square.kept) else 0)
        return math.hypot(1 / wavelength, math.log(1 / self.ripple) / (2 * math.pi * z))

    def matched(self, field: PlaneField, stop: Stop, grid: Grid) -> Grid:
        """Return a grid at least as large and as dense as `grid`, with a pitch that divides the period of the step.

        The period is the distance after which the step's Fourier transform repeats the field.

        The grid is not changed if the step removes no light of high frequencies, if the grid's pitch already divides
        the period, or if too many samples would be necessary.
        """
        source, coarsest, half_width = Grid(field.u.shape, field.dx), grid.dx, grid.half_width
        for _ in range(PITCHES):
            try:
                window = grid.moved(stop.alignment.beside(field.alignment))
                how = sampling(self.passage(field, stop, window), source, window, 0.0)
            except AccuracyError:
                return grid
            if not how.passage.band.fade or how.back_period == round(how.back_period):
                return grid
            period = how.period * source.dx
            pitch = period / fast_length(period / coarsest)
            grid = Grid.square(2 * math.ceil(half_width / pitch) + 1, pitch)
        return grid

    def carried(self, field: PlaneField, stop: Stop, grid: Grid) -> tuple[PropagationResult, Field | None]:
        """Return the field after propagation through free space, on the samples of the next stop.

        The second result is the same field with its derivatives; None if neither `field` nor the distance carries any.
        """
        window, depths, error = grid.moved(stop.alignment.beside(field.alignment)), None, 0.0
        passage = self.passage(field, stop, window)
        differentiated = field.tracked is not None or carries_derivative(stop.along)
        if field.alignment.steepness or stop.alignment.steepness:
            depths, error = self._depths(field, stop, grid)
            how = sampling(passage, Grid(field.u.shape, field.dx), window, 0.0)
            out = propagated_between_depths(field.u, how, depths, self.tolerance, self.dtype)
            out = replace(out, plan=replace(out.plan, predicted_error=out.plan.predicted_error + error))
        else:
            passage = replace(passage, by_transforms=differentiated)
            out = propagated_field(field.u, field.dx, passage, window, self.tolerance, self.dtype)
        if not differentiated:
            return out, None
        before = field.tracked or Field.from_numpy(field.u, field.dx, precision(self.dtype))
        return out, mapped(before, out.u, grid, step_map(out, field.u.shape, depths), stop.along)

    def _depths(self, field: PlaneField, stop: Stop, grid: Grid) -> tuple[Depths, float]:
        """Return the depths for a step between tilted planes, and the error of the intensity due to the interpolation.

        The step computes fields at these depths, and the fields on the tilted planes are interpolated between them.
        """
        source, sine, types = Grid(field.u.shape, field.dx), self.steep(field), precision(self.dtype)
        wavelength, allowed = self.wavelength / self.medium_n, self.tolerance / 4
        turns = slowness(sine) / wavelength
        leaving, error_out = field.alignment.nodes(field.half_width, sine, wavelength, allowed)
        arriving, error_in = stop.alignment.nodes(stop.half_width, sine, wavelength, allowed)
        depths = Depths(
            (leaving, field.alignment.weights(leaving, source, turns, types)),
            (arriving, stop.alignment.weights(arriving, grid, -turns, types)),
            turns,
            field.alignment.slope,
        )
        return depths, error_out + error_in

    def passage(self, field: PlaneField, stop: Stop, window: Grid) -> Passage:
        """Return the parameters of the propagation to the next stop.

        Between tilted planes, the distance varies. The smallest distance then determines which frequencies are
        propagated, unless `field.kept` prescribes them. The largest distance determines how far light moves sideways.

        window: samples of the next stop, relative to the centre of the field's plane.
        """
        z, wavelength = abs(stop.distance), self.wavelength / self.medium_n
        deepest = field.alignment.steepness * field.half_width + stop.alignment.steepness * stop.half_width
        passage = Passage(wavelength, stop.distance, False, EVERYTHING, self.ripple, window.centre)
        if field.kept is not None:
            limit = limited_band(field.kept, field.band - field.kept, wavelength, z + deepest, self.ripple)
            return replace(passage, limit=limit)
        if not deepest:
            return passage
        nearest = math.copysign(max(z - deepest, 0), stop.distance)
        band = kept_light(replace(passage, z=nearest), Grid(field.u.shape, field.dx), window).band
        farther = (z + deepest) / abs(nearest) if nearest else 1.0
        return replace(passage, limit=replace(band, walk=farther * band.walk))

    def steep(self, field: PlaneField) -> float:
        """Return the largest sin θ of the light that must be propagated accurately between tilted planes.

        θ is the angle to the axis. If `field.kept` is None, the result is the largest sin θ of all light. Otherwise the
        result is the largest sin θ of the geometrical rays. Light at larger angles is diffracted: the step fades out
        part of this light, and the rest is too weak to matter.
        """
        frequency = field.band if field.kept is None else field.rays
        return min(frequency * self.wavelength / self.medium_n, 1.0)
