"""Transmittance, at any point, of a soft-edged opening whose edge consists of straight pieces and arcs.

The opening is convolved with the kernel that `soft_edge` describes. The module `soft_polygon` explains the method for
straight pieces and defines the functions G and H of the kernel. Here, the method is extended to arcs.

Each piece of the edge contributes ∫ G(r) dθ to the transmittance at a point, where θ is the angle that the piece
subtends at the point, and r the distance of the piece from the point. For an arc of radius R, let d be the distance of
its centre from the point. Seen from the centre, t is the angle between the direction of the point and that of a
position on the arc. Within the kernel's reach, the integrand is

    H(r) (R - d cos t) R dt.

Beyond the reach, the contribution is the subtended angle divided by 2π.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import ceil, log10, pi

import numpy as np

from optics.apertures.aperture import SoftAperture
from optics.apertures.soft_edge import SoftEdge
from optics.apertures.soft_polygon import TINY, radial_table, sides_share
from optics.numerics.autodiff import Array
from optics.numerics.cost import SOFT_SIDE_SAMPLE
from optics.numerics.precision import Precision, opaque, padded_for_packets
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count

__all__ = ["SoftOutline"]

EMPTY = 1e-9  # [rad]: shorter arcs are treated as empty
MOST_OF_A_TURN = pi / 2  # choice: longest arc that one quadrature rule covers


@dataclass(frozen=True, eq=False)
class SoftOutline(SoftAperture):
    """An opening with straight and circular edges, convolved with a soft edge's kernel.

    segments: (n, 2, 2), straight pieces, with the opening on their left.
    arcs: (m, 6). Each has x and y of the centre, the radius, the first and the last angle [rad], and 1 if the opening
        lies on the side of the centre, else -1.
    """

    edge: SoftEdge
    segments: np.ndarray
    arcs: np.ndarray

    @property
    def seconds_per_point(self) -> float:
        return (len(self.segments) + 3 * len(_short(self.arcs))) * SOFT_SIDE_SAMPLE

    def transmittance(self, x: Array, y: Array, types: Precision) -> Array:
        import drjit as dr

        total = dr.zeros(types.Float64, max(dr.width(x), dr.width(y)))
        if len(self.segments):
            total += sides_share(self.edge, self.segments[:, 0], self.segments[:, 1], x, y, types)
        if len(self.arcs):
            total += _arcs_share(self.edge, _short(self.arcs), x, y, types)
        return total


def _short(arcs: np.ndarray) -> np.ndarray:
    """Split arcs into pieces of at most a quarter of a turn."""
    found = []
    for *circle, begin, end, side in arcs:
        parts = max(1, ceil((end - begin) / MOST_OF_A_TURN - 1e-9))
        at = np.linspace(begin, end, parts + 1)
        found += [(*circle, first, last, side) for first, last in itertools.pairwise(at)]
    return np.array(found, dtype=np.float64).reshape(-1, 6)


def _arcs_share(edge: SoftEdge, arcs: np.ndarray, x: Array, y: Array, types: Precision) -> Array:
    """Return the contribution of arcs to the transmittance at points (x, y); arcs as in `SoftOutline`."""
    import drjit as dr

    columns = [types.Float64(padded_for_packets(column)) for column in arcs.T]
    count = dr.opaque(types.Index, len(arcs))
    arc = _Arc(edge, types)

    def add(i: Array, total: Array, x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
        cx, cy, radius, begin, end, side = (dr.gather(types.Float64, column, i) for column in columns)
        return i + 1, total + side * arc.share(x - cx, y - cy, radius, begin, end), x, y

    width = max(dr.width(x), dr.width(y))
    state = dr.zeros(types.Index, width), dr.zeros(types.Float64, width), types.Float64(x), types.Float64(y)
    return dr.while_loop(state, lambda i, total, x, y: i < count, add, max_iterations=-1)[1]


class _Arc:
    """Contribution of an arc of an opening's edge to the transmittance of the soft-edged opening at points (x, y).

    Arcs run counterclockwise around their centre. The coordinates of the points are relative to the centre.
    """

    def __init__(self, edge: SoftEdge, types: Precision) -> None:
        import drjit as dr

        self.types = types
        self.reach = opaque(types, edge.reach)
        self.radial = radial_table(edge)
        # Within the reach, a quarter of a turn is at most π/2 times as long as its chord.
        nodes, weights = gauss_legendre(gauss_legendre_count(pi * edge.cycles, 1 - log10(edge.ripple)) + 4)
        self.nodes, self.weights = (types.Float64(padded_for_packets(each)) for each in (nodes, weights))
        self.count = dr.opaque(types.Index, len(nodes))

    def share(self, x: Array, y: Array, radius: Array, begin: Array, end: Array) -> Array:
        """Return the contribution of the arc from `begin` to `end` [rad] to the transmittance at points (x, y).

        The kernel that softens the edge covers a disc around each point. This disc covers a part of the arc's circle.
        The part is centred on the point's direction φ, seen from the centre of the circle, and has the half angle τ.

        Whole turns are added to φ until it lies between the arc's middle and one turn before the middle. The arc may
        then overlap the part around φ, the part around φ + 2π, or both.
        """
        import drjit as dr

        squared = x * x + y * y
        d = dr.sqrt(squared + TINY)
        phi = dr.atan2(y, x + TINY)
        middle = (begin + end) / 2
        phi = phi + 2 * pi * dr.round((middle - phi) / (2 * pi))
        phi = dr.select(phi > middle, phi - 2 * pi, phi)
        cosine = (radius * radius + squared - self.reach * self.reach) / (2 * radius * d)
        tau = dr.acos(dr.clip(cosine, -1, 1))
        near = (dr.clip(phi - tau, begin, end), dr.clip(phi + tau, begin, end))
        after = (dr.clip(phi + 2 * pi - tau, begin, end), dr.clip(phi + 2 * pi + tau, begin, end))
        total = dr.zeros(self.types.Float64, dr.width(x))
        for first, last in ((begin, near[0]), (near[1], after[0]), (after[1], end)):
            total += self._angle(x, y, radius, first, last) / (2 * pi)
        for first, last in (near, after):
            arguments = (x, y, radius, first, last, dr.zeros(self.types.Float64, dr.width(x)))
            total += dr.if_stmt(arguments, last > first, self._integral, lambda *arguments: arguments[-1])
        return total

    def _angle(self, x: Array, y: Array, radius: Array, first: Array, last: Array) -> Array:
        """Return the angle [rad] that the arc from `first` to `last` subtends at points (x, y).

        It is the angle of the chord, plus a full turn for points between chord and arc.
        """
        import drjit as dr

        (sin_a, cos_a), (sin_b, cos_b) = dr.sincos(first), dr.sincos(last)
        ax, ay, bx, by = radius * cos_a - x, radius * sin_a - y, radius * cos_b - x, radius * sin_b - y
        cross, dot = ax * by - ay * bx, ax * bx + ay * by
        # For an empty arc, `cross` is a rounding error, so no full turn may be added.
        between = (cross < 0) & (x * x + y * y < radius * radius) & (last - first > EMPTY)
        return dr.atan2(cross, dot + TINY) + dr.select(between, 2 * pi, 0)

    def _integral(self, x: Array, y: Array, radius: Array, first: Array, last: Array, zero: Array) -> Array:
        """Return ∫ H(r) (R - x cos t - y sin t) R dt along an arc of radius R.

        (x, y) is a point relative to the centre of the arc's circle. t is the angle [rad] of a position on the arc,
        from `first` to `last`, and r the distance of this position from (x, y). H is the function of `radial_table`.
        """
        import drjit as dr

        types = self.types

        def add(j: Array, total: Array, x: Array, y: Array, radius: Array, first: Array, last: Array) -> tuple:
            sin, cos = dr.sincos(first + (last - first) * dr.gather(types.Float64, self.nodes, j))
            outwards = radius - (x * cos + y * sin)
            distance = dr.sqrt(dr.square(radius * cos - x) + dr.square(radius * sin - y) + TINY)
            value = self.radial.at(distance, types) * outwards
            return j + 1, total + dr.gather(types.Float64, self.weights, j) * value, x, y, radius, first, last

        start = dr.zeros(types.Index, dr.width(x)), zero, x, y, radius, first, last
        total = dr.while_loop(start, lambda j, *_: j < self.count, add, max_iterations=-1)[1]
        return total * radius * (last - first)
