"""Waves with known propagation: plane waves, beams, edges."""

from __future__ import annotations

import numpy as np
from scipy.special import fresnel, j0

__all__ = [
    "gaussian_beam",
    "gaussian_evanescent_power",
    "gaussian_field",
    "knife_edge_field",
    "plane_wave",
    "slit_field",
]


def plane_wave(x: np.ndarray, z: float, wavelength: float, fx: float) -> np.ndarray:
    """Return the plane wave exp(2πi(fx x + z(√(1/λ² - fx²) - 1/λ))) (Goodman §3.10.2).

    Beyond fx = 1/λ, it decays like exp(-2πz √(fx² - 1/λ²)). The carrier is omitted for evanescent waves, too.
    """
    axial = np.sqrt(complex(1 / wavelength**2 - fx**2))
    difference = -(fx**2) / (axial + 1 / wavelength)
    return np.exp(2j * np.pi * (fx * np.asarray(x) + z * difference))


def gaussian_beam(r: np.ndarray, wavelength: float, waist: float, z: float) -> np.ndarray:
    """Return the paraxial Gaussian beam w0/w exp(-r²/w² + ikr²/2R - iζ) (Siegman, Lasers, §17.1).

    The width is w = w0 √(1 + (z/z_R)²), the radius of curvature R = z + z_R²/z, and Gouy's phase ζ = arctan(z/z_R),
    with z_R = πw0²/λ.
    """
    rayleigh = np.pi * waist**2 / wavelength
    width = waist * np.hypot(1, z / rayleigh)
    curvature = z / (z**2 + rayleigh**2)
    r2 = np.asarray(r) ** 2
    phase = np.pi / wavelength * r2 * curvature - np.arctan2(z, rayleigh)
    return waist / width * np.exp(-r2 / width**2 + 1j * phase)


def gaussian_field(r: np.ndarray, wavelength: float, waist: float, z: float, *, nodes: int = 0) -> np.ndarray:
    """Return the exact field of exp(-r²/w0²) at distance z >= 0, summed from its angular spectrum.

    It is ∫ πw0² e^{-π²w0²f²} H(f) J0(2πfr) 2πf df, where H is the propagation of a plane wave over z, as in
    `plane_wave` (Goodman §3.10; the Hankel transform §2.1.5). The propagating part is integrated over θ with f = sin θ
    / λ, and the evanescent part over t with f = cosh t / λ, so that both integrands are smooth.
    """
    r = np.asarray(r, dtype=np.float64)
    top = min(np.pi / 2, float(np.arcsin(min(1, 6.1 * wavelength / (np.pi * waist)))))
    turns = 2 * np.pi / wavelength * (np.sin(top) * np.max(r, initial=0) + z * (1 - np.cos(top)))
    x, w = np.polynomial.legendre.leggauss(nodes or int(64 + turns))
    theta, weight = top * (x + 1) / 2, top * w / 2
    f, measure = np.sin(theta) / wavelength, weight * np.cos(theta) / wavelength
    field = _hankel(r, f, measure, waist, np.exp(-4j * np.pi * z / wavelength * np.sin(theta / 2) ** 2))
    if top == np.pi / 2:
        highest = np.arccosh(1 + 6.1 * wavelength / (np.pi * waist))
        t, weight = highest * (x + 1) / 2, highest * w / 2
        f, measure = np.cosh(t) / wavelength, weight * np.sinh(t) / wavelength
        decay = np.exp(-2 * np.pi * z / wavelength * (np.sinh(t) + 1j))
        field = field + _hankel(r, f, measure, waist, decay)
    return field


def gaussian_evanescent_power(wavelength: float, waist: float) -> float:
    """Return the share of the power of exp(-r²/w0²) at frequencies above 1/λ.

    It is exp(-2π²w0²/λ²), because the power spectrum is Gaussian.
    """
    return float(np.exp(-2 * (np.pi * waist / wavelength) ** 2))


def knife_edge_field(x: np.ndarray, wavelength: float, z: float) -> np.ndarray:
    """Return Fresnel's field behind an opaque half plane x < 0 in a unit plane wave.

    It is (1 - i)/2 (F(∞) + F(x √(2/λz))) with F(s) = ∫₀ˢ e^{iπt²/2} dt (Born & Wolf §8.7.3). The intensity at the edge
    is 1/4.
    """
    return (1 - 1j) / 2 * ((1 + 1j) / 2 + _fresnel_integral(np.asarray(x) * np.sqrt(2 / (wavelength * z))))


def slit_field(x: np.ndarray, half_width: float, wavelength: float, z: float) -> np.ndarray:
    """Return Fresnel's field behind a slit |x| < a in a unit plane wave, the difference of two edges (Goodman §4.5.1).

    The product of two such fields, one of x and one of y, is the field behind a rectangle.
    """
    scale = np.sqrt(2 / (wavelength * z))
    x = np.asarray(x)
    return (1 - 1j) / 2 * (_fresnel_integral((x + half_width) * scale) - _fresnel_integral((x - half_width) * scale))


def _fresnel_integral(s: np.ndarray) -> np.ndarray:
    sine, cosine = fresnel(s)
    return cosine + 1j * sine


def _hankel(r: np.ndarray, f: np.ndarray, measure: np.ndarray, waist: float, transfer: np.ndarray) -> np.ndarray:
    spectrum = np.pi * waist**2 * np.exp(-((np.pi * waist * f) ** 2)) * transfer * 2 * np.pi * f * measure
    return np.tensordot(j0(2 * np.pi * np.multiply.outer(r, f)), spectrum, axes=1)
