"""Sampling of a plane of a system, and the light that the plane transmits.

The edge of a pupil's aperture is softened (optics.apertures.aperture), but all frequencies that can reach the next
plane remain exact. The samples of the pupil are dense enough to keep aliases off these frequencies. Sums over samples
then converge spectrally.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.apertures.aperture import EDGE_REACH, SoftAperture
from optics.elements.beam import Beam
from optics.elements.derivative_knots import derivative_knots
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.problem import SLOPE_MARGIN
from optics.numerics.accuracy import MOST_SAMPLES, AccuracyError
from optics.numerics.autodiff import grad_enabled
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.propagation.misalignment import Alignment, path_to_tilted_plane, seen_from
from optics.propagation.plane_step import PlaneField, StepSettings, Stop
from optics.propagation.propagate import lit_part
from optics.propagation.soft_pixels import SoftPixels

__all__ = ["PupilSampling"]

FADE = 0.2  # choice: width of the fade that removes such light, relative to the frequency where it begins
# Choice: error of derivatives with respect to samples of maps, relative to the amplitude of a cubic spline through a
# single sample at the highest frequency that is resolved.
SPLINE_PART = 3.0


@dataclass(frozen=True)
class PupilSampling:
    """Samples of a pupil, its soft aperture, and limits of the frequencies in the field behind it.

    soft: aperture with a softened edge. For a relief of pixels, the jumps between pixels are softened as well.
    source: source that illuminates the pupil if no field arrives from a previous plane. Its position is relative to the
        pupil's centre.
    band, rays, kept: frequencies [1/m] in the field behind the pupil, see `PlaneField`.
    path: difference [m] between two paths of the source's light: the path to the centre of a decentred pupil, minus the
        path to the point of the system's axis at the same distance along the axis.
    """

    pupil: Pupil
    source: PointSource
    grid: Grid
    soft: SoftAperture | SoftPixels
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

        The result's `band` is the highest frequency that must be sampled without aliases. It is the highest frequency
        of light that can reach the next plane, or a lower limit if the settings remove diffracted light
        (`StepSettings.margin`). Light behind the pupil also has frequencies above `band`, up to the sum of three: the
        highest frequencies of the arriving light, of the pupil's phase and of the pupil's edge. Such light may have
        aliases, but the frequencies of the aliases must lie above `band` as well.

        field: arriving field, before its propagation to the pupil. None: the source illuminates the pupil. The phase of
            the source's wave at the pupil is then treated as part of the pupil's phase.

        Raises:
            ValueError: the pupil's relief consists of pixels, and either the pupil's radius carries a derivative or the
                next stop lies in the pupil's plane.
            AccuracyError: more samples are necessary than the limit allows.
        """
        pupil = stop.pupil
        assert pupil is not None
        pixels = pupil.pixels > 0 and pupil.bends(settings.wavelength)
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
        turns += _derivative_band(pupil.level if pixels else pupil, settings)
        widths = stop.half_width + following.half_width + following.apart(stop.alignment)
        band, kept = settings.reaching(widths, following.distance), None
        if math.isinf(band) and pixels:
            raise ValueError("elements: a PixelRelief lies in the plane of the output: put FreeSpace between them")
        if math.isinf(band):
            band = turns  # coinciding planes: the edge is as soft as the finest detail
        rays += inside + pupil.scatter(settings.wavelength, settings.ripple)
        limit = rays + settings.margin / pupil.radius
        if (1 + FADE) * limit < band:
            band, kept = (1 + FADE) * limit, limit
        soft: SoftAperture | SoftPixels
        passed = (turns + band) * pupil.radius, settings.edge_ripple, EDGE_REACH
        soft = SoftPixels.from_pupil(pupil, *passed, stop.alignment) if pixels else pupil.aperture.soften(*passed)
        pitch = 1 / (turns + band + soft.stopband / pupil.radius)
        grid = Grid.square(2 * math.ceil((1 + soft.reach) * pupil.radius / pitch) + 1, pitch)
        if field is not None:
            grid = settings.matched(field, stop, grid)
        if (across := grid.shape[0]) > MOST_SAMPLES:
            raise AccuracyError(
                f"a pupil of radius {pupil.radius:.3g} m needs {across} samples across; the limit is {MOST_SAMPLES}: "
                "widen the tolerance, flatten its relief, or move the adjacent planes further away"
            )
        return cls(pupil, source, grid, soft, band, rays, kept, stop.alignment, path)

    def error(self, settings: StepSettings) -> float:
        """Return the relative error of the intensity behind the pupil due to its soft edge, its pixels and rounding."""
        return settings.edge_error + (self.soft.error(settings.dtype) if isinstance(self.soft, SoftPixels) else 0.0)

    def transmitted(self, arrived: PlaneField | None, settings: StepSettings) -> PlaneField:
        """Return the field behind the pupil: the field on the grid times the pupil's transmittance.

        In backward propagation, the conjugate of the transmittance is used.

        arrived: field on the grid in front of the pupil; None for light from the source.
        """
        types = precision(settings.dtype)
        beam = Beam(self.pupil, self.source, settings.wavelength, math.inf)
        if isinstance(self.soft, SoftPixels):
            found = self.soft.behind(beam, self.grid, types)
        else:
            x, y = self.alignment.on_element(*self.grid.coordinates(types), types)
            found = beam.at(self.soft, x, y, self.grid, types)
        if settings.backward:
            found = Field(found.re, -found.im, self.grid, types)
        transmittance = found.numpy()
        if arrived is None:
            path = self.path + path_to_tilted_plane(self.source, self.alignment, self.grid)
            u = np.exp(2j * np.pi * settings.medium_n / settings.wavelength * path).astype(transmittance.dtype)
        else:
            u = arrived.u
        field = u * transmittance
        tracked = None if arrived is None else arrived.tracked
        if tracked is None and grad_enabled([found.re, found.im]):
            tracked = Field.from_numpy(u, self.grid.dx, types)
        if tracked is None:
            field = lit_part(field)
        else:
            tracked = tracked * found
        return PlaneField(field, self.grid.dx, self.band, self.rays, self.kept, self.alignment, tracked)


def _derivative_band(pupil: Pupil, settings: StepSettings) -> float:
    """Return the frequency [1/m] up to which derivatives with respect to samples of the maps must be resolved.

    A map is a relief, wavefront or mask of the pupil that is given by samples.

    The derivative with respect to one sample is a cubic spline (optics.elements.derivative_knots). Its spectrum falls
    like (πν)⁻⁴, with ν in cycles per distance between samples of the map.
    """
    knots = derivative_knots(pupil, settings.wavelength)
    if knots is None:
        return 0.0
    cycles = (SPLINE_PART / settings.tolerance) ** 0.25 / math.pi
    return knots.splines * cycles / (float(np.diff(knots.borders).min()) * pupil.radius)
