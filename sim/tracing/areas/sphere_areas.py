"""The part of a sphere that is visible in an area of the visual field (`patch.Area`), and the fraction that it fills.

A sphere's outline on the tangent plane is a conic. Strips of the region inside it are treated as parallelograms. In an
ellipse, the parallelogram is as long as the mean chord of the strip. It then has exactly the strip's size, unless the
area's border cuts the chord. In other outlines, the parallelogram is as long as the middle chord.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas.half_planes import share_above
from sim.tracing.areas.patch import Area, Patch, Rectangle
from sim.tracing.areas.stripes import Texture

# Chosen: number of strips across the visible part of a sphere, and of slices in each strip. Wide areas have more,
# because otherwise they would have to be divided into smaller areas (docs/measurements/rendering.md#area-sampling).
SIDES, SIDES_OF_WIDE = 3, 4
WIDE = 0.0555  # width of a wide area on the plane at distance 1: 3.2 degrees
# Smallest cosine between a surface's normal and the direction to the eye. Smaller ones would make its patch longer than
# the sphere.
GRAZING = 0.15
TINY = 1e-12
NEARLY_OPEN = 1e-4  # chosen: outlines whose length exceeds about 100 times their width are treated as open


@dataclass(frozen=True)
class SphereTexture:
    """A sphere's texture, which changes along one axis.

    texture: the texture's number of columns, and the index of its first texel in the tables of all textures
    to_column: map from texture coordinates to a column of the texture: column = to_column @ (u, v, 1)
    frame: rotation from the sphere's axes to the world's, (3, 3)
    """

    texture: Texture
    to_column: np.ndarray
    frame: np.ndarray


@dataclass(frozen=True)
class Slice:
    """A slice of a sphere, as the eye sees it in one area. The area is a rectangle on the eye's tangent plane.

    share, seen: fraction of the area that the slice fills, and direction from the eye to the slice's middle
    along, across: sides of the slice on the tangent plane
    patch: part of the sphere's surface in the slice
    """

    share: Array
    seen: Array
    along: Array
    across: Array
    patch: Patch

    def inverse_distance(self, area: Area) -> Array:
        """Return 1/z [1/m], where z is the distance of the slice along the eye's axis."""
        found: Array = dr.norm(self.seen) * dr.rcp(dr.norm(self.patch.point - area.origin))
        return found


@dataclass(frozen=True)
class Strip(Slice):
    """A strip of a sphere's visible part: a row of slices, treated as one slice.

    part: rectangle that approximates the strip, in units of the sides of the area in which the eye sees the sphere
    """

    part: Rectangle


class SphereView:
    """The part of a sphere in one area of the visual field. It is divided into strips, and each strip into slices.

    sides: number of strips, which is also the number of slices in each strip
    """

    def __init__(self, area: Area, centre: Array, radius: float) -> None:
        self._area, self._centre = area, centre
        self._way = way = centre - area.origin
        # Squared length of the tangents from the eye to the sphere.
        self._tangent = tangent = dr.maximum(dr.squared_norm(way) - radius * radius, TINY)
        self._ahead = ahead = area.direction(0, 0)
        right, up = mi.Vector3f(area.right.x, area.right.y, 0), mi.Vector3f(0, 0, area.height)

        def slope(side: Array) -> Array:
            return dr.abs(dr.dot(way, ahead) * dr.dot(way, side) - tangent * dr.dot(ahead, side))

        # The lines across the area have the direction in which they cut the outline at the steeper angle.
        self._upright = upright = slope(right) <= slope(up)
        self._along, self._across = dr.select(upright, up, right), dr.select(upright, right, up)
        self._outline = _outline(way, radius, ahead, self._along, self._across)
        self.sides = dr.select(dr.norm(area.right) > WIDE, mi.UInt32(SIDES_OF_WIDE), mi.UInt32(SIDES))

    def whole(self) -> Strip:
        """Return the sphere's whole visible part, undivided, as one `Strip`."""
        return self._between(mi.Float(0), mi.Float(1))

    def strip(self, number: Array) -> Strip:
        """Return the strip with this index."""
        per = dr.rcp(mi.Float(self.sides))
        return self._between(mi.Float(number) * per, (mi.Float(number) + 1) * per)

    def _between(self, low: Array, high: Array) -> Strip:
        """Return the strip between two edges, given as positions from 0 to 1 across the sphere's visible part."""
        outline = self._outline
        one, other = outline.edge(low), outline.edge(high)
        place, width = (one.place + other.place) / 2, other.place - one.place
        cut = _chord(self._way, self._tangent, self._ahead + self._across * place, self._along)
        chord = outline.mean_chord(one, other)
        length, middle = (dr.select(outline.closed, mean, open_) for mean, open_ in zip(chord, cut, strict=True))
        seen = self._ahead + self._across * place + self._along * middle
        sides = self._along * length, self._across * width
        upright = Rectangle(place, middle, width, length), Rectangle(middle, place, length, width)
        return Strip(length * width, seen, *sides, self._patch(seen, *sides), dr.select(self._upright, *upright))

    def slice(self, strip: Strip, number: Array) -> Slice:
        """Return one slice of a strip, given the index of the slice."""
        per = dr.rcp(mi.Float(self.sides))
        seen = strip.seen + strip.along * ((mi.Float(number) + 0.5) * per - 0.5)
        sides = strip.along * per, strip.across
        return Slice(strip.share * per, seen, *sides, self._patch(seen, *sides))

    def _patch(self, seen: Array, along: Array, across: Array) -> Patch:
        return _patch(self._way, self._tangent, seen, along, across, self._area.origin, self._centre)


