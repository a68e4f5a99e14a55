"""Intersections of rays with MuJoCo's primitives, such as boxes and capsules, where a ray enters them from outside.

Rays are given in the frame of the geom that is the primitive. Only the outer side of a geom's surface is visible,
except for planes. As in MuJoCo's rendering, an eye inside a geom therefore sees through the geom's surface. Distances
are multiples of the direction's length, and infinite for a miss. Roots are computed relative to the point at which the
ray is nearest to the geom's centre or axis, so that hits of small or distant geoms are accurate in float32.

Scenes that consist of upright walls and spheres are intersected by other modules (`sim.tracing.spheres`,
`sim.tracing.wall_intersection`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.scene.primitive_geoms import PLANE

TINY = 1e-20
# A ray counts as parallel to a surface, and misses it, if the component of its unit direction across the surface is
# smaller than this value.
PARALLEL = 1e-9


@dataclass(frozen=True)
class Primitive:
    """Functions for one kind of primitive, which all receive MuJoCo's sizes (`size`).

    hit: (origin, direction, size) -> distance; infinite for a miss
    normal: (point, size) -> outward normal, not normalised
    """

    hit: Callable[[Array, Array, Array], Array]
    normal: Callable[[Array, Array], Array]


def _into_ball(o: Array, d: Array) -> Array:
    """Return t for which o + t d enters the unit ball; infinite if the ray starts inside or does not hit."""
    square = dr.squared_norm(d)
    nearest = -dr.dot(o, d) / square
    p = dr.fma(d, nearest, o)
    inside = 1 - dr.squared_norm(p)
    t = nearest - dr.sqrt(dr.maximum(inside, 0) / square)
    return dr.select((inside > 0) & (t > 0), t, dr.inf)


def _ellipsoid_hit(o: Array, d: Array, size: Array) -> Array:
    return _into_ball(o / size, d / size)


def _ellipsoid_normal(p: Array, size: Array) -> Array:
    return p / (size * size)


def _into_side(o: Array, d: Array, radius: Array) -> Array:
    """Return the distance at which a ray from o along d enters an endless cylinder around z; infinite without entry."""
    square = dr.maximum(d.x * d.x + d.y * d.y, TINY)
    nearest = -(o.x * d.x + o.y * d.y) / square
    x, y = dr.fma(d.x, nearest, o.x), dr.fma(d.y, nearest, o.y)
    inside = radius * radius - x * x - y * y
    t = nearest - dr.sqrt(dr.maximum(inside, 0) / square)
    return dr.select((inside > 0) & (t > 0) & (square > PARALLEL * PARALLEL), t, dr.inf)


def _capsule_hit(o: Array, d: Array, size: Array) -> Array:
    radius, half = size.x, size.y
    side = _into_side(o, d, radius)
    side = dr.select(dr.abs(dr.fma(d.z, side, o.z)) <= half, side, dr.inf)
    found = side
    for sign in (-1, 1):
        end = mi.Vector3f(0, 0, sign * half)
        ball = _into_ball((o - end) / radius, d / radius)
        beyond = sign * dr.fma(d.z, ball, o.z) > half
        found = dr.minimum(found, dr.select(dr.isfinite(ball) & beyond, ball, dr.inf))
    return found


def _capsule_normal(p: Array, size: Array) -> Array:
    return mi.Vector3f(p.x, p.y, p.z - dr.clip(p.z, -size.y, size.y))


def _cylinder_hit(o: Array, d: Array, size: Array) -> Array:
    radius, half = size.x, size.y
    side = _into_side(o, d, radius)
    side = dr.select(dr.abs(dr.fma(d.z, side, o.z)) <= half, side, dr.inf)
    end = -(dr.copysign(half, d.z) + o.z) / dr.select(dr.abs(d.z) < PARALLEL, PARALLEL, d.z)
    x, y = dr.fma(d.x, end, o.x), dr.fma(d.y, end, o.y)
    on_end = (end > 0) & (x * x + y * y <= radius * radius) & (dr.abs(d.z) >= PARALLEL)
    return dr.minimum(side, dr.select(on_end, end, dr.inf))


def _cylinder_normal(p: Array, size: Array) -> Array:
    beside: Array = dr.sqrt(p.x * p.x + p.y * p.y)
    on_end: Array = size.x * dr.abs(p.z) - size.y * beside > 0
    return dr.select(on_end, mi.Vector3f(0, 0, p.z), mi.Vector3f(p.x, p.y, 0))


def _box_hit(o: Array, d: Array, size: Array) -> Array:
    length: Array = dr.abs(d)
    steep: Array = dr.select(length < TINY, TINY, d)
    middle, reach = -o / steep, size / dr.abs(steep)
    enters: Array = dr.max(middle - reach)
    leaves: Array = dr.min(middle + reach)
    return dr.select((enters < leaves) & (enters > 0), enters, dr.inf)


def _box_normal(p: Array, size: Array) -> Array:
    q = p / size
    away = dr.abs(q)
    most = dr.max(away)
    x: Array = away.x == most
    y: Array = ~x & (away.y == most)
    return mi.Vector3f(dr.select(x, q.x, 0), dr.select(y, q.y, 0), dr.select(x | y, 0, q.z))


def _plane_hit(o: Array, d: Array, size: Array) -> Array:
    """Return the distance from o along d to a plane, both sides of which are visible; infinite for a miss."""
    t = -o.z / dr.select(dr.abs(d.z) < PARALLEL, PARALLEL, d.z)
    x, y = dr.fma(d.x, t, o.x), dr.fma(d.y, t, o.y)
    on_plane = (t > 0) & (dr.abs(d.z) >= PARALLEL) & (dr.abs(x) <= size.x) & (dr.abs(y) <= size.y)
    return dr.select(on_plane, t, dr.inf)


def _plane_normal(p: Array, size: Array) -> Array:
    return mi.Vector3f(0, 0, 1)


# Primitives by name. Movers are sorted by kind in this order. Spheres are ellipsoids.
PRIMITIVES = {
    "ellipsoid": Primitive(_ellipsoid_hit, _ellipsoid_normal),
    "capsule": Primitive(_capsule_hit, _capsule_normal),
    "cylinder": Primitive(_cylinder_hit, _cylinder_normal),
    "box": Primitive(_box_hit, _box_normal),
    PLANE: Primitive(_plane_hit, _plane_normal),
}
