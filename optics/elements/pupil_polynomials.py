"""Reliefs and wavefronts that are polynomials of the position, as coefficients of x^j y^i.

Sums of powers are faster to evaluate for many pupils at once than B-splines and Zernike polynomials.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from optics.elements.relief import BSplineRelief
from optics.elements.wavefront import UM, Zernike
from optics.elements.zernike_modes import norm
from optics.numerics.autodiff import plain

if TYPE_CHECKING:
    from optics.elements.pupil import Pupil

__all__ = ["HIGHEST_ORDER", "power_sum", "powers_of"]

HIGHEST_ORDER = 16  # choice: highest order of Zernike polynomials; higher orders lose digits as sums of powers
# B-splines in powers of x in [-1, 1], (spline, power): `cubic_bsplines` at t = (1 + x)/2.
SPLINES = np.array([[1, -3, 3, -1], [23, -15, -3, 3], [23, 15, -3, -3], [1, 3, 3, 1]]) / 48
FEW_WAVES = 50.0  # choice: sum of all coefficients [waves] up to which float32 is sufficient


def powers_of(pupil: Pupil, wavelength: float, step: float) -> np.ndarray | None:
    """Return the polynomial coefficients of the phase [waves] of relief and wavefront, (power of y, power of x).

    The constant term is set to 0. Positions are in units of the pupil's radius. The result is None if the relief is not
    a B-spline patch, or if the wavefront does not consist of Zernike polynomials of orders up to HIGHEST_ORDER. If
    `step` is 0, the relief is ignored.

    wavelength: wavelength [m] in vacuum.
    step: difference of refractive indices at the relief.
    """
    relief, wavefront, found = pupil.height if step else None, pupil.wavefront, np.zeros((1, 1))
    if relief is not None and not isinstance(relief, BSplineRelief):
        return None
    if wavefront is not None and not (isinstance(wavefront, Zernike) and wavefront.order <= HIGHEST_ORDER):
        return None
    if relief is not None:
        found = SPLINES.T @ plain(relief.control_points) @ SPLINES * (step / wavelength)
    if wavefront is not None:
        of_relief, size = found, max(len(found), wavefront.order + 1)
        found = np.zeros((size, size))
        found[: len(of_relief), : len(of_relief)] = of_relief
        modes = {mode: value for mode, value in wavefront.modes.items() if value != 0}
        if modes:
            powers = _powers_of_modes(tuple(modes))
            own = (np.array([*modes.values()]) * (UM / wavelength) @ powers.reshape(len(modes), -1)).reshape(
                powers[0].shape
            )
            if wavefront.radius is not None:
                lengths = (pupil.radius / wavefront.radius) ** np.arange(len(own))
                own = own * lengths * lengths[:, None]
            found[: len(own), : len(own)] -= own
    found[0, 0] = 0.0  # a constant phase does not affect the light, but would need digits
    return found


def power_sum(coefficients: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return Σ c[i, j] y^i x^j for each of many beams, (beam, y, x), by Horner's rule.

    coefficients: c, (beam, power of y, power of x).
    x, y: positions (beam, y, x) in units of the radius.
    """
    if np.abs(coefficients).sum(axis=(1, 2)).max() < FEW_WAVES:
        coefficients, x, y = (part.astype(np.float32) for part in (coefficients, x, y))
    present = np.abs(coefficients).max(axis=0) > 0
    total: np.ndarray | None = None
    for i in reversed(range(len(present))):
        line: np.ndarray | None = None
        for j in reversed(range(len(present))):
            c = coefficients[:, i, j, None, None] if present[i, j] else None
            line = _next(line, x, c)
        total = _sum(None if total is None else np.multiply(total, y, out=total), line)
    return np.zeros_like(x) if total is None else total


def _next(line: np.ndarray | None, x: np.ndarray, c: np.ndarray | None) -> np.ndarray | None:
    """Return line · x + c, where None counts as 0."""
    if line is None:
        return None if c is None else np.broadcast_to(c, x.shape).copy()
    np.multiply(line, x, out=line)
    return line if c is None else np.add(line, c, out=line)


def _sum(a: np.ndarray | None, b: np.ndarray | None) -> np.ndarray | None:
    if a is None or b is None:
        return b if a is None else a
    return np.add(a, b, out=a)


@lru_cache(maxsize=32)
def _powers_of_modes(modes: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Return the coefficients of several Zernike polynomials, (mode, power of y, power of x)."""
    size = max(n for n, _ in modes) + 1
    found = np.zeros((len(modes), size, size))
    for own, (n, m) in zip(found, modes, strict=True):
        own[: n + 1, : n + 1] = _mode_powers(n, m)
    return found


@lru_cache(maxsize=(HIGHEST_ORDER + 1) * (HIGHEST_ORDER + 2) // 2)
def _mode_powers(n: int, m: int) -> np.ndarray:
    """Return Z_n^m as coefficients of y^i x^j (Thibos et al. 2002, eq. 3), (n + 1, n + 1)."""
    found, order = np.zeros((n + 1, n + 1)), abs(m)
    for s in range((n - order) // 2 + 1):
        k = (n - order) // 2 - s  # the term is proportional to ρ^order (x² + y²)^k
        radial = (-1) ** s * math.factorial(n - s)
        radial //= math.factorial(s) * math.factorial(k + order) * math.factorial(k)
        for b in range(k + 1):
            for i in range(order + 1):
                # ρ^order cos(order θ) and sin(order θ) are the real and imaginary part of (x + iy)^order.
                real, sign = i % 2 == 0, (-1) ** (i // 2)
                if real == (m >= 0):
                    found[2 * b + i, 2 * (k - b) + order - i] += radial * math.comb(k, b) * math.comb(order, i) * sign
    return found * norm(n, m)
