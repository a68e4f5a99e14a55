"""The number of quadrature nodes that a wave needs, and Gauss-Legendre nodes.

The error of both rules here is due to aliasing. With n equidistant nodes on a circle, harmonics of e^{iz cos φ} of
order n and above alias; their amplitudes are J_n(z) and beyond (Jacobi-Anger expansion). n Gauss-Legendre nodes are
exact for polynomials up to degree 2n - 1. The Chebyshev series of a wave whose phase is ±z radians at the ends has the
coefficients 2 J_m(z). The same number therefore determines both rules: the smallest m from which on 2 |J_m(z)| stays
below the requested error.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, log2, pi

import numpy as np

from optics.numerics.bessel import bessel_j

__all__ = ["gauss_legendre", "gauss_legendre_count", "harmonics", "stepped_up"]

NEWTON_STEPS = 10  # iterations, far more than convergence needs
STEPS = 16  # choice: values per octave in `stepped_up`; on average, cycles increase by half a step (2 %)


def harmonics(z: np.ndarray, digits: float) -> np.ndarray:
    """Return the smallest m from which on 2 |J_m| <= 10^-digits for all arguments up to z, by bisection."""
    z = np.asarray(z, dtype=np.float64)
    # Beyond m = z, |J_m(z)| falls steadily with m and is below (ez/2m)^m. This bounds the search, since e/2 is 1.36.
    low, high = np.floor(z), np.ceil(1.36 * z + 3 * digits + 4)
    while np.any(high - low > 1):
        middle = np.ceil((low + high) / 2)
        small = 2 * np.abs(bessel_j(middle, z)) <= 10.0**-digits
        low, high = np.where(small, low, middle), np.where(small, middle, high)
    return np.asarray(high, dtype=np.int64)


def gauss_legendre_count(cycles: float, digits: float, degree: int = 0) -> int:
    """Return the number of Gauss-Legendre nodes for a wave with `cycles` cycles between the ends, times a polynomial.

    degree: degree of the polynomial.
    """
    return ceil((_degree(float(f"{cycles:.12g}"), digits) + degree) / 2)


@lru_cache(maxsize=4096)
def _degree(cycles: float, digits: float) -> int:
    """Return the degree of the polynomial that represents a wave of `cycles` cycles between the ends.

    Rules for the many parts of an opening often need the same number.
    """
    return int(harmonics(np.array(pi * cycles), digits))


@lru_cache(maxsize=256)
def gauss_legendre(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss-Legendre nodes and weights on [0, 1].

    The nodes are the roots of Legendre's polynomial P. Newton's method computes them, starting from Tricomi's estimate.
    The weights are 2 / ((1 - x²) P'²) (Davis & Rabinowitz, Methods of Numerical Integration, §2.7).
    """
    half = (n + 1) // 2  # the other half of the nodes follows by symmetry
    x = (1 - (n - 1) / (8.0 * n**3)) * np.cos(pi * (4 * np.arange(1, half + 1) - 1) / (4 * n + 2))
    if n % 2:
        x[-1] = 0.0
    for _ in range(NEWTON_STEPS):
        value, before = _legendre(n, x)
        slope = n * (before - x * value) / (1 - x * x)
        step = value / slope
        x = x - step
        if np.abs(step).max() < 1e-15:
            break
    value, before = _legendre(n, x)
    slope = n * (before - x * value) / (1 - x * x)
    weight = 2 / ((1 - x * x) * slope * slope)
    nodes = np.concatenate([-x, x[: n // 2][::-1]])
    weights = np.concatenate([weight, weight[: n // 2][::-1]])
    nodes, weights = (nodes + 1) / 2, weights / weights.sum()
    nodes.flags.writeable = weights.flags.writeable = False
    return nodes, weights


def _legendre(n: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return P_n and P_(n-1) at x, by k P_k = (2k - 1) x P_(k-1) - (k - 1) P_(k-2)."""
    value, before = x, np.ones_like(x)
    for k in range(2, n + 1):
        value, before = ((2 * k - 1) / k) * x * value - ((k - 1) / k) * before, value
    return value, before


def stepped_up(cycles: float) -> float:
    """Return `cycles` rounded up to one of a few values.

    Similar problems then use the same cached rules.
    """
    return 2.0 ** (ceil(STEPS * log2(cycles) - 1e-9) / STEPS) if cycles > 0 else 0.0
