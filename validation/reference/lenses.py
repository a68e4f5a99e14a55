"""Focal lengths of lenses, zone plates and pinholes, over distance and wavelength."""

from __future__ import annotations

import math

__all__ = [
    "PINHOLE_FRESNEL_NUMBER",
    "diffractive_focal_length",
    "kinoform_on_axis",
    "pinhole_radius",
    "refractive_focal_length",
    "thin_lens_image_distance",
]

# Root of tan x = 2x is x = πN/2 = 1.16556: the Fresnel number at which a pinhole's PSF has its highest peak.
PINHOLE_FRESNEL_NUMBER = 0.742019


def thin_lens_image_distance(focal_length: float, source_distance: float) -> float:
    """z of 1/z = 1/f - 1/s (Born & Wolf §4.4); negative for a virtual image."""
    return 1 / (1 / focal_length - 1 / source_distance)


def refractive_focal_length(radius_of_curvature: float, n: float, medium_n: float = 1.0) -> float:
    """f = n_m R_c / (n(λ) - n_m), plano-convex, n_m on both sides (lensmaker's equation, Born & Wolf §4.4)."""
    return medium_n * radius_of_curvature / (n - medium_n)


def diffractive_focal_length(focal_length: float, design_wavelength: float, wavelength: float, order: int = 1) -> float:
    """f(λ) = f0 λ0 / (m λ): zones are fixed, so the deflection grows with λ (Swanson 1989; opposite to, and many times
    stronger than, the dispersion of glass)."""
    return focal_length * design_wavelength / (order * wavelength)


def kinoform_on_axis(
    wavelength: float, design_wavelength: float, radius: float, focal_length: float, order: int = 1
) -> tuple[float, float]:
    """Focus [m] of an order, and the PSF [1/m²] there, of a wrapped paraboloid with depth λ0 and f0 at λ0:

    f = f0 λ0/(mλ), sinc²(λ0/λ - m) πR²/(λf)². This is the paraxial limit, in which it is exact if the pupil contains
    whole zones, R² = 2 M λ0 f0: over ρ² the pupil is a blazed grating, and the field on the axis is one Fourier
    coefficient (Buralli, Morris & Rogers 1989, Appl. Opt. 28:976).
    """
    focus = diffractive_focal_length(focal_length, design_wavelength, wavelength, order)
    off = math.pi * (design_wavelength / wavelength - order)
    efficiency = 1.0 if off == 0 else (math.sin(off) / off) ** 2
    return focus, efficiency * math.pi * radius**2 / (wavelength * focus) ** 2


def pinhole_radius(wavelength: float, distance: float) -> float:
    """Sharpest pinhole: R = √(0.742 λz) has the highest peak per unit of light.

    Fresnel's axial intensity is 4 sin²(πN/2), N = R²/(λz), so the PSF's peak is 4 sin²(πN/2) / (πλzN), highest at
    tan(πN/2) = πN. It lies between the radius that equals its Airy radius, √(0.61 λz), and the radius with the
    brightest axis, √(λz) (Rayleigh 1891, Phil. Mag. 31:87; Young 1971, Appl. Opt. 10:2763).
    """
    return math.sqrt(PINHOLE_FRESNEL_NUMBER * wavelength * distance)
