"""Circular apertures: Airy's paraxial far field, and the exact integral on the axis."""

from __future__ import annotations

import numpy as np
from scipy.special import j0, j1, jn_zeros

__all__ = [
    "AIRY_ZEROS",
    "airy_encircled_energy",
    "airy_psf",
    "circular_aperture_fraunhofer",
    "circular_aperture_on_axis",
    "circular_aperture_power",
    "circular_mtf",
    "converging_wave_at_focus",
]

# Zeros of J1: the Airy pattern's dark rings in v = 2π R r / (λ f).
AIRY_ZEROS = jn_zeros(1, 10)


def airy_psf(r: np.ndarray, wavelength: float, radius: float, focal_length: float) -> np.ndarray:
    """Return the Airy pattern of unit power [1/m²] (Born & Wolf §8.5.2, eq. 14).

    It is πR²/(λf)² (2 J1(v)/v)² with v = 2πRr/(λf).
    """
    v = 2 * np.pi * radius * np.asarray(r, dtype=np.float64) / (wavelength * focal_length)
    return np.pi * radius**2 / (wavelength * focal_length) ** 2 * _jinc(v) ** 2


def airy_encircled_energy(r: np.ndarray, wavelength: float, radius: float, focal_length: float) -> np.ndarray:
    """Return the fraction of the power within the radius r, 1 - J0(v)² - J1(v)² (Born & Wolf §8.5.2, eq. 18).

    v is that of `airy_psf`.
    """
    v = 2 * np.pi * radius * np.asarray(r, dtype=np.float64) / (wavelength * focal_length)
    return 1 - j0(v) ** 2 - j1(v) ** 2


def circular_mtf(f: np.ndarray, wavelength: float, radius: float, focal_length: float) -> np.ndarray:
    """Return the MTF of Airy's pattern at spatial frequencies f [1/m], which is the overlap of two disks.

    It is 2/π (arccos s - s √(1 - s²)) with s = f λ f# = f λ focal_length / (2R), and 0 beyond s = 1 (Goodman §6.4.2,
    eq. 6-32).
    """
    s = np.clip(np.abs(f) * wavelength * focal_length / (2 * radius), 0, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))


def circular_aperture_on_axis(radius: float, distance: float, wavelength: float) -> float:
    """Return the intensity on the axis behind a circular aperture in a unit plane wave.

    It is the exact first Rayleigh-Sommerfeld integral, |1 - (z/ρ) e^{ik(ρ - z)}|² with ρ = √(z² + R²) (Osterberg &
    Smith 1961, JOSA 51:1050).
    """
    edge = np.hypot(distance, radius)
    excess = radius**2 / (edge + distance)
    return float(np.abs(1 - distance / edge * np.exp(2j * np.pi * excess / wavelength)) ** 2)


def converging_wave_at_focus(radius: float, distance: float, wavelength: float) -> complex:
    """Return the exact field at the focus of exp(-ik(L(ρ) - z)), L = √(ρ² + z²), behind a circular aperture.

    It is 1 - z/L - ikz ln(L/z), where L belongs to the edge. This is the first Rayleigh-Sommerfeld integral
    ∫ z/(2πL²) (1/L - ik) 2πρ dρ (Goodman §3.5), with ρ dρ = L dL. For R << z, the squared modulus of the field is that
    of Airy's peak, |kR²/2z|².
    """
    tangent2 = (radius / distance) ** 2
    secant = np.sqrt(1 + tangent2)
    k = 2 * np.pi / wavelength
    return complex(tangent2 / (secant * (secant + 1)), -k * distance * np.log1p(tangent2) / 2)


def circular_aperture_fraunhofer(r: np.ndarray, wavelength: float, radius: float, distance: float) -> np.ndarray:
    """Return the intensity far behind a circular aperture in a unit plane wave (R²/(λz) << 1), at any angle.

    It is |πR²/(λD) (z/D) 2 J1(v)/v|² with v = kR r/D and D = √(r² + z²). This is the first Rayleigh-Sommerfeld integral
    with the phase k(D - r·ρ/D). Goodman §4.4.2 is the paraxial limit.
    """
    slant = np.hypot(r, distance)
    v = 2 * np.pi * radius * np.asarray(r) / (wavelength * slant)
    return (np.pi * radius**2 * distance / (wavelength * slant**2) * _jinc(v)) ** 2


def circular_aperture_power(radius: float, wavelength: float) -> float:
    """Return the fraction of a circular aperture's power in waves that propagate: 1 - J0(kR)² - J1(kR)².

    The aperture's power spectrum is Airy's pattern in the direction sines; sines above 1 are evanescent (Parseval)."""
    return float(airy_encircled_energy(np.ones(1), wavelength, radius, 1.0)[0])


def _jinc(v: np.ndarray) -> np.ndarray:
    """Return 2 J1(v)/v."""
    safe = np.where(v == 0, 1.0, v)
    return np.where(v == 0, 1.0, 2 * j1(safe) / safe)
