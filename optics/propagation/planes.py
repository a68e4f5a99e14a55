"""A plane of a system, sampled for the light that it transmits.

The edge of a pupil's aperture is softened (optics.apertures.aperture), but all frequencies that can reach the next
plane remain exact. The samples of the pupil are dense enough to keep aliases off these frequencies. Sums over samples
then converge spectrally.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from optics.apertures.aperture import EDGE_REACH, LEAST_RIPPLE, SoftAperture
from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.problem import SLOPE_MARGIN
from optics.numerics.accuracy import MOST_SAMPLES, AccuracyError
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.propagation.misalignment import ALIGNED, Alignment, Misaligned, path_to_tilted_plane, seen_from, slowness
from optics.propagation.propagate import WRAP_RIPPLE_PER_TOLERANCE, PropagationResult, propagated_field
from optics.propagation.transfer_function import EVERYTHING, Passage, kept_band, kept_square, limited_band

__all__ = ["PlaneField", "PupilSampling", "StepSettings", "Stop"]

RIPPLE_OF_LIMITED = 0.03  # choice: WRAP_RIPPLE_PER_TOLERANCE of fields without part of their diffracted light
FADE = 0.2  # choice: width of the fade that removes such light, relative to the frequency where it begins
REACH_MARGIN = 1.02  # choice: factor on the planes' half widths, because `propagate` extends each plane by a sample


@dataclass(frozen=True)
class PlaneField:
    """The field on the samples of a plane.

    band: highest frequency [1/m] in the field.
    rays: highest frequency [1/m] of geometrical rays in the field.
    kept: frequency [1/m] at which a fade begins that will remove all light at `band`. None: the field needs no fade.
    alignment: position of the plane. Samples are counted from its centre.
    """

    u: np.ndarray
    dx: float
    band: float
    rays: float
    kept: float | None = None
    alignment: Alignment = ALIGNED

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
    pupil: None for the output window.
    half_width: half width [m] of the pupil with its soft edge, or of the window.
    window: None for a pupil.
    alignment: position of the pupil.
    """

    distance: float
    pupil: Pupil | None
    half_width: float
    window: Grid | None = None
    alignment: Alignment = ALIGNED

    @classmethod
    def at(cls, element: Pupil | Misaligned, distance: float) -> Stop:
        if isinstance(element, Misaligned):
            pupil, alignment = element.pupil, Alignment.from_element(element)
        else:
            pupil, alignment = element, ALIGNED
        return cls(distance, pupil, (1 + EDGE_REACH) * pupil.radius, None, alignment)

    def apart(self, other: Alignment) -> float:
        """Return the distance [m] between both centres along x or along y, whichever is larger."""
        return max(map(abs, self.alignment.beside(other)))


@dataclass(frozen=True)
class StepSettings:
    """Settings that are the same at every plane.

    tolerance: tolerance of each step.
    wavelength: wavelength in vacuum [m].
    margin: frequencies [cycles per radius of a pupil] of diffracted light beyond those of geometrical rays. Light of
        higher frequencies is removed. Infinite: all light is propagated that can reach the next plane.
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

    def reaching(self, half_widths: float, distance: float) -> float:
        """Return the highest frequency [1/m] of light that `propagate` carries to the next plane, including its fade.

        The result is infinite if both planes coincide. If they are close, it includes evanescent waves that have not
        yet decayed.

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

    def carried(self, field: PlaneField, stop: Stop, grid: Grid) -> PropagationResult:
        """Return the field after propagation through free space, on the samples of the next stop."""
        wavelength, limit = self.wavelength / self.medium_n, None
        if field.kept is not None:
            limit = limited_band(field.kept, field.band - field.kept, wavelength, abs(stop.distance), self.ripple)
        window = grid.moved(stop.alignment.beside(field.alignment))
        if not (field.alignment.steepness or stop.alignment.steepness):
            passage = Passage(wavelength, stop.distance, False, EVERYTHING, self.ripple, window.centre, limit)
            return propagated_field(field.u, field.dx, passage, window, self.tolerance, self.dtype)
        sine = self.steep(field)
        turns, source = slowness(sine) / wavelength, Grid(field.u.shape, field.dx)
        leaving, error_out = field.alignment.nodes(field.half_width, sine, wavelength, self.tolerance / 4)
        arriving, error_in = stop.alignment.nodes(stop.half_width, sine, wavelength, self.tolerance / 4)
        found: list[PropagationResult] = []
        into = stop.alignment.weights(arriving, grid, -turns)
        for start, own in zip(leaving, field.alignment.weights(leaving, source, turns), strict=True):
            for end, weight in zip(arriving, into, strict=True):
                distance = stop.distance + float(end - start)
                passage = Passage(wavelength, distance, False, EVERYTHING, self.ripple, window.centre, limit)
                out = propagated_field(field.u * own, field.dx, passage, window, self.tolerance, self.dtype)
                carrier = np.exp(2j * np.pi * (end - start) * (turns - 1 / wavelength))
                found.append(replace(out, u=(out.u * (weight * carrier)).astype(out.u.dtype)))
        worst = max(found, key=lambda result: result.plan.predicted_error)
        plan = replace(worst.plan, predicted_error=worst.plan.predicted_error + error_out + error_in)
        return replace(worst, plan=plan, u=np.sum([result.u for result in found], axis=0))

    def steep(self, field: PlaneField) -> float:
        """Return the largest sin θ, with θ measured from the axis, of light for which tilts must be accurate.

        If diffracted light is removed, the remaining light beyond geometrical rays is too weak to matter here.
        """
        frequency = field.band if field.kept is None else field.rays
        return min(frequency * self.wavelength / self.medium_n, 1.0)


