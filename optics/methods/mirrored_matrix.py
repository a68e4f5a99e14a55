"""Faster products with matrices that do not change if rows and columns are both mirrored.

The cost of such a product is halved. The Fourier kernel of a window about the axis is such a matrix: each entry depends
only on the product of a position in the window and the sine of the direction of a sample of the pupil. The product does
not change if position and sine both change their signs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.numerics.grid import Grid

__all__ = ["MirroredMatrix", "mirroring_share"]

# Choices: multiplications of a sum from which on mirroring saves time, and the share of the time that remains.
LEAST_PRODUCTS, SHARE = 4e6, 0.65


def mirroring_share(window: Grid, inner: np.ndarray) -> np.ndarray:
    """Return the time of sums over the pupil with `MirroredMatrix`, relative to the time without it.

    A sum is the product of three matrices. The first is the Fourier kernel along y, the second is square, and the third
    is the Fourier kernel along x. The result is 1 if mirroring saves no time: for small matrices, or for a window off
    the axis. It is an array (sum,).

    inner: number of rows of the square matrix in each sum, array (sum,).
    """
    height, width = window.shape
    large = inner * inner * width + height * inner * width >= LEAST_PRODUCTS
    return np.where(large & (window.centre == (0.0, 0.0)), SHARE, 1.0)


@dataclass(frozen=True, eq=False)
class MirroredMatrix:
    """A matrix A with A[-x, -s] = A[x, s], as the parts that are even and odd in s.

    The row of A with the index n//2 is x = 0, where n is the number of rows. The columns are symmetric about their
    middle, s = 0.

    even: even part for x = 0, -1, ... and s >= 0, array (..., x, s).
    odd: odd part for the same x and s > 0, array (..., x, s).
    rows: number n of rows of A.
    """

    even: np.ndarray
    odd: np.ndarray
    rows: int

    @classmethod
    def from_matrix(cls, matrix: np.ndarray) -> MirroredMatrix:
        """Return a matrix A as its even and odd parts.

        matrix: the matrix A, which does not change if rows and columns are both mirrored, (..., x, s).
        """
        rows, half = matrix.shape[-2], matrix.shape[-1] // 2
        middle, ahead, behind = _split(matrix[..., rows // 2 :: -1, :].swapaxes(-1, -2), half)
        even, odd = np.concatenate([middle, (ahead + behind) / 2], axis=-2), (ahead - behind) / 2
        return cls(even.swapaxes(-1, -2), odd.swapaxes(-1, -2), rows)

    def __matmul__(self, other: np.ndarray) -> np.ndarray:
        """Return the product A B of this matrix A and a matrix B.

        other: the matrix B, which has as many rows as A has columns, array (..., row, column).
        """
        middle, ahead, behind = _split(other, self.odd.shape[-1])
        even = self.even @ np.concatenate([middle, ahead + behind], axis=-2)
        odd = self.odd @ (ahead - behind)
        found = np.empty((*even.shape[:-2], self.rows, even.shape[-1]), even.dtype)
        np.add(even, odd, out=found[..., self.rows // 2 :: -1, :])
        after = self.rows - self.rows // 2
        np.subtract(even[..., :after, :], odd[..., :after, :], out=found[..., self.rows // 2 :, :])
        return found


def _split(matrix: np.ndarray, half: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return three parts of a matrix: its middle row, the rows after the middle, and the rows before the middle.

    Only the third part is in reverse order. The first part is empty if the number of rows is even.

    matrix: array (..., row, column).
    half: number of rows after the middle.
    """
    count = matrix.shape[-2]
    return matrix[..., half : count - half, :], matrix[..., count - half :, :], matrix[..., :half, :][..., ::-1, :]
