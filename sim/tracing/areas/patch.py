"""The two kinds of area, a rectangle of the visual field and the patch of a surface that is seen in it, and parts."""

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

    @classmethod
    def of(cls, middle: Array, axis: Array, extent: tuple[Array, Array]) -> Area:
        """Around a ray (not normalised: its part along the eye's axis is 1) of an eye with a level axis (Vector2f);
        extent: width and height on the tangent plane. Eyes are level: their x is level and their y upright."""
        width, height = extent
        right = mi.Vector2f(axis.y, -axis.x) * width
        return cls(middle.o, middle.d.xy, right, middle.d.z, mi.Float(height))

    def level(self, a: Array) -> Array:
        """The level part of the direction at a."""
        return self.ahead + self.right * a

    def direction(self, a: Array, b: Array) -> Array:
        """At (a, b), as long as it comes."""
        level = self.level(a)
        return mi.Vector3f(level.x, level.y, self.up + self.height * b)


@dataclass(frozen=True)
class Rectangle:
    """A part of an area, in its sides. a, b: its middle · width, height"""

    a: Array
    b: Array
    width: Array
    height: Array


@dataclass(frozen=True)
class Patch:
    """A parallelogram of a surface: point + a along + b across, |a| and |b| up to 1/2; normal: towards the eye."""

    point: Array
    normal: Array
    along: Array
    across: Array