@dataclass(frozen=True)
class _Edge:
    """An edge of a strip: a straight line across the area in which a sphere is seen. The area is a rectangle.

    place: position of the line in the area, from -1/2 at one border to 1/2 at the opposite one
    angle, sine: for an elliptic outline, an angle and its sine: sine = (place - middle[0]) / half[0], see `_Outline`
    """

    place: Array
    angle: Array
    sine: Array


@dataclass(frozen=True)
class _Outline:
    """A sphere's outline in a rectangular area of the eye's tangent plane, where x and y are from -1/2 to 1/2.

    closed: True if the outline is an ellipse. The other fields describe this ellipse.
    middle: x and y of the ellipse's middle
    half: half of the ellipse's extent along x, and half the length of the chord parallel to y through its middle
    slant: slope dy/dx of the line on which the middles of all chords parallel to y lie (0: ellipse is not tilted)
    low, high: values of `_Edge.angle` at the lowest and the highest x of the ellipse's part in the area
    """

    closed: Array
    middle: tuple[Array, Array]
    half: tuple[Array, Array]
    slant: Array
    low: Array
    high: Array

    def edge(self, share: Array) -> _Edge:
        """Return the line at a position across a sphere's visible part. `share` is the position, from 0 to 1.

        For an ellipse, the line's `angle` is linear in `share`. For other outlines, its `place` is linear in `share`.
        """
        angle = dr.fma(self.high - self.low, share, self.low)
        sine = dr.sin(angle)
        place = dr.select(self.closed, dr.fma(self.half[0], sine, self.middle[0]), share - 0.5)
        return _Edge(dr.clip(place, -0.5, 0.5), angle, sine)

    def mean_chord(self, one: _Edge, other: _Edge) -> tuple[Array, Array]:
        """Return length and middle of the ellipse's mean chord in a strip. The area's border may cut this chord.

        If it does not, the length times the strip's width is exactly the size of the ellipse's part in the strip.
        """
        double = other.sine * dr.cos(other.angle) - one.sine * dr.cos(one.angle)
        mean = (other.angle - one.angle + double) / (2 * dr.maximum(other.sine - one.sine, TINY))
        middle = self.middle[1] + self.slant * ((one.place + other.place) / 2 - self.middle[0])
        low, high = (dr.clip(middle + sign * mean * self.half[1], -0.5, 0.5) for sign in (-1, 1))
        return high - low, (low + high) / 2


def _outline(way: Array, radius: float, ahead: Array, along: Array, across: Array) -> _Outline:
    """Return the outline of the sphere with its centre at `way` from the eye.

    A direction v = ahead + x across + y along hits the sphere if |way × v|² < radius² |v|² and way · v > 0. The outline
    is in units of x and y, which are from -1/2 to 1/2 in the area in which the sphere is seen.
    """
    x, y, z = (dr.cross(way, v) for v in (across, along, ahead))
    square = radius * radius

    def form(a: Array, b: Array, v: Array, w: Array) -> Array:
        return dr.dot(a, b) - square * dr.dot(v, w)

    xx, xy, yy = form(x, x, across, across), form(x, y, across, along), form(y, y, along, along)
    xz, yz = form(x, z, across, ahead), form(y, z, along, ahead)
    det = xx * yy - xy * xy
    per = dr.rcp(dr.select(dr.abs(det) < TINY * TINY, TINY * TINY, det))
    middle = (xy * yz - yy * xz) * per, (xy * xz - xx * yz) * per
    inside = -(form(z, z, ahead, ahead) + xz * middle[0] + yz * middle[1])
    half = dr.safe_sqrt(yy * inside * per), dr.safe_sqrt(inside / yy)
    closed = (yy > 0) & (det > NEARLY_OPEN * xx * yy) & (inside > 0)
    low, high = (dr.asin(dr.clip((end - middle[0]) / dr.maximum(half[0], TINY), -1, 1)) for end in (-0.5, 0.5))
    ahead_of_it = dr.dot(way, ahead + across * middle[0] + along * middle[1]) > 0
    half = dr.select(ahead_of_it, half[0], 0), dr.select(ahead_of_it, half[1], 0)
    return _Outline(closed, middle, half, -xy / yy, low, high)


def may_see(area: Area, centre: Array, radius: float) -> Array:
    """Return whether a sphere may be visible in an area of the visual field; False only if it certainly is not."""
    way = centre - area.origin
    ahead = area.direction(0, 0)
    beside = dr.cross(way, ahead)
    along = dr.dot(way, ahead)
    # Tangent of the sphere's angular radius, plus half of the area's diagonal on the tangent plane.
    half = dr.sqrt(dr.squared_norm(area.right) + dr.square(area.height)) / 2
    reach = radius * dr.norm(ahead) + half * dr.norm(way)
    return (dr.squared_norm(beside) < dr.square(reach)) & (along > -radius * dr.norm(ahead))


