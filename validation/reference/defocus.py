"""Light near a focus, paraxially: Lommel's functions."""

from __future__ import annotations

import numpy as np
from scipy.special import hyp0f1, jv

__all__ = ["defocused_psf", "lommel_intensity"]


def lommel_intensity(u: np.ndarray | float, v: np.ndarray | float) -> np.ndarray:
    """Return |∫₀¹ J0(vρ) e^{-iuρ²/2} 2ρ dρ|² by Lommel's functions (Born & Wolf §8.8.1).

    In the shadow, |u| < |v|, it is (2/u)² (U1² + U2²). In the light, it is (2/u)² (1 + V0² + V1² - 2 V0 cos w - 2 V1
    sin w) with w = (u + v²/u)/2. Special cases are 1 at the focus, Airy's pattern at u = 0, and sin²(u/4)/(u/4)² at v =
    0.
    """
    u, v = np.broadcast_arrays(np.abs(np.asarray(u, dtype=np.float64)), np.abs(np.asarray(v, dtype=np.float64)))
    near = np.maximum(u, v) < 2
    shadow = ~near & (u < v)
    light = ~near & ~shadow
    out = np.empty(u.shape)
    for where, series in ((near, _near_the_focus), (shadow, _shadow), (light, _light)):
        out[where] = series(u[where], v[where])
    return out


def defocused_psf(r: np.ndarray, wavelength: float, radius: float, focal_length: float, distance: float) -> np.ndarray:
    """Return Fresnel's PSF [1/m²], of unit power, behind a thin lens exp(-ikρ²/2f), on the plane z = distance.

    It is πR²/(λz)² I(u, v) with u = kR²(1/z - 1/f), v = kRr/z, where I is `lommel_intensity`. Without the Debye
    approximation, this holds at any Fresnel number (Li & Wolf 1984, JOSA A 1:801). An infinite focal length is the bare
    aperture. For a source at the distance s, replace 1/f by 1/f - 1/s (`thin_lens_image_distance`).
    """
    k = 2 * np.pi / wavelength
    u, v = k * radius**2 * (1 / distance - 1 / focal_length), k * radius * np.asarray(r) / distance
    return np.pi * radius**2 / (wavelength * distance) ** 2 * lommel_intensity(u, v)


def _shadow(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return (2/u)² (U1² + U2²) with U_n = Σ (-1)^s (u/v)^{n+2s} J_{n+2s}(v), for u < v."""
    total = np.zeros((2, *u.shape))
    for order in range(1, _orders(v)):
        total[(order - 1) % 2] += (-1) ** ((order - 1) // 2) * (u / v) ** (order - 1) * 2 / v * jv(order, v)
    return np.sum(total**2, axis=0)


def _near_the_focus(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the result of `_shadow`, computed with J_n(v) = (v/2)^n / n! 0F1(n + 1, -v²/4).

    For small u and v, this avoids quotients of small numbers.
    """
    total = np.zeros((2, *u.shape))
    factorial = 1.0
    for order in range(1, 32):
        factorial *= order
        term = (u / 2) ** (order - 1) / factorial * hyp0f1(order + 1, -(v**2) / 4)
        total[(order - 1) % 2] += (-1) ** ((order - 1) // 2) * term
    return np.sum(total**2, axis=0)


def _light(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the intensity of `lommel_intensity` in the light, with V_n = Σ (-1)^s (v/u)^{n+2s} J_{n+2s}(v)."""
    v0, v1 = np.zeros(u.shape), np.zeros(u.shape)
    for s in range(_orders(v) // 2 + 1):
        v0 += (-1) ** s * (v / u) ** (2 * s) * jv(2 * s, v)
        v1 += (-1) ** s * (v / u) ** (2 * s + 1) * jv(2 * s + 1, v)
    w = (u + v**2 / u) / 2
    return (2 / u) ** 2 * (1 + v0**2 + v1**2 - 2 * v0 * np.cos(w) - 2 * v1 * np.sin(w))


def _orders(v: np.ndarray) -> int:
    """Return an order n beyond which J_n(v) vanishes in float64: v plus a few v^(1/3), and a margin."""
    largest = float(v.max(initial=0))
    return int(largest + 8 * largest ** (1 / 3) + 24)
