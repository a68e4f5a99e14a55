"""Bessel functions: J₀ of Dr.Jit arrays, and J_m of NumPy arrays.

J_m of a small array is computed without SciPy, whose import takes longer. SciPy computes J_m of a large array.

Dr.Jit has no Bessel functions, so J₀ is computed from Chebyshev series, which are fitted once to SciPy's values.

Up to x = 8, the series is in x². Beyond x = 8, J₀(x) = √(2/(πx)) Re[(P + iQ) e^{i(x - π/4)}] (Watson, Theory of Bessel
Functions, §7.3). The series are for P and Q, because P + iQ = √(πx/2) H₀⁽¹⁾(x) e^{-i(x - π/4)} is smooth in 8/x.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array
from optics.numerics.precision import Precision

__all__ = ["bessel_j", "bessel_j0"]

SPLIT = 8.0
FEW = 2_000_000  # choice: number of cosines that takes less time than the import of scipy.special (0.1 s)
# Numbers of terms of the series up to x = 8 and beyond. The neglected terms are below the rounding errors, or below
# 1e-12 in the last entry.
TERMS = {"float32": (12, 5), "float64": (16, 11), "float64 to 1e-12": (14, 7)}


def bessel_j(order: np.ndarray | float, x: np.ndarray) -> np.ndarray:
    """Return J_m(x) for whole m >= 0 and x >= 0, to about 1e-15.

    J_m is the mean of cos(mθ - x sin θ) around a circle (Watson, §2.2). With n equidistant points, the error is of the
    size of J_(n-m)(x), which falls faster than any power for n - m > x.
    """
    most, farthest = float(np.max(order)), float(np.max(x, initial=0.0))
    count = int(most + farthest + 14 * farthest ** (1 / 3) + 40)
    if count * np.size(x) > FEW:
        from scipy.special import jv

        found: np.ndarray = jv(order, x)
        return found
    # By symmetry, points between 0 and π are sufficient.
    angle = (np.arange(count) + 0.5) * (pi / count)
    waves = np.asarray(order)[..., None] * angle - np.asarray(x)[..., None] * np.sin(angle)
    return np.asarray(np.cos(waves).mean(axis=-1))


def bessel_j0(waves: Array, types: Precision, exactly: bool = True) -> Array:
    """Return J₀(2π waves) in the precision of `types`, for float64 `waves` >= 0.

    The error is about 1e-7 in float32. In float64, it is 1e-15 if `exactly` is True, else 1e-12.
    """
    import drjit as dr

    near, p, q = _series(types.dtype if exactly or types.dtype == "float32" else f"{types.dtype} to 1e-12")
    x = types.Float(waves) * (2 * pi)
    inside = x < SPLIT
    below, above = dr.minimum(x, SPLIT) / SPLIT, SPLIT / dr.maximum(x, SPLIT)
    small = _clenshaw(near, 2 * below * below - 1)
    t = 2 * above * above - 1
    eighth = waves - 0.125
    sin, cos = dr.sincos(types.Float(eighth - dr.round(eighth)) * (2 * pi))
    large = dr.sqrt(above * (2 / (pi * SPLIT))) * (_clenshaw(p, t) * cos - above * _clenshaw(q, t) * sin)
    return dr.select(inside, small, large)


@lru_cache(maxsize=3)
def _series(rounding: str) -> tuple[list[float], list[float], list[float]]:
    """Return the Chebyshev coefficients of three functions: J₀(x), P(x) and Q(x) · x/8.

    J₀ is a series in x² for x in [0, 8]. P and Q · x/8 are series in (8/x)² for x > 8. There,
    J₀(x) = √(2/(πx)) Re[(P + iQ) e^{i(x - π/4)}].

    rounding: key of TERMS, which contains the numbers of coefficients.
    """
    from scipy.special import hankel1e, j0

    inner, outer = TERMS[rounding]
    eighth_turn = np.exp(1j * pi / 4)

    def beyond(above: np.ndarray) -> np.ndarray:
        x = SPLIT / np.maximum(above, 1e-3)
        return np.sqrt(pi * x / 2) * hankel1e(0, x) * eighth_turn

    return (
        _fit(lambda y: j0(SPLIT * y), inner),
        _fit(lambda y: beyond(y).real, outer),
        _fit(lambda y: beyond(y).imag / np.maximum(y, 1e-3), outer),
    )


def _fit(function: Any, terms: int) -> list[float]:
    """Return Chebyshev coefficients of function(y) in t = 2y² - 1, y in [0, 1]."""
    t = np.cos(pi * (np.arange(64) + 0.5) / 64)
    return [float(c) for c in np.polynomial.chebyshev.chebfit(t, function(np.sqrt((t + 1) / 2)), terms - 1)]


def _clenshaw(coefficients: list[float], t: Array) -> Array:
    import drjit as dr

    b1, b2 = type(t)(0), type(t)(0)
    for c in reversed(coefficients[1:]):
        b1, b2 = dr.fma(2 * t, b1, c - b2), b1
    return dr.fma(t, b1, coefficients[0] - b2)
