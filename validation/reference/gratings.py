"""Gratings: fields and efficiencies of their orders, and Talbot distances."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import jv

from validation.reference.waves import plane_wave

__all__ = [
    "binary_grating_efficiency",
    "blazed_grating_efficiency",
    "grating_field",
    "paraxial_talbot_distance",
    "sinusoidal_grating_efficiency",
    "staircase_grating_efficiency",
    "talbot_distance",
]


def binary_grating_efficiency(order: int, depth: float, duty: float = 0.5) -> float:
    """Return the share of the light in order m of a thin phase grating with two levels.

    depth: difference of the two levels in waves.
    duty: fraction d of the period with the greater depth.

    The share is |1 + d(e^{2πi depth} - 1)|² in order 0, else 4 d² sin²(π depth) sinc²(m d). It is 40.5 % for m = 1 at
    half a wave and d = 1/2. Source: Fourier series of a rectangular wave; Goodman §4.4.
    """
    if order == 0:
        return float(np.abs(1 + duty * np.expm1(2j * np.pi * depth)) ** 2)
    return float(4 * duty**2 * np.sin(np.pi * depth) ** 2 * np.sinc(order * duty) ** 2)


def blazed_grating_efficiency(order: int, depth: float) -> float:
    """Return sinc²(depth - m), the share of the light in order m of a sawtooth that rises along +x.

    A depth of m waves sends all light to the order m. At the wavelength λ, a grating that is one wave deep at λ0 has
    the depth λ0/λ (Swanson 1989, MIT Lincoln Laboratory Technical Report 854).
    """
    return float(np.sinc(depth - order) ** 2)


def staircase_grating_efficiency(order: int, levels: int, depth: float = 1.0) -> float:
    """Return the share of the light in order m of a sawtooth of `depth` waves, made of L equal steps of depth/L.

    It is sinc²(m/L) [sin π(depth - m) / (L sin(π(depth - m)/L))]². In the design order it is sinc²(1/L): 40.5, 81.1,
    95.0 and 98.7 % for 2, 4, 8 and 16 levels (Swanson 1989).
    """
    off = depth - order
    wraps = np.isclose(off / levels, round(off / levels), rtol=0, atol=1e-12)
    many = 1.0 if wraps else np.sin(np.pi * off) / (levels * np.sin(np.pi * off / levels))
    return float(np.sinc(order / levels) ** 2 * many**2)


def sinusoidal_grating_efficiency(order: int, depth: float) -> float:
    """Return J_m(π depth)², the share of the light in order m of a sinusoidal phase grating (Goodman §4.4.4).

    Its phase is π depth sin(2πx/d), which varies by `depth` waves from crest to trough.
    """
    return float(jv(order, np.pi * depth) ** 2)


def grating_field(
    x: np.ndarray, z: float, wavelength: float, period: float, orders: Mapping[int, complex]
) -> np.ndarray:
    """Return the exact field at distance z of Σ c_m exp(2πi m x/d), where orders = {m: c_m}.

    Each order is a plane wave.
    """
    return np.sum([c * plane_wave(x, z, wavelength, m / period) for m, c in orders.items()], axis=0)


def talbot_distance(period: float, wavelength: float) -> float:
    """Return the distance at which orders -1, 0 and 1 are in phase again: z = λ / (1 - √(1 - λ²/d²)), exactly.

    It follows from k z (1 - cos θ) = 2π, sin θ = λ/d (Rayleigh 1881, Phil. Mag. 11:196).
    """
    sine2 = (wavelength / period) ** 2
    return wavelength * (1 + np.sqrt(1 - sine2)) / sine2


def paraxial_talbot_distance(period: float, wavelength: float) -> float:
    """Return 2d²/λ: the limit of `talbot_distance` for d >> λ (Goodman §4.5.2)."""
    return 2 * period**2 / wavelength
