"""The two kinds of area: a rectangle of the visual field, and the patch of a surface that is seen in it."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi

from optics.numerics.autodiff import Array


@dataclass(frozen=True)
class Area:
    """What a level eye sees in a rectangle of its tangent plane: along (ahead + a right, up + b height), |a| and |b| up
    to 1/2.

    origin: of the light's way back, the pupil (Point3f) · ahead, right: level parts (Vector2f), right is the
        rectangle's whole width · up, height: along z, of its middle and the whole of it
    """

    origin: Array
    ahead: Array
    right: Array
    up: Array
    height: Array

    def level(self, a: Array) -> Array:
        """The level part of the direction at a."""
        return self.ahead + self.right * a

    def direction(self, a: Array, b: Array) -> Array:
        """At (a, b), as long as it comes."""
        level = self.level(a)
        return mi.Vector3f(level.x, level.y, self.up + self.height * b)


@dataclass(frozen=True)
class Patch:
    """A parallelogram of a surface: point + a along + b across, |a| and |b| up to 1/2; normal: towards the eye."""

    point: Array
    normal: Array
    along: Array
    across: Array
