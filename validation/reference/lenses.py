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
    """Return the image distance z, 1/z = 1/f - 1/s (Born & Wolf §4.4); negative for a virtual image."""
    return 1 / (1 / focal_length - 1 / source_distance)


def refractive_focal_length(radius_of_curvature: float, n: float, medium_n: float = 1.0) -> float:
    """Return f = n_m R_c / (n(λ) - n_m), plano-convex, n_m on both sides (lensmaker's equation, Born & Wolf §4.4)."""
    return medium_n * radius_of_curvature / (n - medium_n)


def diffractive_focal_length(focal_length: float, design_wavelength: float, wavelength: float, order: int = 1) -> float:
    """Return f(λ) = f0 λ0 / (m λ) of a diffractive lens (Swanson 1989).

    Its zones are fixed, so the deflection grows with λ. This dispersion is opposite to that of glass, and many times
    stronger.
    """
    return focal_length * design_wavelength / (order * wavelength)


def kinoform_on_axis(
    wavelength: float, design_wavelength: float, radius: float, focal_length: float, order: int = 1
) -> tuple[float, float]:
    """Return the focal length [m] of an order of a kinoform, and the PSF [1/m²] in this focus.

    The kinoform is a wrapped paraboloid with a depth of one wave and the focal length f0 at λ0. The results are
    f = f0 λ0/(mλ) and sinc²(λ0/λ - m) πR²/(λf)². They are paraxial, and exact in this limit if the pupil contains whole
    zones, R² = 2 M λ0 f0. As a function of ρ², the pupil is then a blazed grating, and the field on the axis is one of
    its Fourier coefficients (Buralli, Morris & Rogers 1989, Appl. Opt. 28:976).
    """
    focus = diffractive_focal_length(focal_length, design_wavelength, wavelength, order)
    off = math.pi * (design_wavelength / wavelength - order)
    efficiency = 1.0 if off == 0 else (math.sin(off) / off) ** 2
    return focus, efficiency * math.pi * radius**2 / (wavelength * focus) ** 2


def pinhole_radius(wavelength: float, distance: float) -> float:
    """Return the radius of the sharpest pinhole, R = √(0.742 λz), which has the highest peak per unit of light.

    Fresnel's intensity on the axis is 4 sin²(πN/2) with N = R²/(λz). The PSF's peak is therefore 4 sin²(πN/2) / (πλzN),
    which is highest at tan(πN/2) = πN. This radius lies between √(0.61 λz), at which the pinhole is as wide as its Airy
    disk, and √(λz), at which the axis is brightest (Rayleigh 1891, Phil. Mag. 31:87; Young 1971, Appl. Opt. 10:2763).
    """
    return math.sqrt(PINHOLE_FRESNEL_NUMBER * wavelength * distance)
