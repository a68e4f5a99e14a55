"""Light sources: a point at some distance, or a plane wave."""

from __future__ import annotations

import math
from dataclasses import dataclass

from optics.numerics.arguments import in_range, pair, positive, without_derivative
from optics.numerics.array_library import library, like
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number

__all__ = ["PointSource"]

STEEPEST = 1.5  # choice [rad]: largest angle of the light to the axis


@dataclass(frozen=True)
class PointSource:
    """A point source. Its wave on the pupil is exp(ik(ρ(x, y) - ρ(0, 0))), where ρ is the distance from the source.

    distance: distance [m] in front of the pupil, along the axis. An infinite distance gives a plane wave, and ρ is then
        measured along the direction in which the wave travels.
    angle: (θx, θy) [rad], the direction in which the light travels at the pupil's centre. A thin lens of focal length f
        focuses parallel light near the point x = f tan θx, y = f tan θy. The focus has the off-axis aberrations of a
        single stigmatic lens.

    The distance and the angles may carry derivatives.

    Raises:
        ValueError: the distance is not positive, or an angle is outside [-1.5, 1.5].
    """

    distance: Scalar = math.inf
    angle: tuple[Scalar, Scalar] = (0.0, 0.0)

    def __post_init__(self) -> None:
        positive("source_distance", self.distance, infinite=True, carried=True)
        kept = []
        for angle in pair("source_angle", self.angle, "angles (x, y) [rad]"):
            value = in_range("source_angle", angle, -STEEPEST, STEEPEST, carried=True)
            kept.append(angle if is_differentiable(angle) else value)
        object.__setattr__(self, "angle", tuple(kept))

    @property
    def plain(self) -> PointSource:
        """The same source without derivatives."""
        if all(type(part) is float for part in (self.distance, *self.angle)):
            return self
        x, y = map(number, self.angle)
        return PointSource(number(self.distance), (x, y))

    def require_plain(self) -> PointSource:
        """Return the same source without Dr.Jit arrays.

        Raises:
            ValueError: a number carries a derivative.
        """
        without_derivative("source", (self.distance, *self.angle))
        return self.plain

    def path(self, x: Array, y: Array) -> Array:
        """Return the optical path [m] in vacuum at points (x, y) [m] of the pupil, relative to the centre.

        x, y: arrays of NumPy or PyTorch whose shapes broadcast, or flat Float64 arrays of Dr.Jit.
        """
        carried = any(map(is_differentiable, self.angle))
        own, angle = (library(x), [like(x, part) for part in self.angle]) if carried else (math, self.angle)
        tx, ty = map(own.tan, angle)
        norm = own.sqrt(1 + tx * tx + ty * ty)
        along = x * like(x, tx / norm) + y * like(x, ty / norm)
        if math.isinf(number(self.distance)):
            return along
        centre = like(x, self.distance) * norm
        # The form ρ - ρ₀ = (r² + 2 ρ₀ (x, y)·t) / (ρ + ρ₀) avoids a difference of nearly equal numbers.
        excess = x * x + y * y + 2 * centre * along
        rho = library(x).sqrt(excess + centre * centre)
        return excess / (rho + centre)
