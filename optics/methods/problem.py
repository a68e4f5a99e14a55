"""A propagation in numbers: what decides where a method must sample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

from optics.apertures.aperture import EDGE_REACH, Aperture, SoftAperture
from optics.apertures.pixelated import PixelatedAperture
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.elements.wavefront_slopes import Slopes
from optics.methods.rays import Rays
from optics.methods.scalar_theory import ROUND, light_spread, scalar_theory_error, steepest_sine
from optics.numerics.arguments import in_range, positive
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.quadrature import stepped_up

__all__ = ["SLOPE_MARGIN", "Problem", "PupilEdge"]

# Choice, over the steepest slope of a wavefront: the grid on which slopes are seen may miss the steepest place.
SLOPE_MARGIN = 1.02
# Choice. Amplitude ripple of the soft aperture and of the spectral taper against the tolerance on intensity.
# Edge-diffracted light errs by several ripples, its intensity by twice that, and a window may hold no other light: half
# the tolerance.
EDGE_RIPPLE_PER_TOLERANCE = 0.1
BRIGHT_EDGE_RIPPLE_PER_TOLERANCE = 0.3


@dataclass(frozen=True)
class Problem:
    """One monochromatic propagation from a pupil to a window, in numbers.

    aperture: its shape. radius, distance [m]; wavelength [m] in the medium; window: output grid.
    phase_band: highest spatial frequency [1/m] in the pupil's phase, over the disk and its soft edge.
    phase_band_inside: the same over the disk without its soft edge, where a relief may bend steeply.
    detail: what of the phase the wavefront's slopes do not tell [1/m].
    symmetric: nothing depends on the azimuth. even: nothing changes where x or y is mirrored.
    widest_band: frequencies beyond it may be dropped (infinite: whatever reaches the window counts).
    reach: given where all but a tolerance's share of the light stays within this distance of the axis [m]: what lies
        beyond may be wrong, and edge-diffracted light less exact (None: the window counts to its corners).
    slopes: of the wavefront.
    medium_n: index behind the pupil.
    masked: whether a mask sends light where rays do not tell, so that approximations cannot judge themselves.
    spread: of the light over the pupil, see `light_spread`.
    """

    aperture: Aperture
    radius: float
    wavelength: float
    distance: float
    window: Grid
    phase_band: float
    phase_band_inside: float
    detail: float
    slopes: Slopes
    symmetric: bool
    tolerance: float
    dtype: str = "float32"
    widest_band: float = math.inf
    reach: float | None = None
    masked: bool = False
    medium_n: float = 1.0
    spread: float = ROUND
    even: bool = False

    @classmethod
    def of(cls, beam: Beam, window: Grid, tolerance: float, dtype: str = "float32") -> Problem:
        """The problem of light that goes through a pupil to a window.

        Raises:
            ValueError: the distance is not positive, tolerance not in [1e-12, 0.5], or there is no such dtype.
        """
        distance = positive("sensor_distance", beam.distance, carried=True)
        tolerance = in_range("tolerance", tolerance, 1e-12, 0.5)
        precision(dtype)
        source = PointSource(number(beam.source.distance), beam.source.angle)
        return _problem(Beam(beam.pupil, source, beam.wavelength, distance), window, tolerance, dtype)

    @cached_property
    def turning(self) -> float:
        """Highest spatial frequency [1/m] in the phase of the pupil and of the path to any point of the window
        together; for a lens in focus far less than the sum of both."""
        return self._turning[0]

    @cached_property
    def turning_inside(self) -> float:
        """The same over the disk without its soft edge."""
        return self._turning[1]

    @cached_property
    def _turning(self) -> tuple[float, float]:
        soft, inside = self.slopes.turning(self.distance, self.window, self.medium_n)
        margin = SLOPE_MARGIN / (self.wavelength * self.medium_n)
        return margin * soft + self.detail, margin * inside + self.detail

    @cached_property
    def rays(self) -> Rays | None:
        """Where geometrical optics sends the light, by which approximations judge themselves; None: pixels scatter."""
        if self.pixelated is not None:
            return None
        return Rays.of(self.slopes, self.aperture, self.distance, self.medium_n)

    @property
    def pixelated(self) -> PixelatedAperture | None:
        """The aperture, if the light behind it jumps from pixel to pixel."""
        return self.aperture if isinstance(self.aperture, PixelatedAperture) else None

    @property
    def ripple(self) -> float:
        """Amplitude error allowed to the soft aperture's spectrum."""
        return self.tolerance * (EDGE_RIPPLE_PER_TOLERANCE if self.reach is None else BRIGHT_EDGE_RIPPLE_PER_TOLERANCE)

    @property
    def fade_ripple(self) -> float:
        """Amplitude error allowed to light from beyond the band."""
        return self.ripple if self.reach is None else 0.1  # choice: beyond the band there is next to no light

    @property
    def outermost(self) -> float:
        return self.window.half_diagonal if self.reach is None else self.reach

    @property
    def fresnel_number(self) -> float:
        return self.radius**2 / (self.wavelength * self.distance)

    @property
    def steepest_sine(self) -> float:
        """Of rays that meet in a point of the window, at most."""
        leaving = self.phase_band_inside * self.wavelength + self.wavelength / self.radius
        return steepest_sine(self.radius, self.distance, leaving)

    @property
    def scalar_error(self) -> float:
        """What scalar theory itself errs by, at most."""
        return scalar_theory_error(self.steepest_sine, self.spread)

    def soft_edge(self, band: float) -> PupilEdge:
        """The aperture as samples can carry it that leave frequencies up to `band` [1/m] untouched."""
        return PupilEdge(self.aperture.soften(stepped_up(band * self.radius), self.ripple, EDGE_REACH), self.radius)

    def band(self, margin: float = 0.0) -> float:
        """Highest frequency [1/m] whose light can come within `margin` of the window from anywhere on the disk."""
        reach = (1 + EDGE_REACH) * self.radius + self.outermost + margin
        return min(self.widest_band, reach / math.hypot(reach, self.distance) / self.wavelength)


