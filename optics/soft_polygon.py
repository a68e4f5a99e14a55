"""A polygon convolved with the soft edge's kernel, at any point.

The kernel's share within the triangle of a point and an edge is ∫ G(r) dθ over the angle θ under which the edge is
seen, G(r) = ∫₀^r g(r') r' dr' and r the distance to the edge. The polygon's transmittance is the sum over its edges
(angles, and so shares, are negative where the point lies outside an edge). With t along an edge at signed distance d,
G dθ = d H(r) dt, r² = d² + t², where H = G/r² is smooth; beyond the kernel's reach G = 1/2π, and angles are enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import log10, pi
from typing import Any

import numpy as np

from optics.aperture import SoftAperture
from optics.precision import Precision, opaque
from optics.quadrature import gauss_legendre, gauss_legendre_count
from optics.soft_edge import SoftEdge
from optics.table import Table

__all__ = ["SoftPolygon"]

# Squared length far below any that counts: keeps roots and angles differentiable on an edge or a corner.
TINY = 1e-40


@dataclass(frozen=True, eq=False)
class SoftPolygon(SoftAperture):
    """Vertices (n, 2), counterclockwise."""

    edge: SoftEdge
    vertices: np.ndarray

    def transmittance(self, x: Any, y: Any, types: Precision) -> Any:
        import drjit as dr

        along = np.roll(self.vertices, -1, axis=0) - self.vertices
        length = np.hypot(*along.T)
        columns = (*self.vertices.T, *(along / length[:, None]).T, length)
        sides = [types.Float64(np.ascontiguousarray(column)) for column in columns]
        count = dr.opaque(types.Index, len(length))
        chord = _Chord(self.edge, types)

        def add(i: Any, total: Any, x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
            x0, y0, tx, ty, length = (dr.gather(types.Float64, side, i) for side in sides)
            d = tx * (y - y0) - ty * (x - x0)
            start = -(tx * (x - x0) + ty * (y - y0))
            return i + 1, total + chord.share(d, start, start + length), x, y

        width = max(dr.width(x), dr.width(y))
        state = dr.zeros(types.Index, width), dr.zeros(types.Float64, width), types.Float64(x), types.Float64(y)
        return dr.while_loop(state, lambda i, total, x, y: i < count, add, max_iterations=-1)[1]


class _Chord:
    """What an edge at signed distance d, from `start` to `end` along its line, adds to the transmittance."""

    def __init__(self, edge: SoftEdge, types: Precision) -> None:
        self.types = types
        self.reach = opaque(types, edge.reach)
        self.radial, self.straight = _radial_table(edge), _straight_table(edge)
        nodes, weights = gauss_legendre(gauss_legendre_count(2 * edge.cycles, 2 - log10(edge.ripple)))
        self.nodes, self.weights = types.Float64(2 * nodes - 1), types.Float64(2 * weights)
        self.count = opaque_index(types, len(nodes))

    def share(self, d: Any, start: Any, end: Any) -> Any:
        import drjit as dr

        half = dr.sqrt(dr.maximum(self.reach * self.reach - d * d, TINY))
        near = dr.abs(d) < self.reach
        whole = near & (start < -half) & (end > half)
        part = near & ~whole & (start < half) & (end > -half)
        first, last = (dr.select(near, dr.clip(s, -half, half), 0) for s in (start, end))
        # Angles of what lies beyond the reach on either side, as the argument of a product. The whole chord comes from
        # a table in which the line goes on for ever: what it lacks there is taken off.
        d2 = d * d + TINY
        re, im = _times(d2 + start * first, d * (first - start), d2 + last * end, d * (end - last))
        beyond = dr.atan2(dr.select(whole, d * (start - end), im), dr.select(whole, -d2 - start * end, re)) / (2 * pi)
        zero = dr.zeros(self.types.Float64, dr.width(d))
        through = dr.if_stmt(
            (d, zero), whole, lambda d, zero: self.straight.at(d, self.types) - 0.5, lambda d, zero: zero
        )
        corner = dr.if_stmt((d, first, last, zero), part, self._integral, lambda d, first, last, zero: zero)
        return beyond + through + corner

    def _integral(self, d: Any, first: Any, last: Any, zero: Any) -> Any:
        """∫ d H(r) dt from first to last."""
        import drjit as dr

        types = self.types

        def add(j: Any, total: Any, d: Any, middle: Any, half: Any) -> tuple[Any, ...]:
            t = middle + half * dr.gather(types.Float64, self.nodes, j)
            value = self.radial.at(dr.sqrt(d * d + t * t + TINY), types)
            return j + 1, total + dr.gather(types.Float64, self.weights, j) * value, d, middle, half

        start = dr.zeros(types.Index, dr.width(d)), zero, d, (first + last) / 2, (last - first) / 2
        total = dr.while_loop(start, lambda j, *_: j < self.count, add, max_iterations=-1)[1]
        return total * d * (last - first) / 2


def opaque_index(types: Precision, value: int) -> Any:
    import drjit as dr

    return dr.opaque(types.Index, value)


def _times(a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
    """(a + ib)(c + id)."""
    return a * c - b * d, a * d + b * c


@lru_cache(maxsize=64)
def _radial_table(edge: SoftEdge) -> Table:
    """H(r) = G(r)/r², G = ∫₀^r g(r') r' dr'."""
    u, weight = gauss_legendre(int(24 + 4 * edge.cycles + edge.beta))

    def mean(r: np.ndarray) -> np.ndarray:
        r = np.maximum(np.abs(r), 1e-9 * edge.reach)
        within = np.minimum(r, edge.reach)
        return np.asarray(edge.ring(np.outer(within, u)) @ weight * within / (2 * pi * r**2))

    # A little further than the reach, whence the interpolation's outermost samples come.
    return Table.of(mean, (-1.1 * edge.reach, 1.1 * edge.reach), 2.2 * edge.cycles, edge.ripple / 4)


@lru_cache(maxsize=64)
def _straight_table(edge: SoftEdge) -> Table:
    """Transmittance at a distance d inside a half-plane: 1 - ∫ g(r) r 2 arccos(d/r) dr from d to the reach."""
    u, weight = gauss_legendre(int(24 + 4 * edge.cycles + 2 * edge.beta))

    def inside(d: np.ndarray) -> np.ndarray:
        depth = np.abs(d)[:, None]
        r = depth + (edge.reach - depth) * np.sin(pi * u / 2) ** 2
        jacobian = (edge.reach - depth) * np.sin(pi * u) * pi / 2
        beyond = (jacobian * edge.ring(r) * np.arccos(np.clip(depth / r, 0, 1)) / pi) @ weight
        return np.where(d < 0, beyond, 1 - beyond)

    return Table.of(inside, (-edge.reach, edge.reach), 2 * edge.cycles, edge.ripple / 4)
