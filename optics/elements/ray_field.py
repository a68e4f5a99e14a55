"""Field of polarised light just behind a pupil, from the rays that leave the pupil.

A component of the field is used as the amplitude transmittance of a mask in the pupil.

A ray is perpendicular to the wavefront, so its direction is s = ∇L/n, where L is the path from the source through the
pupil, and n the refractive index behind it. The electric field is rotated together with the ray, along the shortest
arc. This is the effect of a lens that neither reflects nor absorbs (Richards & Wolf, Proc. R. Soc. A 253, 358, 1959,
§2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.elements.transmittance import Mask
from optics.numerics.array_library import library, like
from optics.numerics.autodiff import Array, Scalar, number

__all__ = ["SCALAR", "RayField", "Vector", "Weights", "before_pupil", "rays_behind", "turned"]

STEP = 1e-4  # choice, radii: step of differences; slopes of a lens then have errors of 1e-8, and 1e-11 from rounding
SPREAD = 2.0  # choice: bandwidth of fields relative to that of the path; fields depend on products of slopes

SCALAR = (1.0, 0.0, 0.0, 0.0, 0.0)  # weights of a `RayField` that equals the pupil's own mask

Weights = tuple[float, float, float, float, float]
Vector = tuple[Any, Any, Any]  # x, y, z: floats, or arrays of NumPy or Dr.Jit


def turned(field: Vector, before: Vector, after: Vector) -> Vector:
    """Return a field after the shortest rotation that turns the unit vector `before` into the unit vector `after`.

    The field is perpendicular to `before`.
    """
    factor = _product(field, after) / (1 + _product(before, after))
    x, y, z = (f - factor * (b + a) for f, b, a in zip(field, before, after, strict=True))
    return x, y, z


def before_pupil(source: PointSource, axis: int) -> tuple[Vector, Vector]:
    """Return the direction of a source's light in front of the pupil, and its electric field, as unit vectors.

    Light along the z axis would have its field along x (`axis` = 0) or along y (`axis` = 1). The field is turned by the
    shortest rotation that turns the z axis into the direction of the light.
    """
    x, y = (math.tan(angle) for angle in source.angle)
    length = math.hypot(x, y, 1)
    along = (x / length, y / length, 1 / length)
    return along, turned((1.0 - axis, 0.0 + axis, 0.0), (0.0, 0.0, 1.0), along)


def rays_behind(beam: Beam, x: Array, y: Array) -> Vector:
    """Return directions (x, y, z) of rays that leave the pupil at points (x, y) [m], each component an array like x.

    They are unit vectors, except for evanescent light, whose z component is 0.
    """
    radius, bare = beam.pupil.radius, replace(beam.pupil, mask=None)
    step, per = like(x, STEP * radius), like(x, 1 / (2 * STEP * radius * beam.index))

    def path(x: Array, y: Array) -> Array:
        return bare.path(x, y, beam.wavelength, beam.source)

    along_x = (path(x + step, y) - path(x - step, y)) * per
    along_y = (path(x, y + step) - path(x, y - step)) * per
    own = library(x)
    return along_x, along_y, own.sqrt(own.maximum(1 - along_x * along_x - along_y * along_y, like(x, 0.0)))


@dataclass(frozen=True, eq=False)
class RayField(Mask):
    """Mask with the amplitude w₀ + w₁ Ex + w₂ ξEx/R + w₃ Ey + w₄ ηEy/R, multiplied by the pupil's own mask.

    Ex and Ey are the field of the ray at the point (ξ, η) of the pupil, which has the radius R.

    beam: the light without this mask.
    axis: polarisation before the pupil, 0 (x) or 1 (y).
    weights: w₀ to w₄. All such masks share one compiled kernel, since only the weights differ.
    """

    beam: Beam
    axis: int
    weights: Weights
    _bare: Pupil = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_bare", replace(self.beam.pupil, mask=None))

    @property
    def pupil(self) -> Pupil:
        """The pupil of `beam`, with this `RayField` as its mask."""
        return replace(self.beam.pupil, mask=self)

    def amplitude(self, x: Array, y: Array, radius: Scalar) -> Array:
        along, before = (
            tuple(like(x, part) for part in vector) for vector in before_pupil(self.beam.source, self.axis)
        )
        ex, ey, _ = turned(before, along, rays_behind(self.beam, x, y))
        per = 1 / like(x, radius)
        one, of_x, of_xx, of_y, of_yy = (like(x, weight) for weight in self.weights)
        found = one + ex * (of_x + of_xx * x * per) + ey * (of_y + of_yy * y * per)
        own = self.beam.pupil.mask
        return found if own is None else found * own.amplitude(x, y, radius)

    def bandwidth(self, level: float, radius: float) -> float:
        """Return the spatial frequency [1/m] above which components of this `RayField` are below `level`.

        This bandwidth is a sum of up to three terms. The first is twice the bandwidth of the optical path through the
        pupil, because the field depends on products of the path's slopes. The second is the bandwidth of the mask in
        `beam.pupil`, if there is one. With a lens, the third is the bandwidth of the ray directions as functions of the
        distance from the axis. These functions have singularities at the imaginary distances ±i f₀, where f₀ is the
        focal length.
        """
        pupil, own = self.beam.pupil, self.beam.pupil.mask
        found = SPREAD * self._bare.bandwidth(self.beam.wavelength, level)
        found += 0.0 if own is None else own.bandwidth(level, radius)
        if pupil.thin_lens_focal_length is None:
            return found
        return found - math.log(min(level, 0.1)) / (2 * math.pi * abs(number(pupil.thin_lens_focal_length)))


def _product(one: Vector, other: Vector) -> Any:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
