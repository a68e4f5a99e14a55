"""The number of quadrature nodes that a wave needs, and Gauss-Legendre nodes.

The errors of equidistant nodes on a circle and of Gauss-Legendre nodes are due to aliasing. With n equidistant nodes on
a circle, harmonics of e^{iz cos φ} of orders m >= n alias. Their amplitudes are J_m(z) (Jacobi-Anger expansion). n
Gauss-Legendre nodes are exact for polynomials up to degree 2n - 1. The Chebyshev series of a wave whose phase is ±z
radians at the ends has the coefficients 2 J_m(z). Both numbers of nodes therefore follow from the smallest m such that
2 |J_k(z)| is below the requested error for all orders k >= m.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, log, log2, pi

import numpy as np

from optics.numerics.bessel import bessel_j

__all__ = ["gauss_legendre", "gauss_legendre_count", "harmonics", "stepped_up"]

NEWTON_STEPS = 10  # iterations, far more than convergence needs
DEBYE_STEPS = 3  # choice: iterations; one more rarely changes the rounded order
STEPS = 16  # choice: values per octave in `stepped_up`; on average, cycles increase by half a step (2 %)


def harmonics(z: np.ndarray, digits: float) -> np.ndarray:
    """Return the smallest order m such that 2 |J_n(x)| <= 10^-digits for all orders n >= m and all x from 0 to z.

    J_n are Bessel functions. The search starts at Debye's estimate of m. Usually the estimate is already the result, so
    that values of only two Bessel functions are needed.
    """
    z = np.asarray(z, dtype=np.float64)
    # Beyond m = z, |J_m(z)| falls steadily with m and is below (ez/2m)^m. This bounds the search, since e/2 is 1.36.
    low, high = np.floor(z), np.ceil(1.36 * z + 3 * digits + 4)
    order, step = np.clip(np.ceil(_debye_order(z, digits)), low + 1, high - 1), 1
    while np.any(high - low > 1):
        small = 2 * np.abs(bessel_j(order, z)) <= 10.0**-digits
        low, high = np.where(small, low, order), np.where(small, order, high)
        order, step = np.where(small, order - step, order + step), 2 * step
        order = np.where((order > low) & (order < high), order, np.ceil((low + high) / 2))
    return np.asarray(high, dtype=np.int64)


def _debye_order(z: np.ndarray, digits: float) -> np.ndarray:
    """Return the order m, not rounded, at which Debye's expansion of 2 J_m(z) is 10^-digits.

    J_m(m / cosh a) is about e^(m (tanh a - a)) / √(2π m tanh a) (Watson, §8.4). Newton's method solves for m. Near
    m = z, the expansion is wrong, and so is the estimate.
    """
    z = np.maximum(z, 1e-9)
    least = z + 0.3 * np.cbrt(z)
    order = z + np.cbrt(z) * (2.44 * (digits + 0.3)) ** (2 / 3) + digits
    for _ in range(DEBYE_STEPS):
        root = np.sqrt((order - z) * (order + z))
        a = np.log((order + root) / z)
        excess = root - order * a - 0.5 * np.log(2 * pi * root) + log(2) + digits * log(10)
        order = np.maximum(order + excess / a, least)
    return np.asarray(order)


def gauss_legendre_count(cycles: float, digits: float, degree: int = 0) -> int:
    """Return the number of Gauss-Legendre nodes that integrate a wave times a polynomial to within 10^-digits.

    cycles: number of cycles of the wave between the ends.
    degree: degree of the polynomial.
    """
    return ceil((_degree(float(f"{cycles:.12g}"), digits) + degree) / 2)


@lru_cache(maxsize=4096)
def _degree(cycles: float, digits: float) -> int:
    """Return the degree of a polynomial that represents a wave on an interval with an error of at most 10^-digits.

    The degree is cached, because the quadrature rules for the many parts of an aperture often need the same degree.

    cycles: number of cycles of the wave on the interval.
    """
    return int(harmonics(np.array(pi * cycles), digits))


@lru_cache(maxsize=256)
def gauss_legendre(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss-Legendre nodes and weights on [0, 1].

    They are computed on [-1, 1], where the nodes are the roots x of Legendre's polynomial P of degree n, and the
    weights are 2 / ((1 - x²) P'²) (Davis & Rabinowitz, Methods of Numerical Integration, §2.7). Newton's method
    computes the roots, starting from Tricomi's estimate.
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
    """Return a wave's number of cycles, rounded up to one of 16 values per octave; 0 if it is not positive.

    Waves with similar numbers of cycles then have the same number, and share one cached result, such as a quadrature
    rule.
    """
    return 2.0 ** (ceil(STEPS * log2(cycles) - 1e-9) / STEPS) if cycles > 0 else 0.0
