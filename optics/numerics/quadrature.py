"""How many quadrature nodes a wave needs, and Gauss-Legendre nodes.

Both rules here fail by aliasing. n equidistant nodes on a circle see e^{iz cos φ} as if its harmonics J_n(z) and beyond
were constant (Jacobi-Anger); n Gauss-Legendre nodes take polynomials up to degree 2n - 1, and the Chebyshev series of a
wave that turns through z radians either way from the middle has the coefficients 2 J_m(z). So one count serves both:
the smallest m from which on 2 |J_m(z)| stays below what is asked.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, log2, pi

import numpy as np

from optics.numerics.bessel import bessel_j

__all__ = ["gauss_legendre", "gauss_legendre_count", "harmonics", "stepped_up"]

NEWTON_STEPS = 10  # far more than it takes
STEPS = 16  # choice: to an octave; half a step, 2 %, is what is taken too much of in the mean


def harmonics(z: np.ndarray, digits: float) -> np.ndarray:
    """Smallest m with 2 |J_m| <= 10^-digits from there on and for all arguments up to z, by bisection."""
    z = np.asarray(z, dtype=np.float64)
    # |J_m(z)| falls steadily in m beyond m = z, and is below (ez/2m)^m, which bounds the search: e/2 is 1.36.
    low, high = np.floor(z), np.ceil(1.36 * z + 3 * digits + 4)
    while np.any(high - low > 1):
        middle = np.ceil((low + high) / 2)
        small = 2 * np.abs(bessel_j(middle, z)) <= 10.0**-digits
        low, high = np.where(small, low, middle), np.where(small, middle, high)
    return np.asarray(high, dtype=np.int64)


def gauss_legendre_count(cycles: float, digits: float, degree: int = 0) -> int:
    """Nodes for an integrand that turns through this many cycles between the ends, times a polynomial."""
    return ceil((int(harmonics(np.array(pi * cycles), digits)) + degree) / 2)


@lru_cache(maxsize=256)
def gauss_legendre(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]: roots of Legendre's polynomial by Newton's steps from Tricomi's estimate, and
    weights 2 / ((1 - x²) P'²) (Davis & Rabinowitz, Methods of Numerical Integration, §2.7)."""
    half = (n + 1) // 2  # the others are the same with the other sign
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
    """P_n and P_(n-1) at x, by k P_k = (2k - 1) x P_(k-1) - (k - 1) P_(k-2)."""
    value, before = x, np.ones_like(x)
    for k in range(2, n + 1):
        value, before = ((2 * k - 1) / k) * x * value - ((k - 1) / k) * before, value
    return value, before


def stepped_up(cycles: float) -> float:
    """The next of a few numbers, so that problems that are almost alike share what is made ready for them."""
    return 2.0 ** (ceil(STEPS * log2(cycles) - 1e-9) / STEPS) if cycles > 0 else 0.0
