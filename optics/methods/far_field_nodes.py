"""The points of the window (nodes) at which `far_field` evaluates the slow factor.

The slow factor is the ratio of the diffraction kernel to a Fourier kernel, and varies slowly over the window. It is
interpolated between the nodes, which are Chebyshev points in angle. Within the tolerance, its values at all nodes are
linear combinations of its values at a few of them. It is evaluated only at these few nodes, which an interpolative
decomposition selects (Cheng et al., SIAM J. Sci. Comput. 26 (2005) 1389).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.numerics.interpolation import chebyshev_points

__all__ = ["WindowNodes", "all_nodes", "few_nodes"]

AT_A_TIME = 4_000_000  # choice, limited by memory: entries of a product of polynomials that is computed at once


@dataclass(frozen=True, eq=False)
class WindowNodes:
    """Points of the window (nodes), and the weights with which a few of them represent all others.

    The slow factor, the ratio of the diffraction kernel to a Fourier kernel, is evaluated only at these few nodes, the
    kept ones. Its values at all nodes are linear combinations of its values at the kept nodes.

    count: number of nodes along each axis. They are Chebyshev points in angle, between ±half_angle [rad].
    kept: row and column of each kept node among all nodes, (kept node, 2).
    mix: complex weights of the kept nodes in the linear combination for each node, (kept node, row, column).
    """

    count: int
    half_angle: float
    kept: np.ndarray
    mix: np.ndarray

    @property
    def tangents(self) -> list[tuple[float, float]]:
        """Tangents (x/z, y/z) of the directions to the kept nodes.

        The kept nodes are the points of the window at which the slow factor, the ratio of the diffraction kernel to a
        Fourier kernel, is evaluated.
        """
        at = np.tan(self.half_angle * chebyshev_points(self.count))
        return [(float(at[column]), float(at[row])) for row, column in self.kept]

    def weights(self, angle: np.ndarray, dtype: str) -> np.ndarray:
        """Return the weights that interpolate from the kept nodes to a square grid of directions.

        The kept nodes are the few points of the window at which the slow factor, the ratio of the diffraction kernel to
        a Fourier kernel, is evaluated. The result is an array (kept node, real or imaginary part, direction).

        angle: atan(x/z) of the directions, (y, x). The grid is symmetric, so the transpose of `angle` is atan(y/z).
        """
        across = _chebyshev(angle / self.half_angle, self.count).astype(dtype).reshape(self.count, -1)
        down = _chebyshev(angle.T / self.half_angle, self.count).astype(dtype).reshape(self.count, -1)
        series = np.einsum("pa,kab,qb->kpq", _to_series(self.count), self.mix, _to_series(self.count))
        both = np.stack([series.real, series.imag], axis=1).reshape(-1, self.count**2).astype(dtype)
        found = np.empty((len(both), angle.size), dtype)
        step = max(1, AT_A_TIME // self.count**2)
        for start in range(0, angle.size, step):
            some = slice(start, start + step)
            products = down[:, None, some] * across[None, :, some]
            np.matmul(both, products.reshape(self.count**2, -1), out=found[:, some])
        return found.reshape(len(self.kept), 2, -1)


def all_nodes(count: int, half_angle: float) -> WindowNodes:
    """Return `WindowNodes` that evaluate the slow factor at every node, not only at a few of the nodes.

    The slow factor is the ratio of the diffraction kernel to a Fourier kernel.
    """
    kept = np.stack(np.meshgrid(np.arange(count), np.arange(count), indexing="ij"), axis=-1).reshape(-1, 2)
    return WindowNodes(count, half_angle, kept, np.eye(count**2).reshape(-1, count, count).astype(complex))


def few_nodes(count: int, half_angle: float, slow: np.ndarray, error: float) -> WindowNodes:
    """Return `WindowNodes` that evaluate the slow factor only at a few nodes, the kept ones.

    Linear combinations of the values at the kept nodes approximate those at all nodes. For each node, the root mean
    square error over the points of the pupil is less than `error`.

    slow: the slow factor, which is the ratio of the diffraction kernel to a Fourier kernel, for every node and for
        points of the pupil, (row, column, point), with a modulus of about 1.
    """
    rest = slow.reshape(count**2, -1)
    kept: list[int] = []
    rows: list[np.ndarray] = []
    while True:
        size = np.square(np.abs(rest)).mean(axis=1)
        worst = int(size.argmax())
        if size[worst] < error**2 or len(kept) == len(rest):
            break
        along = rest[worst] / np.linalg.norm(rest[worst])
        # The sum is not a matrix product, because busy waiting of BLAS threads dominates the time of small products.
        projection = (rest * along.conj()).sum(axis=1)
        rest = rest - projection[:, None] * along
        kept.append(worst)
        rows.append(projection)
    found = np.array(rows)  # (kept, node): components of the values at all nodes along the unit vectors `along`
    mix = np.linalg.solve(found[:, kept], found)
    return WindowNodes(
        count, half_angle, np.stack(np.divmod(np.array(kept), count), axis=-1), mix.reshape(-1, count, count)
    )


def _chebyshev(x: np.ndarray, n: int) -> np.ndarray:
    """Return the Chebyshev polynomials below degree n, (degree, *x.shape)."""
    found = np.ones((n, *x.shape))
    if n > 1:
        found[1] = x
    for degree in range(2, n):
        found[degree] = 2 * x * found[degree - 1] - found[degree - 2]
    return found


def _to_series(n: int) -> np.ndarray:
    """Return a matrix (degree, node) from values at n Chebyshev points to coefficients of Chebyshev polynomials."""
    found: np.ndarray = 2 / n * np.cos(np.outer(np.arange(n), np.arccos(chebyshev_points(n))))
    found[0] /= 2
    return found
