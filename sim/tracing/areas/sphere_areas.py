"""How much of an area a sphere fills, and which patch of the sphere that is.

A sphere's outline on the tangent plane is a conic. A few lines across the area are cut with it exactly; between them
it is taken as straight.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas.patch import Area, Patch
from sim.tracing.areas.stripes import Texture

STRIPS, PARTS = 2, 2  # chosen: cut with the outline
# Cosine below which a surface does not slope further away from the eye: beyond, its patch would be longer than the
# sphere.
GRAZING = 0.15
TINY = 1e-12


@dataclass(frozen=True)
class SphereTexture:
    """column = to_column @ (u, v, 1), of a texture along one axis · frame: from the sphere's axes to the world's."""

    texture: Texture
    to_column: np.ndarray
    frame: np.ndarray


@dataclass(frozen=True)
class Slice:
    """A sphere as an area sees it. share: of the area that it fills · patch: what is seen of it."""

    share: Array
    patch: Patch


@dataclass(frozen=True)
class _Chord:
    """Of the outline on one line across the area: its length and middle, in sides of the area."""

    length: Array
    middle: Array


class SphereView:
    """What an area sees of a sphere, in slices: STRIPS across it, cut to PARTS each."""

    count = STRIPS * PARTS

    def __init__(self, area: Area, centre: Array, radius: float) -> None:
        self._area, self._centre = area, centre
        self._way = way = centre - area.origin
        # Squared length of the lines that touch the sphere.
        self._tangent = tangent = dr.maximum(dr.squared_norm(way) - radius * radius, TINY)
        self._ahead = ahead = area.direction(0, 0)
        right, up = mi.Vector3f(area.right.x, area.right.y, 0), mi.Vector3f(0, 0, area.height)

        def slope(side: Array) -> Array:
            return dr.abs(dr.dot(way, ahead) * dr.dot(way, side) - tangent * dr.dot(ahead, side))

        upright = slope(right) <= slope(up)  # lines run towards the outline, so that they cut it steeply
        self._along, self._across = dr.select(upright, up, right), dr.select(upright, right, up)

    def slice(self, index: Array) -> Slice:
        """One of them."""
        strip = index // PARTS
        place: Array = (mi.Float(strip) + 0.5) / STRIPS - 0.5
        start = self._ahead + self._across * place
        chord = _chord(self._way, self._tangent, start, self._along)
        place = (mi.Float(index - strip * PARTS) + 0.5) / PARTS - 0.5
        seen = start + self._along * (chord.middle + chord.length * place)
        sides = self._along * (chord.length / PARTS), self._across / STRIPS
        patch = _patch(self._way, self._tangent, seen, *sides, self._area.origin, self._centre)
        return Slice(chord.length / self.count, patch)


def may_see(area: Area, centre: Array, radius: float) -> Array:
    """Whether an area might see a sphere: false where it surely does not."""
    way = centre - area.origin
    ahead = area.direction(0, 0)
    beside = dr.cross(way, ahead)
    along = dr.dot(way, ahead)
    # Tangent of the sphere's radius as seen from the area's middle, plus half of the area's diagonal, on its plane.
    half = dr.sqrt(dr.squared_norm(area.right) + dr.square(area.height)) / 2
    reach = radius * dr.norm(ahead) + half * dr.norm(way)
    return (dr.squared_norm(beside) < dr.square(reach)) & (along > -radius * dr.norm(ahead))


def columns_of(texture: SphereTexture, patch: Patch, radius: float) -> tuple[Array, tuple[Array, Array]]:
    """Where in the texture the middle of the patch is, and how many columns its sides span."""
    to_local = mi.Matrix3f(texture.frame.T.tolist())
    n, along, across = (to_local @ mi.Vector3f(v) for v in (patch.normal, patch.along, patch.across))
    per_u, per_v, at = map(float, texture.to_column)
    sine = dr.maximum(dr.square(n.x) + dr.square(n.y), 1e-4)  # squared, of the polar angle
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


def hidden_behind(shares: list[Array], distances: list[Array]) -> tuple[list[Array], Array]:
    """Share of the area in which each is seen before all others, and what is left for what stands behind them."""
    visible = []
    for k, (own, distance) in enumerate(zip(shares, distances, strict=True)):
        share = own
        for j, other in enumerate(shares):
            if j != k:
                share = share * dr.select(distances[j] < distance, 1 - other, 1)
        visible.append(share)
    return visible, 1 - sum(visible, mi.Float(0))


def _chord(way: Array, tangent: Array, start: Array, side: Array) -> _Chord:
    """Directions start + x side, |x| up to 1/2, meet the sphere where q2 x² + 2 q1 x + q0 > 0, ahead of the eye."""
    a, b = dr.dot(way, start), dr.dot(way, side)
    q2 = b * b - dr.squared_norm(side) * tangent
    q1 = a * b - dr.dot(start, side) * tangent
    q0 = a * a - dr.squared_norm(start) * tangent
    under = q1 * q1 - q2 * q0
    root, per = dr.sqrt(dr.maximum(under, 0)), dr.rcp(dr.select(dr.abs(q2) < TINY, TINY, q2))
    one, other = (-q1 - root) * per, (-q1 + root) * per
    low, high = dr.minimum(one, other), dr.maximum(one, other)
    # Where the sphere reaches beside the eye, the outline is open: from one of its branches on.
    open_, right = q2 > 0, b > 0
    low, high = (
        dr.select(open_, dr.select(right, high, -dr.inf), low),
        dr.select(open_, dr.select(right, dr.inf, low), high),
    )
    low, high = dr.clip(low, -0.5, 0.5), dr.clip(high, -0.5, 0.5)
    middle = (low + high) / 2
    ahead = (under > 0) & (dr.fma(b, middle, a) > 0)
    return _Chord(dr.select(ahead, high - low, 0), middle)


def _patch(way: Array, tangent: Array, seen: Array, along: Array, across: Array, origin: Array, centre: Array) -> Patch:
    """The patch around where a direction meets the sphere."""
    length = dr.squared_norm(seen)
    ahead = dr.dot(way, seen)
    t = (ahead - dr.sqrt(dr.maximum(ahead * ahead - length * tangent, 0))) / length
    point = mi.Point3f(origin + seen * t)
    normal = mi.Normal3f(dr.normalize(point - centre))
    facing = dr.minimum(dr.dot(normal, seen), -GRAZING * dr.sqrt(length))

    def onto(side: Array) -> Array:
        return t * (side - seen * (dr.dot(normal, side) / facing))

    return Patch(point, normal, onto(along), onto(across))
