"""The parameters of a propagation that determine where a method must sample."""

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

# Choice, relative to the steepest slope of a wavefront: the grid of slopes may miss the steepest point.
SLOPE_MARGIN = 1.02
# Choice: amplitude ripple of the soft aperture and of the spectral taper, relative to the tolerance on intensity.
# Edge-diffracted light has an amplitude error of several ripples, and its intensity has twice that. If a window
# contains no other light, this error is half the tolerance.
EDGE_RIPPLE_PER_TOLERANCE = 0.1
BRIGHT_EDGE_RIPPLE_PER_TOLERANCE = 0.3


@dataclass(frozen=True)
class Problem:
    """One monochromatic propagation from a pupil to a window, as numbers.

    aperture: shape of the pupil. radius, distance [m]; wavelength [m] in the medium; window: output grid.
    phase_band: highest spatial frequency [1/m] in the pupil's phase, over the disk and its soft edge.
    phase_band_inside: the same over the disk alone, because a relief may be steep in the soft edge.
    detail: bandwidth [1/m] of the phase that the slopes of the wavefront do not include.
    symmetric: whether nothing depends on the azimuth. even: whether nothing changes if x or y is mirrored.
    widest_band: frequencies beyond it may be dropped (infinite: everything that reaches the window counts).
    reach: distance from the axis [m] that contains all light except a fraction of the tolerance. Samples beyond it may
        be wrong, and edge-diffracted light may be less accurate (None: the window counts to its corners).
    slopes: slopes of the wavefront.
    medium_n: index behind the pupil.
    masked: whether a mask sends light to places that rays do not predict. Approximations then cannot predict their
        error.
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
    def from_beam(cls, beam: Beam, window: Grid, tolerance: float, dtype: str = "float32") -> Problem:
        """Return the problem of light that passes a pupil and arrives at a window.

        Raises:
            ValueError: the distance is not positive, the tolerance is not in [1e-12, 0.5], or the dtype is invalid.
        """
        distance = positive("sensor_distance", beam.distance, carried=True)
        tolerance = in_range("tolerance", tolerance, 1e-12, 0.5)
        precision(dtype)
        source = PointSource(number(beam.source.distance), beam.source.angle)
        return _problem(Beam(beam.pupil, source, beam.wavelength, distance), window, tolerance, dtype)

    @cached_property
    def turning(self) -> float:
        """Highest spatial frequency [1/m] in the combined phase of the pupil and the path to any point of the window.

        For a lens in focus it is far below the sum of the two.
        """
        return self._turning[0]

    @cached_property
    def turning_inside(self) -> float:
        """Highest frequency [1/m] of the combined phase over the disk without its soft edge."""
        return self._turning[1]

    @cached_property
    def _turning(self) -> tuple[float, float]:
        soft, inside = self.slopes.turning(self.distance, self.window, self.medium_n)
        margin = SLOPE_MARGIN / (self.wavelength * self.medium_n)
        return margin * soft + self.detail, margin * inside + self.detail

    @cached_property
    def rays(self) -> Rays | None:
        """Rays of geometrical optics, from which approximations predict their error; None if pixels scatter light."""
        if self.pixelated is not None:
            return None
        return Rays.from_slopes(self.slopes, self.aperture, self.distance, self.medium_n)

    @property
    def pixelated(self) -> PixelatedAperture | None:
        """The aperture if the phase behind it jumps from pixel to pixel, else None."""
        return self.aperture if isinstance(self.aperture, PixelatedAperture) else None

    @property
    def ripple(self) -> float:
        """Allowed amplitude error of the soft aperture's spectrum."""
        return self.tolerance * (EDGE_RIPPLE_PER_TOLERANCE if self.reach is None else BRIGHT_EDGE_RIPPLE_PER_TOLERANCE)

    @property
    def fade_ripple(self) -> float:
        """Allowed amplitude error of light from beyond the band."""
        return self.ripple if self.reach is None else 0.1  # choice: beyond the band there is hardly any light

    @property
    def outermost(self) -> float:
        return self.window.half_diagonal if self.reach is None else self.reach

    @property
    def fresnel_number(self) -> float:
        return self.radius**2 / (self.wavelength * self.distance)

    @property
    def steepest_sine(self) -> float:
        """Largest sine of rays that meet in a point of the window."""
        leaving = self.phase_band_inside * self.wavelength + self.wavelength / self.radius
        return steepest_sine(self.radius, self.distance, leaving)

    @property
    def scalar_error(self) -> float:
        """Upper bound of the error of scalar theory."""
        return scalar_theory_error(self.steepest_sine, self.spread)

    def soft_edge(self, band: float) -> PupilEdge:
        """Return the aperture with a soft edge that leaves frequencies up to `band` [1/m] unchanged."""
        return PupilEdge(self.aperture.soften(stepped_up(band * self.radius), self.ripple, EDGE_REACH), self.radius)

    def band(self, margin: float = 0.0) -> float:
        """Return the highest frequency [1/m] of light from the disk that can come within `margin` of the window."""
        reach = (1 + EDGE_REACH) * self.radius + self.outermost + margin
        return min(self.widest_band, reach / math.hypot(reach, self.distance) / self.wavelength)


@dataclass(frozen=True)
class PupilEdge:
    """A soft aperture on a pupil of the given radius, in metres."""

    aperture: SoftAperture
    radius: float

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which the aperture is closed."""
        return (1 + self.aperture.reach) * self.radius

    @property
    def stopband(self) -> float:
        """Frequency [1/m] beyond which the spectrum is below the ripple."""
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
    detail = pupil.bandwidth(wavelength, tolerance / 10)  # choice: a tenth of the tolerance, for the phase [rad]
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
