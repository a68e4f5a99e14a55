"""A relief's genes: which there are, and what a start given for few of them means for many."""

from __future__ import annotations

from math import isqrt

import numpy as np
from numpy.typing import NDArray

__all__ = ["PATCH", "doe_names", "refined", "representatives"]

Floats = NDArray[np.float64]
PATCH = (
    4  # genes a side of a bicubic B-spline patch; more are heights at cell centres, with a cubic spline through them
)


def doe_names(points: int) -> list[str]:
    """Names of the genes of a relief with points x points of them, row-major (y, x)."""
    return [f"doe_{i}{j}" for i in range(points) for j in range(points)]


def representatives(points: int, symmetric: bool) -> list[str]:
    """For each gene in `doe_names`, the one that its height is. A symmetric relief looks the same mirrored and turned
    by a quarter, as an eighth of it says: its genes are those of their own name."""
    if not symmetric:
        return doe_names(points)
    to_rim = np.minimum(np.arange(points), np.arange(points)[::-1])
    return [f"doe_{min(i, j)}{max(i, j)}" for i in to_rim for j in to_rim]


def refined(relief: Floats, points: int) -> Floats:
    """The surface of a 4 x 4 patch as points x points heights at cell centres, (points²,); exact, as the patch is one
    bicubic polynomial, which the spline through its heights repeats.

    Raises:
        ValueError: it has other than 4 x 4 or the points asked for.
    """
    side = isqrt(relief.size)
    if side == points:
        return relief.ravel()
    if side != PATCH:
        raise ValueError(f"a relief of {side} x {side} points cannot become one of {points} x {points}")
    basis = _basis((np.arange(points) + 0.5) / points)
    return np.asarray(basis @ relief.reshape(PATCH, PATCH) @ basis.T).ravel()


def _basis(t: Floats) -> Floats:
    """The four uniform cubic B-splines over one knot interval, (t, 4); Piegl & Tiller, The NURBS Book, ch. 2."""
    s = 1 - t
    middle = (3 * t**3 - 6 * t**2 + 4) / 6
    return np.column_stack([s**3 / 6, middle, (3 * s**3 - 6 * s**2 + 4) / 6, t**3 / 6])
