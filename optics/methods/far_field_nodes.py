"""Nodes of the window at which the far field's slow rest is taken: as few as stand for all the others.

Between Chebyshev's nodes in angle the rest is interpolated; and at most of these it is, to the tolerance, a sum over
its values at a few (an interpolative decomposition: Cheng et al., SIAM J. Sci. Comput. 26 (2005) 1389).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.numerics.interpolation import chebyshev_points

__all__ = ["WindowNodes", "all_nodes", "few_nodes"]

AT_A_TIME = 4_000_000  # choice, by memory: entries of a product of polynomials


@dataclass(frozen=True, eq=False)
class WindowNodes:
    """count: Chebyshev points in angle along each axis, up to half_angle [rad]. kept: places (row, column) among them
    where the rest is taken, (kept, 2). mix: what each of these counts at every node, (kept, row, column), complex."""

    count: int
    half_angle: float
    kept: np.ndarray
    mix: np.ndarray

    @property
    def tangents(self) -> list[tuple[float, float]]:
        """(x, y) of the nodes that are kept."""
        at = np.tan(self.half_angle * chebyshev_points(self.count))
        return [(float(at[column]), float(at[row])) for row, column in self.kept]

    def weights(self, angle: np.ndarray, dtype: str) -> np.ndarray:
        """(kept, 2, place): real and imaginary part of what the nodes that are kept count in the directions of a square
        grid of cosines; angle: atan(x/z) there, (y, x), whose transpose is atan(y/z)."""
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
    """Each stands for itself."""
    kept = np.stack(np.meshgrid(np.arange(count), np.arange(count), indexing="ij"), axis=-1).reshape(-1, 2)
    return WindowNodes(count, half_angle, kept, np.eye(count**2).reshape(-1, count, count).astype(complex))


def few_nodes(count: int, half_angle: float, slow: np.ndarray, error: float) -> WindowNodes:
    """Those of whose values every other's is a sum but for `error`, root mean square over the pupil.

    slow: the rest at points of the pupil for every node, (row, column, point), of size 1.
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
        # Sums, and no products of matrices: these are too small for BLAS's threads, which wait spinning.
        share = (rest * along.conj()).sum(axis=1)
        rest = rest - share[:, None] * along
        kept.append(worst)
        shares.append(share)
    found = np.array(shares)  # values = foundᵀ · all of `along`, and so are those of the nodes that are kept
    mix = np.linalg.solve(found[:, kept], found)
    return WindowNodes(
        count, half_angle, np.stack(np.divmod(np.array(kept), count), axis=-1), mix.reshape(-1, count, count)
    )


def _chebyshev(x: np.ndarray, n: int) -> np.ndarray:
    """(degree, *x.shape): Chebyshev's polynomials, below degree n."""
    found = np.ones((n, *x.shape))
    if n > 1:
        found[1] = x
    for degree in range(2, n):
        found[degree] = 2 * x * found[degree - 1] - found[degree - 2]
    return found


def _to_series(n: int) -> np.ndarray:
    """(degree, node): what values at Chebyshev's points count in their polynomial's coefficients."""
    found: np.ndarray = 2 / n * np.cos(np.outer(np.arange(n), np.arccos(chebyshev_points(n))))
    found[0] /= 2
    return found
