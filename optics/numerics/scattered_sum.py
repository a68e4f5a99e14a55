"""Fourier sums between scattered points and a grid.

Each point is spread over a few cells of a finer grid, which is then transformed.

    S(k) = Σ_j u_j e^{2πi (p_j k_x + q_j k_y)},   u(j) = Σ_k S_k e^{2πi (p_j k_x + q_j k_y)}.

Along an axis with n samples, k runs from -(n//2) in steps of 1. The spreading kernel is e^{β(√(1 - z²) - 1)} (Barnett,
Magland & af Klinteberg, SIAM J. Sci. Comput. 41, C479, 2019). The finer grid is periodic, and has at least twice as
many cells along each axis as the grid has samples. The result is divided by the transform of the kernel.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array
from optics.numerics.fourier import fast_length, fourier_sum
from optics.numerics.precision import padded_for_packets, precision
from optics.numerics.quadrature import gauss_legendre

__all__ = ["ScatteredSum", "sums_at"]

FINER = 2.0  # choice: cells per sample of the sum
SLOPE = 2.30  # β per cell of the spreading kernel, for two cells per sample (eq. 4.5 of the paper)
TRANSFORM_NODES = 40


class ScatteredSum:
    """Fourier sums between scattered points and the samples of a grid, in both directions.

    For the sample with the indices k, the sum over the points j with amplitudes u_j is
    S(k) = Σ_j u_j e^{2πi (p_j k_x + q_j k_y)}. For the point j, the sum over the samples with values S_k is
    Σ_k S_k e^{2πi (p_j k_x + q_j k_y)}.

    p, q: coordinates of the points along x and y, (point,). From one sample to the next, the phase changes by 2πp or
        2πq.
    shape: number of samples (y, x) of the grid.
    digits: number of accurate digits of the sums, relative to Σ|u|.
    """

    def __init__(self, p: np.ndarray, q: np.ndarray, shape: tuple[int, int], digits: float = 6.0) -> None:
        from scipy.sparse import csr_array

        self.shape, self.width = shape, min(max(2, math.ceil(digits) + 1), 13)
        self.period = fast_length(FINER * max(*shape, self.width))
        (first_x, by_x), (first_y, by_y) = (_spread(at, self.period, self.width) for at in (p, q))
        across, down = (np.arange(self.width) + first[:, None] for first in (first_x, first_y))
        low_x, low_y = int(across.min()), int(down.min())
        # Only the cells that contain spread points are stored.
        self.held = int(down.max()) - low_y + 1, int(across.max()) - low_x + 1
        cells = (down[:, :, None] - low_y) * self.held[1] + (across[:, None, :] - low_x)
        weights = by_y[:, :, None] * by_x[:, None, :]
        index = np.arange(len(first_x) + 1) * self.width**2
        self.cells = csr_array((weights.ravel(), cells.ravel(), index), shape=(len(first_x), math.prod(self.held)))
        self.first = low_y + self.held[0] // 2, low_x + self.held[1] // 2

    def evaluate(self, u: np.ndarray) -> np.ndarray:
        """Return the complex Fourier sums over the scattered points at each sample of the grid, (sum, y, x).

        u: amplitudes of the points, (sum, point).
        """
        held = (self.cells.T @ np.ascontiguousarray(u.T)).T.reshape(len(u), *self.held)
        found = np.stack([fourier_sum(np.ascontiguousarray(one), self.period, self.shape, 1) for one in held])
        return found * self._factor()

    def at(self, samples: np.ndarray) -> np.ndarray:
        """Return the complex sum over the grid's samples for each scattered point, (sum, point).

        For the point j, it is Σ_k S_k e^{2πi (p_j k_x + q_j k_y)}. This linear map is the transpose of `evaluate`.

        samples: values S at the samples, (sum, y, x).
        """
        parts = samples * self._factor()
        held = np.stack([fourier_sum(np.ascontiguousarray(one), self.period, self.held, 1) for one in parts])
        found: np.ndarray = (self.cells @ held.reshape(len(samples), -1).T).T
        return found

    def _factor(self) -> np.ndarray:
        """Return the factors that correct the Fourier sums for the kernel that spreads each point, (y, x).

        To compute the sums, a kernel spreads each scattered point over some cells, the squares of a finer grid. The
        values of the cells are then Fourier transformed. Only the block of cells that contains the spread points is
        stored. Each factor is a phase factor for the position of this block on the finer grid, divided by the Fourier
        transform of the kernel. There is one factor for each sample of the sums.
        """
        axes = []
        for first, n in zip(self.first, self.shape, strict=True):
            turns = (np.arange(n) - n // 2) * first / self.period
            axes.append(np.exp(2j * np.pi * (turns - np.round(turns))) / _transform(self.width, self.period, n))
        return np.outer(axes[0], axes[1])


def sums_at(sums: ScatteredSum, samples: Array) -> tuple[Array, Array]:
    """Return the real and imaginary part of `sums.at` for real values at the grid's samples, with derivatives.

    For each scattered point, `sums.at` computes a Fourier sum over the samples. Both parts are flat Float64 arrays
    (sum, point).
    """
    import drjit as dr

    types = precision("float64")

    class SumsAt(dr.CustomOp):
        """`ScatteredSum.at`, which maps grid samples to sums at scattered points, as a differentiable operation.

        The samples are real, so the adjoint is the real part of `ScatteredSum.evaluate`, which maps points to samples.
        """

        def eval(self, samples: Array) -> tuple[Array, Array]:
            found = sums.at(samples.numpy().reshape(-1, *sums.shape))
            return types.Float(padded_for_packets(found.real)), types.Float(padded_for_packets(found.imag))

        def forward(self) -> None:
            self.set_grad_out(self.eval(self.grad_in("samples")))

        def backward(self) -> None:
            grad: Any = self.grad_out()
            re, im = (part.numpy().reshape(-1, sums.cells.shape[0]) for part in grad)
            self.set_grad_in("samples", types.Float(padded_for_packets(sums.evaluate(re - 1j * im).real)))

    return dr.custom(SumsAt, samples)


def _spread(turns: np.ndarray, period: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells over which a kernel spreads each point along one axis: the first cell, and the cells' weights.

    A Fourier sum over scattered points is computed on a periodic grid, after each point has been spread over a few
    neighbouring squares of this grid, the cells. The first cells are (point,), and the weights (point, cell).

    turns: coordinate of each point, in units of the grid's period.
    period: number of cells in the grid.
    width: width of the kernel in cells.
    """
    place = np.asarray(turns, dtype=np.float64) * period
    first = np.ceil(place - width / 2).astype(np.int64)
    z = (np.arange(width) + first[:, None] - place[:, None]) * (2 / width)
    return first, np.exp(SLOPE * width * (np.sqrt(np.maximum(1 - z * z, 0)) - 1))


@lru_cache(maxsize=64)
def _transform(width: int, period: int, n: int) -> np.ndarray:
    """Return the Fourier transform of the kernel that spreads points over the cells of a periodic grid, for one axis.

    width: width of the kernel in cells.
    period: number of cells in the grid along the axis.
    n: number of frequencies. They are the whole numbers k from -(n//2), in cycles per period of the grid.
    """
    node, weight = gauss_legendre(TRANSFORM_NODES)
    z, weight = 2 * node - 1, width * weight
    shape = weight * np.exp(SLOPE * width * (np.sqrt(1 - z * z) - 1))
    k = np.arange(n) - n // 2
    found: np.ndarray = np.cos(np.pi * width / period * np.outer(k, z)) @ shape
    return found
