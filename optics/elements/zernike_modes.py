"""Zernike polynomials, and sums of many of them at the same points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from optics.numerics.array_library import beside

__all__ = ["mode", "norm", "weighted_modes"]

MOST_CACHED = 4_000_000  # choice, limited by memory: largest number of values of polynomials that are cached together


def mode(n: int, m: int, x: Any, y: Any) -> Any:
    """Return the Zernike polynomial Z_n^m at points (x, y).

    It is norm(n, m) ρ^|m| P_k^(0, |m|)(2ρ² - 1) {cos mθ, sin |m|θ}, with k = (n - |m|)/2 and Jacobi's polynomials P.

    x, y: positions in units of the circle's radius, arrays of NumPy, PyTorch or Dr.Jit.
    """
    sine, cosine = x * 0, x * 0 + 1.0
    for _ in range(abs(m)):
        cosine, sine = cosine * x - sine * y, cosine * y + sine * x
    *_, radial = _jacobi(abs(m), (n - abs(m)) // 2, 2 * (x * x + y * y) - 1)
    return norm(n, m) * radial * (cosine if m >= 0 else sine)


def _jacobi(order: int, highest: int, t: Any) -> Iterator[Any]:
    """Yield P_k^(0, order)(t) for k from 0 to `highest`.

    The recurrence of Jacobi's polynomials loses no digits at high orders (Abramowitz & Stegun 22.7.1).
    """
    before, now = t * 0, t * 0 + 1.0
    yield now
    for k in range(1, highest + 1):
        c = 2 * k + order
        if k == 1:
            before, now = now, 1 + (order + 2) / 2 * (t - 1)
        else:
            raised = (c - 1) * (c * (c - 2) * t - order**2) * now - 2 * (k - 1) * (k + order - 1) * c * before
            before, now = now, raised / (2 * k * (k + order) * (c - 2))
        yield now


def weighted_modes(weights: Any, named: tuple[tuple[int, int], ...], x: np.ndarray, y: np.ndarray) -> Any:
    """Return Σ w Z_n^m at (x, y), one w for each mode (n, m) in `named`, as an array of the library of `weights`.

    Many wavefronts are evaluated at the same points, so the polynomials are cached, unless they have too many values.

    weights: array of NumPy or PyTorch, in float64.
    x, y: positions, float64.
    """
    size = np.broadcast_shapes(x.shape, y.shape)
    if len(named) * math.prod(size) > MOST_CACHED:
        parts = (w * beside(weights, mode(n, m, x, y)) for w, (n, m) in zip(weights, named, strict=True))
        return sum(parts, beside(weights, np.zeros(size)))
    known = _modes(named, x.tobytes(), x.shape, y.tobytes(), y.shape)
    return (weights @ beside(weights, known)).reshape(size)


@lru_cache(maxsize=8)
def _modes(
    named: tuple[tuple[int, int], ...], x: bytes, columns: tuple[int, ...], y: bytes, rows: tuple[int, ...]
) -> np.ndarray:
    """Return the Zernike polynomials of the modes (n, m) in `named` at points (x, y), array (mode, point).

    x, y: positions in units of the circle's radius, as the bytes of float64 arrays.
    columns, rows: shapes of the arrays x and y.
    """
    at = np.frombuffer(x).reshape(columns), np.frombuffer(y).reshape(rows)
    size = np.broadcast_shapes(columns, rows)
    # Modes share the polynomials of the radius and the powers of x + iy.
    radial: dict[tuple[int, int], np.ndarray] = {}
    turns = [np.ones(size, complex)]
    square = 2 * (at[0] * at[0] + at[1] * at[1]) - 1
    for order in range(max(abs(m) for _, m in named) + 1):
        highest = max(((n - order) // 2 for n, m in named if abs(m) == order), default=-1)
        radial |= {(order + 2 * k, order): own for k, own in enumerate(_jacobi(order, highest, square))}
        turns.append(turns[-1] * (at[0] + 1j * at[1]))
    found = np.empty((len(named), *size))
    for place, (n, m) in enumerate(named):
        turn = turns[abs(m)]
        np.multiply(norm(n, m) * radial[n, abs(m)], turn.real if m >= 0 else turn.imag, out=found[place])
    return found.reshape(len(named), -1)


def norm(n: int, m: int) -> float:
    return math.sqrt((2 - (m == 0)) * (n + 1))
