"""Rays through a real surface z = h(x), which show effects that a thin element omits.

Glass lies below the surface and vacuum above it. Light travels along +z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

__all__ = [
    "Corrugation",
    "RealLens",
    "caught_again",
    "corrugation",
    "deviation_glass_first",
    "deviation_relief_first",
    "real_lens",
    "refract",
    "thin_deviation",
    "transmission",
]


@dataclass(frozen=True)
class RealLens:
    """A relief whose mask is an ideal lens, and the focus of its real surface.

    aperture: NA of the ideal lens.
    height: height [m] of the relief.
    strehl: Strehl ratio of the real surface at its best focus.
    spread: distance between the paraxial and the marginal focus, divided by λ/NA².
    """

    aperture: float
    height: float
    strehl: float
    spread: float


@dataclass(frozen=True)
class Corrugation:
    """Effects of a corrugation on rays, all of which its mask transmits.

    depth: depth of the corrugation, relative to its period.
    reflected: fraction of the rays that are totally reflected.
    caught: fraction of the rays that hit the surface again.
    """

    depth: float
    reflected: float
    caught: float


def refract(slope: np.ndarray, n: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction (x, z) of a ray that leaves glass of index n at a slope of h; NaN for total reflection.

    Snell's law as a vector: t = n d + (√(1 - n²(1 - c²)) - n c) N, c = d·N, N = (-h', 1)/√(1 + h'²) (Born & Wolf,
    Principles of Optics, §3.2.2).
    """
    slope = np.asarray(slope, dtype=np.float64)
    c = 1 / np.sqrt(1 + slope**2)
    inside = 1 - n**2 * (1 - c**2)
    along = np.where(inside > 0, np.sqrt(np.maximum(inside, 0)), np.nan) - n * c
    return -along * slope * c, n + along * c


def deviation_glass_first(angle: float, n: float) -> float:
    """Return the deviation [rad] of a ray that leaves through a tilted surface; NaN if it is reflected.

    For the tilt α, it is arcsin(n sin α) - α.
    """
    sine = n * np.sin(angle)
    return float(np.arcsin(sine) - angle) if sine < 1 else float("nan")


def deviation_relief_first(angle: float, n: float) -> float:
    """Return the deviation [rad] of a ray that enters through a tilted surface and leaves through a flat one."""
    return float(np.arcsin(n * np.sin(angle - np.arcsin(np.sin(angle) / n))))


def thin_deviation(angle: float, n: float) -> float:
    """Return the deviation θ [rad] by the thin element exp(ik(n - 1)h); NaN for evanescent waves.

    sin θ = (n - 1) tan α for a surface with the tilt α.
    """
    sine = (n - 1) * np.tan(angle)
    return float(np.arcsin(sine)) if sine < 1 else float("nan")


def transmission(angle: float, n: float) -> float:
    """Return the share of unpolarised power that leaves glass through a tilted surface (Born & Wolf §1.5.3)."""
    cos_in, sine = np.cos(angle), n * np.sin(angle)
    if sine >= 1:
        return 0.0
    cos_out = np.sqrt(1 - sine**2)
    s = (n * cos_in - cos_out) / (n * cos_in + cos_out)
    p = (cos_in - n * cos_out) / (cos_in + n * cos_out)
    return float(1 - (s**2 + p**2) / 2)


def caught_again(height: Callable[[np.ndarray], np.ndarray], slope: np.ndarray, x: np.ndarray, n: float) -> np.ndarray:
    """Return the mask of the rays that hit the surface a second time.

    The rays leave the surface z = height(x) at the places x, at which it has these slopes.

    The surface must stay below its highest sampled point, above which a ray is free.
    """
    tx, tz = refract(slope, n)
    start = height(x)
    climb = start.max() - start
    caught = np.zeros(x.shape, dtype=bool)
    with np.errstate(invalid="ignore", divide="ignore"):
        reach = np.where(tz > 0, climb / tz, 0)  # a ray is traced until it is above the whole surface
        for share in np.linspace(0.002, 1, 500):
            caught |= start + share * reach * tz < height(x + share * reach * tx) - 1e-12 * np.ptp(start)
    return caught


def real_lens(aperture: float, focal_length: float, n: float, wavelength: float) -> RealLens:
    """Return results for the relief whose mask is an ideal lens. Light enters its flat side; its rim has z = 0."""
    radius = focal_length * aperture / np.sqrt(1 - aperture**2)
    height = (np.hypot(radius, focal_length) - focal_length) / (n - 1)
    nodes, weights = np.polynomial.legendre.leggauss(300)
    r2 = radius**2 * (nodes + 1) / 2
    h = height - (np.sqrt(r2 + focal_length**2) - focal_length) / (n - 1)

    # The Strehl ratio is |mean of exp(ikL)|² over the pupil's area, where L is the path to a focus at z.
    depth = wavelength / aperture**2
    z = focal_length + depth * np.linspace(-40, 40, 801)[:, None]
    path = n * h + np.sqrt(r2 + (z - h) ** 2)
    strehl = np.abs(np.exp(2j * np.pi / wavelength * (path - path[:, -1:])) @ weights / 2) ** 2
    tx, tz = refract(np.array(-aperture / (n - 1)), n)
    return RealLens(
        aperture, float(height), float(strehl.max()), float((height + focal_length + radius * tz / tx) / depth)
    )


def corrugation(depth: float, n: float) -> Corrugation:
    """Return the effects of a corrugation h = (d/2) sin(2πx) with the depth d and the period 1."""
    x = (np.arange(4000) + 0.5) / 4000
    slope = np.pi * depth * np.cos(2 * np.pi * x)
    lost = np.isnan(refract(slope, n)[0])
    again = caught_again(lambda at: depth / 2 * np.sin(2 * np.pi * at), slope, x, n)
    return Corrugation(depth, float(lost.mean()), float(again.mean()))
