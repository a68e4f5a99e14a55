"""Light of one wavelength from a source through a pupil to a plane behind it."""

from __future__ import annotations

from dataclasses import dataclass

from optics.apertures.aperture import Aperture, SoftAperture
from optics.apertures.pixelated import PixelatedAperture
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.arguments import of_kind
from optics.numerics.array_library import like
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque

__all__ = ["Beam"]


@dataclass(frozen=True)
class Beam:
    """Light of one vacuum wavelength [m] from a source through a pupil to a plane at `distance` [m].

    The distance, the source's distance and angle, and the pupil's radius, focal length, relief, refractive index n,
    wavefront and mask may carry derivatives.
    """

    pupil: Pupil
    source: PointSource
    wavelength: float
    distance: Scalar

    def __post_init__(self) -> None:
        of_kind("pupil", self.pupil, Pupil, "Pupil(25e-6)")

    @property
    def radius(self) -> Scalar:
        """Radius of the pupil [m]."""
        return self.pupil.aperture_radius

    @property
    def index(self) -> float:
        """Refractive index of the medium behind the pupil."""
        return self.pupil.index_behind(self.wavelength)

    @property
    def aperture(self) -> Aperture:
        """Aperture of the pupil.

        If the pupil has a relief that consists of square pixels, and this relief bends the light, the aperture is
        divided into these pixels.
        """
        pixels = self.pupil.pixels if self.pupil.bends(self.wavelength) else 0
        return PixelatedAperture.squares(self.pupil.aperture, pixels) if pixels else self.pupil.aperture

    def waves(self, x: Array, y: Array) -> Array:
        """Return the optical path from the source to points (x, y) [m] just behind the pupil, in vacuum wavelengths.

        It is relative to the path that light through the pupil's centre would have if the pupil had no relief and added
        no wavefront. For the types of the arrays, see `Relief.height`.
        """
        return self.pupil.path(x, y, self.wavelength, self.source) * like(x, 1 / self.wavelength)

    def behind(self, soft: SoftAperture, grid: Grid, types: Precision) -> Field:
        """Return the field just behind the pupil on a grid [m]. The aperture's edge is softened."""
        return self.at(soft, *grid.coordinates(types), grid, types)

    def at(self, soft: SoftAperture, x: Array, y: Array, grid: Grid, types: Precision) -> Field:
        """Return the field just behind the pupil at points (x, y) [m], which need not be the points of the grid.

        There must be as many points as samples of the grid. The values are stored as samples of a field on the grid.
        """
        scale = 1 / opaque(types, self.radius)
        size = soft.transmittance(x * scale, y * scale, types)
        if self.pupil.mask is not None:
            size *= self.pupil.amplitude(x * scale, y * scale)
        return Field.from_waves(size, self.waves(x, y), grid, types)
