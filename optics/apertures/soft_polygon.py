"""Transmittance of a polygon with a soft edge, at any point. The polygon is convolved with the kernel of the edge.

Consider the triangle of a point and an edge. The integral of the kernel g over this triangle is

    ∫ G(r) dθ,   G(r) = ∫₀^r g(r') r' dr',

where θ runs over the angle that the edge subtends, and r is the distance from the point to the edge in the direction θ.
The polygon's transmittance is the sum of these integrals over its edges. If the point lies on the outer side of an
edge, the angle θ, and therefore the edge's integral, counts as negative. Let d be the signed distance of an edge from
the point, and t the position along the edge from the foot of the perpendicular. Then

    G dθ = d H(r) dt,   r² = d² + t²,

where H = G/r² is smooth. Beyond the kernel's reach G = 1/2π, so the integral depends only on the angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log10, pi

import numpy as np

from optics.apertures.aperture import SoftAperture
from optics.apertures.soft_edge import SoftEdge
from optics.numerics.autodiff import Array
from optics.numerics.cost import SOFT_SIDE_SAMPLE
from optics.numerics.interpolation import Interpolant
from optics.numerics.precision import Precision, opaque, padded_for_packets
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count

__all__ = ["TINY", "SoftPolygon", "radial_table", "sides_share"]

# Squared length, far below all relevant ones. Adding it keeps roots and angles differentiable on an edge or a corner.
TINY = 1e-40


@dataclass(frozen=True, eq=False)
class SoftPolygon(SoftAperture):
    """A polygon with a soft edge; vertices (n, 2), counterclockwise."""

    edge: SoftEdge
    vertices: np.ndarray

    @property
    def seconds_per_point(self) -> float:
        return len(self.vertices) * SOFT_SIDE_SAMPLE

    def transmittance(self, x: Array, y: Array, types: Precision) -> Array:
        return sides_share(self.edge, self.vertices, np.roll(self.vertices, -1, axis=0), x, y, types)


def sides_share(edge: SoftEdge, starts: np.ndarray, ends: np.ndarray, x: Array, y: Array, types: Precision) -> Array:
    """Return the contribution of straight pieces of an opening's edge to its transmittance at points (x, y).

    The opening is convolved with the kernel `edge`.

    starts, ends: both ends of each piece, with the opening on the left of the way from start to end, arrays (piece, 2).
    """
    import drjit as dr

    along = ends - starts
    length = np.hypot(*along.T)
    columns = (*starts.T, *(along / length[:, None]).T, length)
    sides = [types.Float64(padded_for_packets(column)) for column in columns]
    count = dr.opaque(types.Index, len(length))
    line = _Line(edge, types)

    def add(i: Array, total: Array, x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
        x0, y0, tx, ty, length = (dr.gather(types.Float64, side, i) for side in sides)
        d = tx * (y - y0) - ty * (x - x0)
        start = -(tx * (x - x0) + ty * (y - y0))
        return i + 1, total + line.between(d, start, start + length), x, y

    width = max(dr.width(x), dr.width(y))
    state = dr.zeros(types.Index, width), dr.zeros(types.Float64, width), types.Float64(x), types.Float64(y)
    return dr.while_loop(state, lambda i, total, x, y: i < count, add, max_iterations=-1)[1]


class _Line:
    """Contribution of a piece of a straight edge to the transmittance of a soft-edged opening at a point.

    The contribution W(d, s) depends on two lengths. The piece begins at the foot of the perpendicular from the point to
    the edge, and ends at a distance s along the edge. d is the signed length of the perpendicular, positive if the
    point lies on the inner side.

    The kernel that softens the edge covers a disc around the point. If the line of the edge misses this disc, W is the
    angle that the piece subtends at the point, divided by 2π. Otherwise, W depends on the end of the piece. If the
    piece ends within the disc, W is the integral ∫ d H(r) dt, where t runs from 0 to s, r² = d² + t², and H is the
    function that `radial_table` tabulates. If it ends outside the disc, consider the infinite half-line that begins at
    the foot and contains the piece. The half-line contributes (T(d) - 1/2)/2, where T is the transmittance of a
    soft-edged half-plane. T depends only on d and is tabulated. The rest of the half-line, beyond the end of the piece,
    subtends an angle α at the point. W is the contribution of the half-line minus α/(2π).
    """

    def __init__(self, edge: SoftEdge, types: Precision) -> None:
        import drjit as dr

        self.types = types
        self.reach = opaque(types, edge.reach)
        self.radial, self.straight = radial_table(edge), _straight_table(edge)
        # H is even in t, so half the nodes of an even rule from -s to s are enough.
        nodes, weights = gauss_legendre(2 * ceil(gauss_legendre_count(2 * edge.cycles, -log10(edge.ripple)) / 2))
        half = len(nodes) // 2
        self.nodes, self.weights = (
            types.Float64(padded_for_packets(each)) for each in (2 * nodes[half:] - 1, 2 * weights[half:])
        )
        self.count = dr.opaque(types.Index, half)

    def between(self, d: Array, start: Array, end: Array) -> Array:
        """Return the contribution of a piece of a straight edge to the transmittance at points.

        d: signed distance of the line from each point, positive if the point lies on the inner side.
        start, end: ends of the piece, as positions along the line, measured from the foot of the perpendicular from
            each point.
        """
        import drjit as dr

        near = dr.abs(d) < self.reach
        half = dr.sqrt(dr.maximum(self.reach * self.reach - d * d, TINY))
        zero = dr.zeros(self.types.Float64, dr.width(d))
        chord = dr.if_stmt((d, zero), near, lambda d, zero: self.straight.at(d, self.types) / 2 - 0.25, _nothing)
        return self._to(end, d, near, half, chord, zero) - self._to(start, d, near, half, chord, zero)

    def _to(self, s: Array, d: Array, near: Array, half: Array, chord: Array, zero: Array) -> Array:
        """Return the contribution W(d, s) of a piece of a straight edge to the transmittance at points.

        The piece begins at the foot of the perpendicular from each point to the edge, and ends at the signed distance s
        along the edge. d is the signed length of the perpendicular, positive if the point lies on the inner side.

        near: True if |d| is less than the radius at which the kernel that softens the edge ends. The disc of this
            radius around the point then contains a chord of the line.
        half: half the length of the chord.
        chord: contribution of the infinite half-line that begins at the foot; 0 if there is no chord.
        zero: zeros, one for each point.
        """
        import drjit as dr

        within = near & (dr.abs(s) < half)
        # Operands are selected before the division: a division by 0 in any lane would make its derivative NaN.
        slope = dr.select(within, 0, dr.select(near, -d, s)) / dr.select(within, 1, dr.select(near, s, d))
        through = dr.select(within, 0, dr.select(s < 0, -chord, chord))
        return dr.atan(slope) / (2 * pi) + through + dr.if_stmt((s, d, zero), within, self._integral, _nothing)

    def _integral(self, s: Array, d: Array, zero: Array) -> Array:
        """Return ∫ d H(r) dt along a line from its foot at t = 0 to t = s.

        Here r² = d² + t², and H is the function of `radial_table`.
        """
        import drjit as dr

        types = self.types

        def add(j: Array, total: Array, s: Array, d: Array) -> tuple[Array, Array, Array, Array]:
            t = s * dr.gather(types.Float64, self.nodes, j)
            value = self.radial.at(dr.sqrt(d * d + t * t + TINY), types)
            return j + 1, total + dr.gather(types.Float64, self.weights, j) * value, s, d

        start = dr.zeros(types.Index, dr.width(d)), zero, s, d
        total = dr.while_loop(start, lambda j, *_: j < self.count, add, max_iterations=-1)[1]
        return total * s * d


def _nothing(*arguments: Array) -> Array:
    return arguments[-1]


@lru_cache(maxsize=64)
def radial_table(edge: SoftEdge) -> Interpolant:
    """Return a table of H(r) = G(r)/r², where G = ∫₀^r g(r') r' dr' and g is the kernel."""
    u, weight = gauss_legendre(int(24 + 4 * edge.cycles + edge.beta))

    def mean(r: np.ndarray) -> np.ndarray:
        r = np.maximum(np.abs(r), 1e-9 * edge.reach)
        within = np.minimum(r, edge.reach)
        return np.asarray(edge.ring(np.outer(within, u)) @ weight * within / (2 * pi * r**2))

    # The table extends slightly beyond the reach, to provide the outermost samples of the interpolation.
    return Interpolant.from_function(mean, (-1.1 * edge.reach, 1.1 * edge.reach), 2.2 * edge.cycles, edge.ripple / 4)


@lru_cache(maxsize=64)
def _straight_table(edge: SoftEdge) -> Interpolant:
    """Return a table of the transmittance at a distance d inside the soft edge of a half-plane.

    For d >= 0, it is 1 - ∫ g(r) r 2 arccos(d/r) dr from d to the reach of the kernel g. Values at d and -d add up to 1.
    """
    u, weight = gauss_legendre(int(24 + 4 * edge.cycles + 2 * edge.beta))

    def inside(d: np.ndarray) -> np.ndarray:
        depth = np.abs(d)[:, None]
        r = depth + (edge.reach - depth) * np.sin(pi * u / 2) ** 2
        jacobian = (edge.reach - depth) * np.sin(pi * u) * pi / 2
        beyond = (jacobian * edge.ring(r) * np.arccos(np.clip(depth / r, 0, 1)) / pi) @ weight
        return np.where(d < 0, beyond, 1 - beyond)

    return Interpolant.from_function(inside, (-edge.reach, edge.reach), 2 * edge.cycles, edge.ripple / 4)