def columns_of(texture: SphereTexture, patch: Patch, radius: float) -> tuple[Array, tuple[Array, Array]]:
    """Return the texture column at a patch's middle, and the numbers of columns that its two sides span."""
    to_local = mi.Matrix3f(texture.frame.T.tolist())
    n, along, across = (to_local @ mi.Vector3f(v) for v in (patch.normal, patch.along, patch.across))
    per_u, per_v, at = map(float, texture.to_column)
    sine = dr.maximum(dr.square(n.x) + dr.square(n.y), 1e-4)  # squared sine of the polar angle
    column, slopes = mi.Float(at), [mi.Float(0), mi.Float(0)]
    if per_u:
        u = dr.atan2(n.y, n.x) * dr.inv_two_pi
        column += per_u * dr.select(u < 0, u + 1, u)
        scale = per_u * dr.inv_two_pi / (radius * sine)
        slopes = [s + (n.x * e.y - n.y * e.x) * scale for s, e in zip(slopes, (along, across), strict=True)]
    if per_v:
        column += per_v * dr.safe_acos(n.z) * dr.inv_pi
        scale = -per_v * dr.inv_pi / radius * dr.rsqrt(sine)
        slopes = [s + e.z * scale for s, e in zip(slopes, (along, across), strict=True)]
    return column, (slopes[0], slopes[1])


def hidden_by(way: Array, radius: Array, slice_: Slice) -> Array:
    """Return the fraction of a sphere's slice that a second sphere hides. The latter's outline is treated as straight.

    way, radius: vector from the eye to the hiding sphere's centre, and radius of the hiding sphere [m]
    """
    seen, sides = slice_.seen, (slice_.along, slice_.across)
    length, moment = dr.norm(seen), dr.cross(way, seen)
    beside = dr.maximum(dr.norm(moment), TINY)
    slopes = (radius * dr.dot(seen, side) / length - dr.dot(moment, dr.cross(way, side)) / beside for side in sides)
    return dr.select(dr.dot(way, seen) > 0, share_above(radius * length - beside, *slopes), 0)


def _chord(way: Array, tangent: Array, start: Array, side: Array) -> tuple[Array, Array]:
    """Return length and middle of the part of a line that is inside a sphere's outline, in units of the line's length.

    The sphere covers v = start + x · side if way · v > 0 and (way · v)² - tangent |v|² = q2 x² + 2 q1 x + q0 > 0.

    way, tangent: vector from the eye to the sphere's centre, and |way|² minus the squared radius of the sphere
    start, side: vectors from the eye to the line's middle, and along the whole line; x is from -1/2 to 1/2
    """
    a, b = dr.dot(way, start), dr.dot(way, side)
    q2 = b * b - dr.squared_norm(side) * tangent
    q1 = a * b - dr.dot(start, side) * tangent
    q0 = a * a - dr.squared_norm(start) * tangent
    under = q1 * q1 - q2 * q0
    root, per = dr.sqrt(dr.maximum(under, 0)), dr.rcp(dr.select(dr.abs(q2) < TINY, TINY, q2))
    one, other = (-q1 - root) * per, (-q1 + root) * per
    low, high = dr.minimum(one, other), dr.maximum(one, other)
    # If the sphere reaches to the side of the eye, the outline is open, and the chord starts at one of its branches.
    open_, right = q2 > 0, b > 0
    low, high = (
        dr.select(open_, dr.select(right, high, -dr.inf), low),
        dr.select(open_, dr.select(right, dr.inf, low), high),
    )
    low, high = dr.clip(low, -0.5, 0.5), dr.clip(high, -0.5, 0.5)
    middle = (low + high) / 2
    ahead = (under > 0) & (dr.fma(b, middle, a) > 0)
    return dr.select(ahead, high - low, 0), middle


def _patch(way: Array, tangent: Array, seen: Array, along: Array, across: Array, origin: Array, centre: Array) -> Patch:
    """Return the patch of a sphere's surface that the eye sees around the direction `seen`.

    way, tangent: vector from the eye to the sphere's centre, and |way|² minus the squared radius of the sphere
    along, across: sides of the patch's outline, a parallelogram, on the eye's tangent plane
    origin, centre: positions of the eye's pupil and of the sphere's centre
    """
    length = dr.squared_norm(seen)
    ahead = dr.dot(way, seen)
    t = (ahead - dr.sqrt(dr.maximum(ahead * ahead - length * tangent, 0))) / length
    point = mi.Point3f(origin + seen * t)
    normal = mi.Normal3f(dr.normalize(point - centre))
    facing = dr.minimum(dr.dot(normal, seen), -GRAZING * dr.sqrt(length))

    def onto(side: Array) -> Array:
        return t * (side - seen * (dr.dot(normal, side) / facing))

    return Patch(point, normal, onto(along), onto(across))
