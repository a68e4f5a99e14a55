"""Cubic splines through the samples of a map, at positions from -1 to 1 across the map's square.

The spline is a sum of B-splines. Their coefficients are computed from the samples. Along each axis there is one
coefficient for each sample, and there are further ones beyond the first and the last sample, where the spline is
extrapolated. Values at fixed points are the product of a sparse matrix and these coefficients.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from optics.numerics.array_library import indices, library, like
from optics.numerics.autodiff import Array
from optics.numerics.interpolation import cubic_bsplines

__all__ = [
    "is_open_grid",
    "spline_basis",
    "spline_cell",
    "spline_coefficients",
    "spline_matrix",
    "spline_weights",
    "spline_width",
]

AT_ONCE = 2048  # choice: points whose weights are computed at once, which fit into the cache
FEW = 128  # choice: number of samples up to which a product with `spline_matrix` is faster than solving for splines


def is_open_grid(x: Array, y: Array) -> bool:
    """Return True if x and y are NumPy arrays, x a row of the shape (1, column) and y a column of the shape (row, 1).

    Such arrays describe the points of a rectangular grid. A spline's values at these points are a product of matrices.
    """
    return library(x) is np and x.ndim == y.ndim == 2 and len(x) == 1 and y.shape[1] == 1


def spline_width(n: int) -> int:
    """Return the number of spline coefficients for n samples along an axis."""
    return n + 2 * _margin(n)


def spline_cell(position: Array, n: int) -> tuple[Array, list[Array]]:
    """Return the index of the first of the four spline coefficients at a position, and the weights of all four."""
    own, half, shift = library(position), like(position, n / 2), like(position, _margin(n) - 0.5)
    place = position * half + half + shift
    cell = own.clip(own.floor(place), like(position, 1.0), like(position, spline_width(n) - 3.0))
    return indices(cell) - 1, cubic_bsplines(place - cell)


def spline_basis(at: np.ndarray, n: int) -> np.ndarray:
    """Return the values of all B-splines at positions along an axis of n samples, (position, coefficient).

    There is one B-spline for each spline coefficient.
    """
    return _basis(np.asarray(at, np.float64).tobytes(), n)


def spline_weights(x: np.ndarray, y: np.ndarray, rows: int, columns: int) -> Any:
    """Return the weights of all spline coefficients at points (x, y), a sparse matrix (point, coefficient).

    A weight is the product of a B-spline along x and one along y.

    x, y: positions, arrays of any shape. Coefficients are counted row by row.
    """
    from scipy.sparse import csr_matrix

    x, y, width = x.ravel(), y.ravel(), spline_width(columns)
    weight, at = np.empty((x.size, 4, 4)), np.empty((x.size, 4, 4), np.int32)
    for first in range(0, x.size, AT_ONCE):
        part = slice(first, first + AT_ONCE)
        (column, across), (row, along) = spline_cell(x[part], columns), spline_cell(y[part], rows)
        corner = row * width + column
        for i, down in enumerate(along):
            for j, right in enumerate(across):
                np.multiply(down, right, out=weight[part, i, j])
                at[part, i, j] = corner + (i * width + j)
    ends = np.arange(x.size + 1, dtype=np.int32) * 16
    return csr_matrix((weight.ravel(), at.ravel(), ends), (x.size, spline_width(rows) * width))


def spline_coefficients(samples: np.ndarray) -> np.ndarray:
    """Return the coefficients (row, column) of the B-splines whose sum passes through the samples (y, x)."""
    if max(samples.shape) <= FEW:
        down, across = map(spline_matrix, samples.shape)
        found: np.ndarray = down @ samples @ across.T
        return found
    return np.ascontiguousarray(_coefficients(_coefficients(samples).T).T)


@lru_cache(maxsize=16)
def spline_matrix(n: int) -> np.ndarray:
    """Return the matrix that maps n samples along an axis to spline coefficients, (coefficient, sample)."""
    return _coefficients(np.eye(n))


def _margin(n: int) -> int:
    """Return the number of spline coefficients beyond either end of n samples."""
    return max(3, n // 4)


@lru_cache(maxsize=16)
def _basis(at: bytes, n: int) -> np.ndarray:
    positions = np.frombuffer(at)
    first, weights = spline_cell(positions, n)
    basis, place = np.zeros((len(positions), spline_width(n))), np.arange(len(positions))
    for k, weight in enumerate(weights):
        basis[place, first + k] = weight
    return basis


def _coefficients(samples: np.ndarray) -> np.ndarray:
    """Return the B-spline coefficients c = s - s''/6 of the cubic spline s through samples, along axis 0.

    There is one coefficient for each sample, and there are further ones beyond the first and the last sample. At either
    end, the two coefficients just beyond the samples are s - s''/6 of the extrapolated spline. The coefficients farther
    out lie on the straight line through these two.
    """
    from scipy.interpolate import make_interp_spline

    n, margin = len(samples), _margin(len(samples))
    places = np.arange(-2, n + 2)
    if n < 4:
        fitted = np.polynomial.polynomial.polyfit(np.arange(n), samples, n - 1)
        second = np.polynomial.polynomial.polyder(fitted, 2)
        value, bend = (np.polynomial.polynomial.polyval(places, curve).T for curve in (fitted, second))
    else:
        spline = make_interp_spline(np.arange(n), samples, k=3)
        value, bend = spline(places), spline(places, nu=2)
    core = value - bend / 6
    steps = np.arange(1, margin - 1)[:, None]
    before = core[0] + (core[0] - core[1]) * steps[::-1]
    after = core[-1] + (core[-1] - core[-2]) * steps
    return np.concatenate([before, core, after])
