"""Nodes of the window at which the slow factor of the far field is evaluated: the fewest that represent all others.

The slow factor is interpolated between Chebyshev nodes in angle. At most of these nodes it is, within the tolerance, a
linear combination of its values at a few (an interpolative decomposition: Cheng et al., SIAM J. Sci. Comput. 26 (2005)
1389).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.numerics.interpolation import chebyshev_points

__all__ = ["WindowNodes", "all_nodes", "few_nodes"]

AT_A_TIME = 4_000_000  # choice, limited by memory: entries of a product of polynomials


@dataclass(frozen=True, eq=False)
class WindowNodes:
    """Nodes of the window and their weights.

    count: Chebyshev points in angle along each axis, up to half_angle [rad].
    kept: positions (row, column) among them where the slow factor is evaluated, (kept, 2).
    mix: weights of the kept nodes at every node, (kept, row, column), complex.
    """

    count: int
    half_angle: float
    kept: np.ndarray
    mix: np.ndarray

    @property
    def tangents(self) -> list[tuple[float, float]]:
        """Tangents (x, y) of the kept nodes."""
        at = np.tan(self.half_angle * chebyshev_points(self.count))
        return [(float(at[column]), float(at[row])) for row, column in self.kept]

    def weights(self, angle: np.ndarray, dtype: str) -> np.ndarray:
        """Return the weights of the kept nodes in the directions of a square grid of cosines, (kept, 2, place).

        The second axis holds real and imaginary part. angle: atan(x/z) in these directions, (y, x); its transpose is
        atan(y/z).
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
    """Return all nodes, each with weight 1 at itself."""
    kept = np.stack(np.meshgrid(np.arange(count), np.arange(count), indexing="ij"), axis=-1).reshape(-1, 2)
    return WindowNodes(count, half_angle, kept, np.eye(count**2).reshape(-1, count, count).astype(complex))


def few_nodes(count: int, half_angle: float, slow: np.ndarray, error: float) -> WindowNodes:
    """Return nodes whose linear combinations give the values at all nodes.

    The root mean square error over the pupil is at most `error`.

    slow: the slow factor at points of the pupil for every node, (row, column, point), of modulus 1.
    """
    rest = slow.reshape(count**2, -1)
    kept: list[int] = []
    shares: list[np.ndarray] = []
    while True:
        size = np.square(np.abs(rest)).mean(axis=1)
        worst = int(size.argmax())
        if size[worst] < error**2 or len(kept) == len(rest):
            break
        along = rest[worst] / np.linalg.norm(rest[worst])
        # Sums instead of matrix products: these are too small for the threads of BLAS, which busy-wait.
        share = (rest * along.conj()).sum(axis=1)
        rest = rest - share[:, None] * along
        kept.append(worst)
        shares.append(share)
    found = np.array(shares)  # all values = foundᵀ · all of `along`; this includes the values of the kept nodes
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
    """Return the weights of values at Chebyshev points in the coefficients of their polynomial, (degree, node)."""
    found: np.ndarray = 2 / n * np.cos(np.outer(np.arange(n), np.arccos(chebyshev_points(n))))
    found[0] /= 2
    return found
