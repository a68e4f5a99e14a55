"""A propagation in numbers: what decides where a method must sample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from optics.apertures.aperture import EDGE_REACH, Aperture, SoftAperture
from optics.apertures.pixelated import PixelatedAperture
from optics.methods.rays import Rays
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque

__all__ = ["FADES", "STEEPEST_SINE", "Problem", "PupilEdge", "Taper", "tapers"]

# Amplitude ripple of the soft aperture and of the spectral taper against the tolerance on intensity. Edge-diffracted
# light errs by several ripples, its intensity by twice that, and a window may hold no other light: half the tolerance.
RIPPLE_PER_TOLERANCE = 0.1
BRIGHT_RIPPLE_PER_TOLERANCE = 0.3
# The taper must end this far from grazing incidence, where z tan θ has no bound.
STEEPEST_SINE = 0.9995
FADES = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)  # blurs to try, in units of the problem's size


@dataclass(frozen=True)
class Problem:
    """One monochromatic propagation from a pupil to a window, in numbers.

    aperture: its shape. radius, distance [m]; wavelength [m] in the medium; window: output grid.
    phase_band: highest spatial frequency [1/m] in the pupil's phase, over the disk and its soft edge.
    turning: highest spatial frequency [1/m] in the phase of the pupil and of the path to any point of the window
        together; for a lens in focus far less than the sum of both.
    phase_band_inside, turning_inside: the same over the disk without its soft edge, where a relief may bend steeply.
    symmetric: nothing depends on the azimuth.
    widest_band: frequencies beyond it may be dropped (infinite: whatever reaches the window counts).
    reach: given where all but a tolerance's share of the light stays within this distance of the axis [m]: what lies
        beyond may be wrong, and edge-diffracted light less exact (None: the window counts to its corners).
    rays: where geometrical optics sends the light, by which approximations judge themselves (None: these are not
        weighed).
    """

    aperture: Aperture
    radius: float
    wavelength: float
    distance: float
    window: Grid
    phase_band: float
    phase_band_inside: float
    turning: float
    turning_inside: float
    symmetric: bool
    tolerance: float
    dtype: str = "float32"
    widest_band: float = math.inf
    reach: float | None = None
    rays: Rays | None = None

    @property
    def pixelated(self) -> PixelatedAperture | None:
        """The aperture, if the light behind it jumps from pixel to pixel."""
        return self.aperture if isinstance(self.aperture, PixelatedAperture) else None

    @property
    def ripple(self) -> float:
        """Amplitude error allowed to the soft aperture's spectrum."""
        return self.tolerance * (RIPPLE_PER_TOLERANCE if self.reach is None else BRIGHT_RIPPLE_PER_TOLERANCE)

    @property
    def fade_ripple(self) -> float:
        """Amplitude error allowed to light from beyond the band."""
        return self.ripple if self.reach is None else 0.1

    @property
    def outermost(self) -> float:
        return self.window.half_diagonal if self.reach is None else self.reach

    @property
    def fresnel_number(self) -> float:
        return self.radius**2 / (self.wavelength * self.distance)

    def soft_edge(self, band: float) -> PupilEdge:
        """The aperture as samples can carry it that leave frequencies up to `band` [1/m] untouched."""
        return PupilEdge(self.aperture.soften(band * self.radius, self.ripple, EDGE_REACH), self.radius)

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


@dataclass(frozen=True)
class Taper:
    """Where the spectrum fades out: from `band` over `width` [1/m], which blurs the field by `blur` [m].

    The fading is an error function whose derivative's transform falls to the ripple within the blur. What it removes
    must therefore land at least that far outside the window.
    """

    band: float
    width: float
    blur: float
    sine: float
    tangent: float

    @classmethod
    def of(cls, problem: Problem, blur: float) -> Taper:
        band, width = problem.band(blur), 2 * math.log(1 / problem.fade_ripple) / (math.pi * blur)
        sine = (band + width) * problem.wavelength
        return cls(band, width, blur, sine, sine / math.sqrt(max(1 - sine * sine, 1e-12)))

    @property
    def end(self) -> float:
        return self.band + self.width

    def fade(self, f: Any, types: Precision) -> Any:
        """1 below the band, 0 beyond its end: the error function falls to the ripple in √ln(1/ripple)."""
        import drjit as dr

        steepness = 2 / self.width * math.sqrt(math.pi * self.width * self.blur / 2)
        middle = opaque(types, self.band + self.width / 2)
        return (1 - dr.erf(types.Float((f - middle) * opaque(types, steepness)))) / 2


def tapers(problem: Problem) -> list[Taper]:
    """Tapers that end before grazing incidence."""
    size = problem.radius + problem.outermost
    found = [Taper.of(problem, share * size) for share in FADES]
    return [taper for taper in found if taper.sine < STEEPEST_SINE]
