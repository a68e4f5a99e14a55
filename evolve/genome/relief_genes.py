"""Names of the genes of a pupil's relief, and conversion of 4 x 4 control points to heights on a finer grid."""

from __future__ import annotations

from math import isqrt

import numpy as np
from numpy.typing import NDArray

__all__ = ["PATCH", "doe_names", "refined", "representatives"]

Floats = NDArray[np.float64]
# Number of genes along a side of a bicubic B-spline patch. If a relief has more, its genes are heights that a cubic
# spline interpolates.
PATCH = 4


def doe_names(points: int) -> list[str]:
    """Return the names of a relief's genes, row-major (y, x); there are `points` genes along each side."""
    return [f"doe_{i}{j}" for i in range(points) for j in range(points)]


def representatives(points: int, symmetric: bool) -> list[str]:
    """Return, for each height of the relief in the order of `doe_names`, the name of the gene that determines it.

    A symmetric relief does not change under reflection and rotation by 90°, so the heights in an eighth of its area
    determine all of them. Only the genes of these heights exist. Without symmetry, each height has its own gene.

    points: number of heights along one side of the relief
    """
    if not symmetric:
        return doe_names(points)
    to_rim = np.minimum(np.arange(points), np.arange(points)[::-1])
    return [f"doe_{min(i, j)}{max(i, j)}" for i in to_rim for j in to_rim]


def refined(relief: Floats, points: int) -> Floats:
    """Return a relief as heights at the centres of equal cells, in row-major order (y, x).

    The given relief may be a B-spline patch of 4 x 4 control points. Its conversion is exact: the patch is a single
    bicubic polynomial, which the cubic spline through the heights reproduces. A relief that already has one height
    for each cell is returned unchanged. The result is flat, (points²,).

    relief: control points of a 4 x 4 patch, or heights, in row-major order (y, x); the array may be flat
    points: number of cells along each side of the relief

    Raises:
        ValueError: the relief has neither 4 x 4 control points nor one height for each cell.
    """
    side = isqrt(relief.size)
    if side == points:
        return relief.ravel()
    if side != PATCH:
        raise ValueError(f"a relief of {side} x {side} points cannot be converted to {points} x {points}")
    basis = _basis((np.arange(points) + 0.5) / points)
    return np.asarray(basis @ relief.reshape(PATCH, PATCH) @ basis.T).ravel()


def _basis(t: Floats) -> Floats:
    """Return the values of the four uniform cubic B-splines at positions t in one knot interval [0, 1], (t, 4).

    Source: Piegl & Tiller, The NURBS Book, ch. 2.
    """
    s = 1 - t
    middle = (3 * t**3 - 6 * t**2 + 4) / 6
    return np.column_stack([s**3 / 6, middle, (3 * s**3 - 6 * s**2 + 4) / 6, t**3 / 6])