@dataclass(frozen=True)
class PupilEdge:
    """A soft aperture on a pupil of the given radius: its numbers in metres."""

    aperture: SoftAperture
    radius: float

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which nothing passes."""
        return (1 + self.aperture.reach) * self.radius

    @property
    def stopband(self) -> float:
        """Frequency [1/m] beyond which its spectrum is below the ripple."""
        return self.aperture.stopband / self.radius

    @property
    def seconds_per_point(self) -> float:
        return self.aperture.seconds_per_point


@lru_cache(maxsize=256)
def _problem(beam: Beam, window: Grid, tolerance: float, dtype: str) -> Problem:
    pupil, wavelength, distance = beam.pupil, beam.wavelength, beam.distance
    slopes = pupil.slopes(wavelength, beam.source)
    pixels = pupil.pixels if pupil.bends(wavelength) else 0
    on_axis = beam.source.angle == (0.0, 0.0)
    detail = pupil.bandwidth(wavelength, tolerance / 10)  # choice: a tenth, of the phase [rad]
    return Problem(
        aperture=PixelatedAperture(pupil.aperture, pixels) if pixels else pupil.aperture,
        radius=pupil.radius,
        wavelength=wavelength / beam.index,
        distance=distance,
        window=window,
        phase_band=SLOPE_MARGIN * slopes.steepest / wavelength + detail,
        phase_band_inside=SLOPE_MARGIN * slopes.steepest_inside / wavelength + detail,
        detail=detail,
        slopes=slopes,
        symmetric=pupil.rotationally_symmetric(wavelength) and on_axis,
        tolerance=tolerance,
        dtype=dtype,
        masked=pupil.mask is not None,
        medium_n=beam.index,
        spread=light_spread(pupil),
        even=on_axis and window.centre == (0.0, 0.0) and pupil.mirror_symmetric(wavelength),
    )
