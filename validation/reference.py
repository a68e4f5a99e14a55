"""Closed forms and converged quadratures in float64: what the package is measured against.

Nothing here imports the package. Each function names its formula and source.
"""

from __future__ import annotations

import numpy as np
from scipy.special import j0, j1, jn_zeros

__all__ = [
    "AIRY_ZEROS",
    "airy_encircled_energy",
    "airy_psf",
    "circular_aperture_on_axis",
    "ideal_lens_field",
    "relative_l2",
]

# Zeros of J1: the Airy pattern's dark rings in v = 2π R r / (λ f).
AIRY_ZEROS = jn_zeros(1, 10)


def airy_psf(r: np.ndarray, wavelength: float, radius: float, focal_length: float) -> np.ndarray:
    """Airy pattern, unit power [1/m²]: πR²/(λf)² (2 J1(v)/v)², v = 2πRr/(λf) (Born & Wolf §8.5.2, eq. 14)."""
    v = 2 * np.pi * radius * np.asarray(r, dtype=np.float64) / (wavelength * focal_length)
    safe = np.where(v == 0, 1.0, v)
    amplitude = np.where(v == 0, 1.0, 2 * j1(safe) / safe)
    return np.pi * radius**2 / (wavelength * focal_length) ** 2 * amplitude**2


def airy_encircled_energy(r: np.ndarray, wavelength: float, radius: float, focal_length: float) -> np.ndarray:
    """1 - J0(v)² - J1(v)² (Born & Wolf §8.5.2, eq. 18)."""
    v = 2 * np.pi * radius * np.asarray(r, dtype=np.float64) / (wavelength * focal_length)
    return 1 - j0(v) ** 2 - j1(v) ** 2


def circular_aperture_on_axis(radius: float, distance: float, wavelength: float) -> float:
    """On-axis intensity behind a circular aperture in a unit plane wave, first Rayleigh-Sommerfeld integral, exact:
    |1 - (z/ρ) e^{ik(ρ - z)}|², ρ = √(z² + R²) (Osterberg & Smith 1961, JOSA 51:1050)."""
    edge = np.hypot(distance, radius)
    excess = radius**2 / (edge + distance)
    return float(np.abs(1 - distance / edge * np.exp(2j * np.pi * excess / wavelength)) ** 2)


def ideal_lens_field(
    r: np.ndarray,
    wavelength: float,
    radius: float,
    focal_length: float,
    distance: float | None = None,
    *,
    nodes: int | None = None,
) -> np.ndarray:
    """Field of an ideal lens exp(-ik(√(ρ² + f²) - f)) in a unit plane wave at radii r of the plane z = distance.

    First Rayleigh-Sommerfeld integral (Goodman §3.5), U = ∫∫ P z/(2πD²) (1/D - ik) e^{ikD} ρ dρ dφ: Gauss-Legendre in
    ρ, trapezoid in φ (half the circle by symmetry), twice as many nodes as the phase has half waves.
    """
    z = focal_length if distance is None else distance
    k = 2 * np.pi / wavelength
    r = np.atleast_1d(np.asarray(r, dtype=np.float64))
    slope = radius / np.hypot(radius, focal_length) + (radius + r.max()) / np.hypot(radius + r.max(), z)
    n = nodes or int(64 + 4 * radius * slope / wavelength)
    x, w = np.polynomial.legendre.leggauss(n)
    rho, weight = radius * (x + 1) / 2, radius * w / 2
    m = n + 32
    cosine = np.cos(np.pi * (np.arange(m) + 0.5) / m)
    lens = np.exp(-1j * k * rho**2 / (np.hypot(rho, focal_length) + focal_length)) * weight * rho * 2 * np.pi / m
    field = np.empty(r.shape, dtype=np.complex128)
    for i, radius_out in enumerate(r):
        d2 = rho[:, None] ** 2 + radius_out**2 - 2 * rho[:, None] * radius_out * cosine
        d = np.sqrt(d2 + z**2)
        kernel = z / (2 * np.pi * d**2) * (1 / d - 1j * k) * np.exp(1j * k * d2 / (d + z))
        field[i] = lens @ kernel.sum(axis=1)
    return field


def relative_l2(value: np.ndarray, reference: np.ndarray, weight: np.ndarray | float = 1.0) -> float:
    """√(Σ w (a - b)² / Σ w b²): with w = r over radial samples, the area-weighted error."""
    difference = np.sum(weight * (np.asarray(value, dtype=np.float64) - reference) ** 2)
    return float(np.sqrt(difference / np.sum(weight * np.asarray(reference, dtype=np.float64) ** 2)))