@dataclass(frozen=True)
class PupilSampling:
    """Samples of a pupil, its soft aperture, and the frequencies [1/m] that they transmit (see PlaneField).

    source: source relative to the pupil's centre, which illuminates the pupil if no field arrives.
    path: path [m] of the source's light to the pupil's centre, minus that to the axis.
    """

    pupil: Pupil
    source: PointSource
    grid: Grid
    soft: SoftAperture
    band: float
    rays: float
    kept: float | None
    alignment: Alignment
    path: float

    @classmethod
    def for_stop(
        cls, stop: Stop, following: Stop, settings: StepSettings, source: PointSource, field: PlaneField | None
    ) -> PupilSampling:
        """Return the sampling of the pupil at a stop.

        The band is the sum of the frequencies of the arriving light, of the pupil's phase and of the pupil's edge.
        Frequencies beyond the band may be aliased, but not into the band.

        field: arriving field, before its propagation to the pupil. None: the source illuminates the pupil. Its
            frequencies are then part of the pupil's phase.

        Raises:
            ValueError: the pupil has a relief of pixels.
            AccuracyError: more samples are necessary than the limit allows.
        """
        pupil = stop.pupil
        assert pupil is not None
        if pupil.pixels:
            raise ValueError(
                "elements: a PixelRelief has jumps, which the grids between planes cannot represent: use psf for it"
            )
        path = 0.0
        if field is None:
            source, path = seen_from(source, stop.alignment.centre)
        slopes = pupil.slopes(settings.wavelength, source)
        slope, inside = (SLOPE_MARGIN * s / settings.wavelength for s in (slopes.steepest, slopes.steepest_inside))
        arriving = rays = 0.0
        if field is not None:
            widths = field.half_width + stop.half_width + stop.apart(field.alignment)
            reaching = settings.reaching(widths, stop.distance)
            arriving, rays = min(field.band, reaching), min(field.rays, reaching)
        turns = arriving + slope + pupil.bandwidth(settings.wavelength, settings.edge_ripple)
        widths = stop.half_width + following.half_width + following.apart(stop.alignment)
        band, kept = settings.reaching(widths, following.distance), None
        if math.isinf(band):
            band = turns  # coinciding planes: the edge is as soft as the finest detail
        rays += inside + pupil.scatter(settings.wavelength, settings.ripple)
        limit = rays + settings.margin / pupil.radius
        if (1 + FADE) * limit < band:
            band, kept = (1 + FADE) * limit, limit
        soft = pupil.aperture.soften((turns + band) * pupil.radius, settings.edge_ripple, EDGE_REACH)
        pitch = 1 / (turns + band + soft.stopband / pupil.radius)
        across = 2 * math.ceil((1 + soft.reach) * pupil.radius / pitch) + 1
        if across > MOST_SAMPLES:
            raise AccuracyError(
                f"a pupil of radius {pupil.radius:.3g} m needs {across} samples across; the limit is {MOST_SAMPLES}: "
                "widen the tolerance, flatten its relief, or move the adjacent planes further away"
            )
        return cls(pupil, source, Grid.square(across, pitch), soft, band, rays, kept, stop.alignment, path)

    def transmitted(self, u: np.ndarray | None, settings: StepSettings) -> PlaneField:
        """Return the field u on the grid times the pupil's transmittance, or its conjugate in backward propagation.

        u: None for light from the source.

        Raises:
            ValueError: a number of the pupil carries a derivative.
        """
        import drjit as dr

        types = precision(settings.dtype)
        beam = Beam(self.pupil, self.source, settings.wavelength, math.inf)
        x, y = self.alignment.on_element(*self.grid.coordinates(types), types)
        found = beam.at(self.soft, x, y, self.grid, types)
        if dr.grad_enabled(found.re, found.im):
            raise ValueError("elements: a system has no derivatives; use psf for a single pupil")
        transmittance = found.numpy()
        if u is None:
            path = self.path + path_to_tilted_plane(self.source, self.alignment, self.grid)
            u = np.exp(2j * np.pi * settings.medium_n / settings.wavelength * path).astype(transmittance.dtype)
        field = u * (transmittance.conj() if settings.backward else transmittance)
        field = self.alignment.leaving(field, self.grid.dx, settings.wavelength / settings.medium_n)
        return PlaneField(field, self.grid.dx, self.band, self.rays, self.kept, self.alignment)
