"""An aperture with a soft edge, whose lengths are converted from radii of the pupil to metres."""

from __future__ import annotations

from dataclasses import dataclass

from optics.apertures.aperture import SoftAperture

__all__ = ["PupilEdge"]


@dataclass(frozen=True)
class PupilEdge:
    """A soft aperture, scaled to a pupil of the given radius [m]."""

    aperture: SoftAperture
    radius: float

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which the aperture is closed."""
        return (1 + self.aperture.reach) * self.radius

    @property
    def stopband(self) -> float:
        """Frequency [1/m] beyond which the soft edge's spectrum is below the allowed error (`Problem.ripple`)."""
        return self.aperture.stopband / self.radius

    @property
    def seconds_per_point(self) -> float:
        return self.aperture.seconds_per_point
