"""Regions over which light is averaged: an area of the visual field, and a patch of a surface."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi

from optics.numerics.autodiff import Array


@dataclass(frozen=True)
class Area:
    """A rectangle on the tangent plane of an upright eye.

    A point of the rectangle has a horizontal position a and a vertical position b, which run from -1/2 to 1/2. The
    direction to the point has the horizontal part ahead + a · right and the vertical part up + b · height.

    origin: the pupil (Point3f)
    ahead, up: horizontal part (Vector2f) and vertical part of the direction to the rectangle's middle
    right, height: horizontal vector from the rectangle's left to its right border (Vector2f), and full height
    """

    origin: Array
    ahead: Array
    right: Array
    up: Array
    height: Array

    @classmethod
    def from_extent(cls, middle: Array, axis: Array, extent: tuple[Array, Array]) -> Area:
        """Return a rectangle around a ray, on the tangent plane of an eye whose axis is horizontal.

        The rectangle's width is horizontal, and its height is vertical.

        middle: ray to the middle of the rectangle; its direction has the component 1 along the eye's axis
        axis: horizontal axis of the eye, a unit vector (Vector2f)
        extent: width and height on the eye's tangent plane, which is at the distance 1
        """
        width, height = extent
        right = mi.Vector2f(axis.y, -axis.x) * width
        return cls(middle.o, middle.d.xy, right, middle.d.z, mi.Float(height))

    def level(self, a: Array) -> Array:
        """Return the horizontal part (Vector2f) of directions to points at one horizontal position (-1/2 to 1/2)."""
        return self.ahead + self.right * a

    def direction(self, a: Array, b: Array) -> Array:
        """Return the direction (Vector3f), not normalised, at the position (a, b) of the area, see the class."""
        level = self.level(a)
        return mi.Vector3f(level.x, level.y, self.up + self.height * b)


@dataclass(frozen=True)
class Rectangle:
    """A part of an area, in units of the area's sides.

    a, b: middle of the part
    """

    a: Array
    b: Array
    width: Array
    height: Array


@dataclass(frozen=True)
class Patch:
    """A parallelogram of a surface: point + a along + b across, |a|, |b| up to 1/2. The normal is on the eye's side."""

    point: Array
    normal: Array
    along: Array
    across: Array
