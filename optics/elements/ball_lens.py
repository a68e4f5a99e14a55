"""Gradient-index ball lenses, such as those of fish: their focus, and a pupil that has the same effect on light.

The wavefront of this pupil is that of the light behind the lens.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from optics.elements.pupil import MIDDLE, Pupil
from optics.elements.refractive_index import Dispersion, index_of
from optics.elements.spherical_index import SphericalIndex, generalized_luneburg
from optics.elements.wavefront import UM, Zernike, mode
from optics.numerics.arguments import in_range, positive, reals, shown
from optics.numerics.quadrature import gauss_legendre

__all__ = ["BallLens"]

RINGS = 24  # choice: rays for the fit of the wavefront
ORDER = 12  # choice: highest radial order of the wavefront
STEEPEST = 0.95  # largest sine of a ray behind the lens


Shape: TypeAlias = Callable[[np.ndarray], np.ndarray]


def parabola(u: np.ndarray) -> np.ndarray:
    """Return Matthiessen's profile 1 - u² at distances u from the centre, relative to the radius."""
    return 1 - u * u


@dataclass(frozen=True, eq=False)
class BallLens:
    """A sphere with the index n(r, λ) = n_surface(λ) + (n_core(λ) - n_surface(λ)) shape(r/R), in a uniform medium.

    All directions are equivalent. On a retina that is concentric with the lens, every receptor therefore has the same
    PSF, apart from the aperture's foreshortening.

    radius: radius R [m] of the lens.
    core_n, surface_n: refractive indices at the centre and just inside the surface, constant or dispersive.
    medium_n: refractive index of the surrounding medium, on both sides.
    shape: function that maps an array of r/R in [0, 1] to values that fall from 1 at the centre to 0 at the surface.
        It must be smooth in (r/R)². Default: the parabola 1 - (r/R)².

    Raises:
        ValueError: an argument is outside its valid range, which the message states, or the profile traps light inside
            the lens. No light is trapped if n r grows from the centre to the surface.
    """

    radius: float
    core_n: float | Dispersion
    surface_n: float | Dispersion
    medium_n: float | Dispersion
    shape: Shape = parabola

    def __post_init__(self) -> None:
        positive("radius", self.radius)
        for name in ("core_n", "surface_n", "medium_n"):
            index_of(name, getattr(self, name))
        if not callable(self.shape):
            raise ValueError(f"shape = {shown(self.shape)}: must be a function of r/R, such as lambda u: 1 - u**2")
        ends = reals("shape", self.shape(np.array([0.0, 1.0])))
        if ends.shape != (2,) or not np.allclose(ends, (1, 0), atol=1e-6):
            raise ValueError(f"shape is {shown(ends.tolist())} at r/R = 0 and 1: must be 1 and 0")
        _profile(self, MIDDLE)

    @classmethod
    def luneburg(cls, radius: float, medium_n: float, focal_ratio: float = 1.0) -> BallLens:
        """Return a lens that focuses parallel light perfectly.

        The focus lies behind the centre of the lens, at a distance of `focal_ratio` times the radius R of the lens.
        With focal_ratio = 1 it is Luneburg's lens, with n = n_medium √(2 - (r/R)²) at the distance r from the centre. A
        ratio of about 2.5 describes the lenses of fish (Matthiessen, Pflügers Archiv 27, 510, 1882).

        Raises:
            ValueError: focal_ratio is outside [1, 20], or another argument is outside its valid range.
        """
        relative = generalized_luneburg(focal_ratio)
        core, medium = float(relative(np.zeros(1))[0]), float(index_of("medium_n", medium_n).at(MIDDLE))
        return cls(radius, core * medium, medium, medium, lambda u: (relative(u) - 1) / (core - 1))

    @classmethod
    def maxwell(cls, radius: float, medium_n: float = 1.0) -> BallLens:
        """Return Maxwell's fish-eye of radius R, with n = 2 n_medium/(1 + (r/R)²) at the distance r from the centre.

        It images each point of its surface on the opposite point.

        Raises:
            ValueError: an argument is outside its valid range, which the message states.
        """
        medium = float(index_of("medium_n", medium_n).at(MIDDLE))
        return cls(radius, 2 * medium, medium, medium, lambda u: (1 - u * u) / (1 + u * u))

    def index(self, r: Any, wavelength: float = MIDDLE) -> np.ndarray:
        """Return the refractive index at distances r [m] from the centre, in an array of the shape of r.

        Raises:
            ValueError: a distance is above the radius or NaN, or the wavelength is invalid.
        """
        u = reals("r", r) / self.radius
        in_range("r", float(u.max(initial=0.0)) * self.radius, 0.0, self.radius)
        core, surface, _ = self._indices(wavelength)
        return np.asarray(surface + (core - surface) * np.asarray(self.shape(np.abs(u))))

    def turning(self, height: Any, wavelength: float = MIDDLE) -> np.ndarray:
        """Return the angle ψ [rad] about the centre between a ray's entry and its exit.

        height: distance [m] at which the ray would pass the centre without the lens, above 0 and below the lens's
            radius R, an array of any shape. The result has the same shape.

        Raises:
            ValueError: a height is not between 0 and R, both excluded, the wavelength is invalid, or a ray is totally
                reflected at the surface.
        """
        return _profile(self, wavelength).turning(self._relative(height))

    def deviation(self, height: Any, wavelength: float = MIDDLE) -> np.ndarray:
        """Return the angle [rad] by which the lens bends rays towards the axis: ψ + 2 arcsin(h/R) - π.

        ψ is the angle about the centre between a ray's entry and its exit, see `turning`. R is the radius of the lens.

        height: distance h [m] of parallel rays from the axis.

        Raises:
            ValueError: see `turning`.
        """
        h = self._relative(height)
        return _profile(self, wavelength).turning(h) + 2 * np.arcsin(h) - math.pi

    def focus(self, height: Any, wavelength: float = MIDDLE) -> np.ndarray:
        """Return the distance [m] behind the centre at which rays that arrive parallel to the axis cross the axis.

        height: distance [m] of the rays from the axis.

        The result is negative for rays that the lens bends away from the axis.

        Raises:
            ValueError: see `turning`.
        """
        return np.asarray(reals("height", height) / np.sin(self.deviation(height, wavelength)))

    def focal_length(self, wavelength: float = MIDDLE) -> float:
        """Return the paraxial focal length [m], measured from the centre of the lens.

        It is computed from a formula that contains one integral. The integral is evaluated numerically.

        Raises:
            ValueError: the lens does not focus, or the wavelength is invalid.
        """
        power = _profile(self, wavelength).power()
        if not power > 0:
            raise ValueError(f"core_n = {self.core_n}: must make a lens that focuses parallel light")
        return self.radius / power

    def pupil(self, aperture_radius: float, wavelength: float = MIDDLE) -> Pupil:
        """Return a pupil that has the same effect on parallel light as the lens.

        The pupil lies on the plane through the lens's centre. Its wavefront is that of the light behind the lens,
        relative to a sphere about the paraxial focus, where sensors are by default. The pupil's amplitude is uniform
        over its plane, although rays are denser or sparser towards the rim of a thick lens.

        aperture_radius: largest distance [m] of parallel rays from the axis, below the lens's radius R.
        wavelength: vacuum wavelength [m]. The focal length and `medium_n` of the pupil are those for this wavelength.

        Raises:
            ValueError: aperture_radius is not between 0 and R, both excluded, the wavelength is invalid, the lens does
                not focus, or the sine of a ray's angle behind the lens exceeds 0.95.
        """
        focal, widest = self.focal_length(wavelength), float(self._relative(aperture_radius))
        at, weights = gauss_legendre(RINGS)
        x, ahead = self._wavefront(np.append(at, 1.0) * widest, focal / self.radius, wavelength)
        edge = float(x[-1])
        orders, rho = range(0, ORDER + 1, 2), x[:-1] / edge
        root = np.sqrt(weights * rho)  # square roots of weights that are proportional to the areas of the rays' rings
        basis = np.stack([mode(n, 0, rho, np.zeros_like(rho)) for n in orders], axis=1)
        found = np.linalg.lstsq(basis * root[:, None], ahead[:-1] * root, rcond=None)[0]
        modes = {(n, 0): float(value) / UM for n, value in zip(orders, found, strict=True) if n}
        medium = float(index_of("medium_n", self.medium_n).at(wavelength))
        return Pupil(edge, medium_n=medium, thin_lens_focal_length=focal, wavefront=Zernike(modes, edge))

    def _wavefront(self, h: np.ndarray, focal: float, wavelength: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the distances [m] of rays from the axis on the pupil's plane, and the wavefront [m] there.

        h: heights of the parallel rays, relative to R.
        focal: focal length, relative to R.
        """
        profile = _profile(self, wavelength)
        bent = profile.turning(h) + 2 * np.arcsin(h) - math.pi
        in_range("sine of the steepest ray", float(np.abs(np.sin(bent)).max()), 0.0, STEEPEST)
        along = focal * np.cos(bent) - np.sqrt(focal**2 - (h - focal * np.sin(bent)) ** 2)
        outside = along - 2 * np.sqrt(1 - h * h)
        ahead = profile.path(np.zeros(1)) - 2 - (profile.path(h) + outside)
        x, z = h * np.cos(bent) - along * np.sin(bent), h * np.sin(bent) + along * np.cos(bent)
        medium = self._indices(wavelength)[2]
        return focal * x / (focal - z) * self.radius, medium * ahead * self.radius

    def _relative(self, height: Any) -> np.ndarray:
        h = reals("height", height) / self.radius
        if not ((h > 0) & (h < 1)).all():
            raise ValueError(f"height = {shown(height)}: must be above 0 and below the radius, {self.radius:g} m")
        return h

    def _indices(self, wavelength: float) -> tuple[float, float, float]:
        names = ("core_n", "surface_n", "medium_n")
        core, surface, medium = (float(index_of(name, getattr(self, name)).at(wavelength)) for name in names)
        return core, surface, medium


@lru_cache(maxsize=64)
def _profile(lens: BallLens, wavelength: float) -> SphericalIndex:
    core, surface, medium = lens._indices(wavelength)
    return SphericalIndex.from_function(lambda u: (surface + (core - surface) * np.asarray(lens.shape(u))) / medium)
