"""Aberrations of a circular pupil: Zernike polynomials, and Strehl ratios.

Coefficients are in waves and belong to the peak terms W020 ρ², W040 ρ⁴, W131 ρ³ cos θ and W222 ρ² cos² θ. Strehl ratios
are paraxial: |<e^{2πiW}>|², a mean over the unit disk. They are the intensity at the centre of the reference sphere,
which may differ from the highest intensity.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import quad
from scipy.special import fresnel, j0

__all__ = [
    "RMS_PER_WAVE",
    "marechal_strehl",
    "noll_index",
    "strehl_astigmatism",
    "strehl_coma",
    "strehl_defocus",
    "strehl_of_wavefront",
    "strehl_spherical",
    "zernike",
]

# σ/W of each aberration alone, and balanced by the lower one that minimises σ (Born & Wolf §9.2; Mahajan 1983).
RMS_PER_WAVE = {
    "defocus": 1 / (2 * math.sqrt(3)),
    "spherical": 2 / (3 * math.sqrt(5)),
    "balanced spherical": 1 / (6 * math.sqrt(5)),
    "coma": 1 / (2 * math.sqrt(2)),
    "balanced coma": 1 / (6 * math.sqrt(2)),
    "astigmatism": 1 / 4,
    "balanced astigmatism": 1 / (2 * math.sqrt(6)),
}


def marechal_strehl(sigma: float) -> float:
    """Return exp(-(2πσ)²) for a wavefront of RMS σ in waves; accurate below 0.1 (Mahajan 1983, JOSA 73:860)."""
    return math.exp(-((2 * math.pi * sigma) ** 2))


def strehl_defocus(w: float) -> float:
    """Return [sin(πW)/(πW)]² for a peak defocus of W = W020 waves (Born & Wolf §8.8.2, u = 4πW)."""
    return float(np.sinc(w) ** 2)


def strehl_spherical(w: float, defocus: float = 0.0) -> float:
    """Return |∫₀¹ exp(2πi(W040 t² + W020 t)) dt|², t = ρ², by Fresnel integrals (Born & Wolf §9.3).

    With W020 = -W040, defocus balances the spherical aberration.
    """
    if w == 0:
        return strehl_defocus(defocus)
    scale, middle = 2 * math.sqrt(abs(w)), math.copysign(1, w) * defocus / (2 * abs(w))
    sine, cosine = fresnel(scale * (np.array([0.0, 1.0]) + middle))
    return float((np.diff(cosine)[0] ** 2 + np.diff(sine)[0] ** 2) / scale**2)


def strehl_coma(w: float, tilt: float = 0.0) -> float:
    """Return |∫₀¹ J0(2π(W131 t^{3/2} + W111 t^{1/2})) dt|², t = ρ² (Mahajan 1983).

    With W111 = -2 W131/3, tilt balances the coma.
    """
    value, _ = quad(lambda rho: 2 * rho * j0(2 * np.pi * (w * rho**3 + tilt * rho)), 0, 1, epsabs=1e-13, limit=200)
    return value**2


def strehl_astigmatism(w: float, defocus: float = 0.0) -> float:
    """Return |∫₀¹ J0(πW222 t) exp(2πi(W020 + W222/2) t) dt|², t = ρ² (Mahajan 1983).

    With W020 = -W222/2, defocus balances the astigmatism.
    """

    def integrand(t: float) -> complex:
        return j0(np.pi * w * t) * np.exp(2j * np.pi * (defocus + w / 2) * t)

    value, _ = quad(integrand, 0, 1, epsabs=1e-13, limit=200, complex_func=True)
    return abs(value) ** 2


def strehl_of_wavefront(wavefront: np.ndarray, weight: np.ndarray) -> float:
    """Return |Σ w e^{2πiW}|² / (Σ w)² for W in waves on nodes of the disk with quadrature weights."""
    return float(np.abs(np.sum(weight * np.exp(2j * np.pi * wavefront)) / np.sum(weight)) ** 2)


def noll_index(j: int) -> tuple[int, int]:
    """Return (n, m) of Noll's j >= 1: m > 0 is the cosine, m < 0 the sine (Noll 1976, JOSA 66:207, table I).

    Raises:
        ValueError: j is less than 1.
    """
    if j < 1:
        raise ValueError(f"j = {j}: must be at least 1")
    n = (math.isqrt(8 * j - 7) - 1) // 2
    place = j - n * (n + 1) // 2 - 1
    m = 2 * ((place + 1) // 2) if n % 2 == 0 else 2 * (place // 2) + 1
    return n, m if j % 2 == 0 else -m


def zernike(j: int, rho: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return Noll's polynomial Z_j, which has RMS 1 over the unit disk (Noll 1976, eqs. 1, 2).

    It is √(n+1) R_n^m √2 cos mθ, or the same with sin mθ, and √(n+1) R_n^0 for m = 0. All Z_j are orthogonal.
    """
    n, m = noll_index(j)
    radial = np.zeros(np.shape(rho))
    for s in range((n - abs(m)) // 2 + 1):
        a, b = (n + abs(m)) // 2 - s, (n - abs(m)) // 2 - s
        c = (-1) ** s * math.factorial(n - s) / (math.factorial(s) * math.factorial(a) * math.factorial(b))
        radial = radial + c * np.asarray(rho) ** (n - 2 * s)
    angular = 1.0 if m == 0 else math.sqrt(2) * (np.cos(m * theta) if m > 0 else np.sin(-m * theta))
    return math.sqrt(n + 1) * radial * angular
