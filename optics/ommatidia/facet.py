"""Facet lenses: thick lenses with spherical or flat surfaces, between air or water and the crystalline cone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from optics.apertures.aperture import Aperture
from optics.apertures.circular import Circle
from optics.apertures.polygonal import Polygon
from optics.elements.pupil import MIDDLE, Pupil
from optics.elements.refractive_index import Dispersion, index_of
from optics.numerics.arguments import finite, one_of, positive, without_derivative

__all__ = ["FacetLens"]

SHAPES = ("hexagon", "circle")


@dataclass(frozen=True)
class FacetLens:
    """A thick lens with two spherical surfaces (Stavenga, J. Comp. Physiol. A 189, 1, 2003, appendix 1).

    diameter: width [m] of the hexagon between opposite sides, or of the circle.
    radius_front, radius_back: radii of curvature [m], positive if the centre lies behind the surface. A biconvex lens
        has a negative radius_back.
    thickness: thickness [m] of the lens on its axis, 0 or more.
    n, object_n, medium_n: refractive indices of the lens, of the medium in front of the lens, and of the crystalline
        cone behind the lens. Each is a number or a dispersion curve. With curves, the focus of an `Ommatidium` with
        this lens depends on the wavelength, but `pupil` has the same focus for all wavelengths.
    shape: "hexagon", with corners along y, or "circle".

    Raises:
        ValueError: an argument is outside its valid range, which the message states, or the lens does not focus.
    """

    diameter: float
    radius_front: float
    radius_back: float = -math.inf
    thickness: float = 0.0
    n: float | Dispersion = 1.45
    object_n: float | Dispersion = 1.0
    medium_n: float | Dispersion = 1.34
    shape: str = "hexagon"

    def __post_init__(self) -> None:
        positive("diameter", self.diameter)
        for name in ("radius_front", "radius_back"):
            value = without_derivative(name, getattr(self, name))
            if not (isinstance(value, float) and math.isinf(value)):
                positive(f"abs({name})", abs(finite(name, value)))
        if finite("thickness", self.thickness) != 0:
            positive("thickness", self.thickness)
        for name in ("n", "object_n", "medium_n"):
            index_of(name, getattr(self, name))
        one_of("shape", self.shape, SHAPES)
        if self.power(MIDDLE) <= 0:
            raise ValueError(f"radius_front = {self.radius_front:g}: must make a lens that focuses parallel light")

    def power(self, wavelength: float) -> float:
        """Return the power P = P₁ + P₂ - t P₁P₂/n [1/m] at a vacuum wavelength [m].

        P₁ and P₂ are the powers of the surfaces, t is the thickness and n the index of the lens.

        Raises:
            ValueError: the wavelength or an index at this wavelength is invalid, as in all methods of the lens.
        """
        front, back, n = self._surfaces(wavelength)
        return front + back - self.thickness / n * front * back

    def focal_length(self, wavelength: float = MIDDLE) -> float:
        """Return the focal length [m] behind the lens, measured from the second principal plane.

        It is the index of the crystalline cone behind the lens, divided by the power of the lens.
        """
        return self._index("medium_n", wavelength) / self.power(wavelength)

    def object_focal_length(self, wavelength: float = MIDDLE) -> float:
        """Return the focal length f [m] in front of the lens.

        It is the index of the medium in front of the lens, divided by the power of the lens. A receptor of width d sees
        the angle d/f.
        """
        return self._index("object_n", wavelength) / self.power(wavelength)

    def principal_planes(self, wavelength: float = MIDDLE) -> tuple[float, float]:
        """Return the distances [m] of the first and the second principal plane behind the front vertex."""
        front, back, n = self._surfaces(wavelength)
        power, thickness = self.power(wavelength), self.thickness
        first = self._index("object_n", wavelength) * thickness * back / (n * power)
        second = thickness - self._index("medium_n", wavelength) * thickness * front / (n * power)
        return first, second

    def pupil(self, wavelength: float = MIDDLE, **others: Any) -> Pupil:
        """Return a pupil that replaces the thick lens by an ideal thin lens in an opening of the facet's shape.

        Distances in front of the pupil are measured from the first principal plane, distances behind it from the
        second. The ideal lens has one focal length for light of all wavelengths: that of the facet lens at `wavelength`
        [m].

        others: further arguments of `Pupil`, such as a wavefront for the lens' aberrations.

        Raises:
            ValueError: an argument is invalid.
        """
        corners = 2 / math.sqrt(3) if self.shape == "hexagon" else 1.0
        return Pupil(
            corners * self.diameter / 2,
            aperture=self._opening(),
            thin_lens_focal_length=self.focal_length(wavelength),
            medium_n=self.medium_n,
            object_n=self.object_n,
            **others,
        )

    def _opening(self) -> Aperture:
        return Polygon.regular(6, 90.0) if self.shape == "hexagon" else Circle()

    def _surfaces(self, wavelength: float) -> tuple[float, float, float]:
        """Return the powers [1/m] of both surfaces, and the index between them."""
        before, n, behind = (self._index(name, wavelength) for name in ("object_n", "n", "medium_n"))
        return (n - before) / self.radius_front, (behind - n) / self.radius_back, n

    def _index(self, name: str, wavelength: float) -> float:
        return float(index_of(name, getattr(self, name)).at(wavelength))
