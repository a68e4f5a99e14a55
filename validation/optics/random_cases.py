"""Random pupils, apertures, distances, windows and tolerances over the whole domain of the planner."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import optics
from optics.apertures.aperture import Aperture

__all__ = ["KINDS", "OPENINGS", "WAVELENGTH", "Case", "draw_case"]

WAVELENGTH = 550e-9
FRESNEL_NUMBERS = (1e-2, 1e3)
APERTURES = (1e-2, 0.7)
TALLEST_RELIEF = 40e-6
SIDES = (17, 257)
COARSE, COARSEST = 0.25, 4.0  # share of windows with a pitch of 0.3 to COARSEST times λz/2R
LOOSEST = 3e-2
TIGHTEST = {"float32": 1e-5, "float64": 1e-8}
KINDS = {"flat": 0.1, "lens": 0.15, "B-spline": 0.35, "lens + B-spline": 0.3, "height map": 0.1}
OPENINGS = {"circle": 0.4, "annulus": 0.15, "slit": 0.2, "regular polygon": 0.1, "star": 0.15}


@dataclass(frozen=True)
class Case:
    """A random case.

    aperture: NA = R/√(R² + z²).
    relief: peak height of a relief [m], 0 without.
    window: dx and shape.
    """

    kind: str
    opening: str
    pupil: optics.Pupil
    distance: float
    window: dict[str, Any]
    tolerance: float
    dtype: str
    fresnel_number: float
    aperture: float
    relief: float

    def psf(self, method: str = "auto") -> optics.PSFResult:
        asked = {"tolerance": self.tolerance, "dtype": self.dtype, "method": method}
        return optics.psf(self.pupil, [WAVELENGTH], self.distance, **self.window, **asked)

    def __str__(self) -> str:
        height, width = self.window["shape"]
        return (
            f"{self.kind} in a {self.opening}, Fresnel number {self.fresnel_number:.3g}, NA {self.aperture:.3g}, "
            f"relief {self.relief:.2g} m, n {self.pupil.n.a:.3g}, {height} x {width} at {self.window['dx']:.3g} m, "
            f"tolerance {self.tolerance:.2g}, {self.dtype}"
        )


def draw_case(rng: np.random.Generator) -> Case:
    """Draw Fresnel number, NA, relief height and tolerance log-uniformly.

    Windows cover a part of the light or all of it.
    """
    fresnel_number, aperture = (_log_uniform(rng, *ends) for ends in (FRESNEL_NUMBERS, APERTURES))
    tangent = aperture / math.sqrt(1 - aperture**2)
    radius = fresnel_number * WAVELENGTH / tangent
    distance = radius / tangent
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    relief = _log_uniform(rng, 1e-7, TALLEST_RELIEF) if kind not in ("flat", "lens") else 0.0
    surface: Any = None
    if "B-spline" in kind:
        surface = optics.BSplineRelief(rng.random((4, 4)) * relief)
    elif kind == "height map":
        surface = _hills(rng) * relief
    lens = distance if "lens" in kind else None
    opening = str(rng.choice(list(OPENINGS), p=list(OPENINGS.values())))
    shape = {"n": rng.uniform(1.05, 2.0), "aperture": _aperture(rng, opening)}
    pupil = optics.Pupil(radius, surface, thin_lens_focal_length=lens, **shape)
    window = _window(rng, radius, distance, lens is not None)
    dtype = str(rng.choice(["float32", "float64"]))
    tolerance = _log_uniform(rng, TIGHTEST[dtype], LOOSEST)
    return Case(kind, opening, pupil, distance, window, tolerance, dtype, fresnel_number, aperture, relief)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10 ** rng.uniform(math.log10(low), math.log10(high)))


def _aperture(rng: np.random.Generator, opening: str) -> Aperture:
    """Return a random aperture of this kind: slits down to a twentieth of the radius wide, stars with 3 to 9 points."""
    if opening == "annulus":
        return optics.Annulus(rng.uniform(0.05, 0.95))
    if opening == "slit":
        width, height = (_log_uniform(rng, 0.05, 1.4) for _ in range(2))
        return optics.Slit(width, height)
    if opening == "regular polygon":
        return optics.Polygon.regular(int(rng.integers(3, 9)), rng.uniform(0, 360))
    if opening == "star":
        n = 2 * int(rng.integers(3, 10))
        angle, reach = np.arange(n) * 2 * np.pi / n, rng.uniform(0.3, 1.0, n)
        return optics.Polygon(np.column_stack([reach * np.cos(angle), reach * np.sin(angle)]))
    return optics.Circle()


def _hills(rng: np.random.Generator) -> np.ndarray:
    """Return a tilted, wavy surface of peak height 1, (12, 12)."""
    y, x = np.mgrid[-1:1:12j, -1:1:12j]
    c = rng.normal(size=6)
    surface = c[0] * x + c[1] * y + c[2] * x * y + c[3] * np.sin(3 * x + c[4]) * np.cos(2 * y + c[5])
    return (surface - surface.min()) / np.ptp(surface)


def _window(rng: np.random.Generator, radius: float, distance: float, focused: bool) -> dict[str, Any]:
    """Return a window of random width, at most 50° off the axis.

    Half its width is a part of the pupil's shadow or a few Airy radii, whichever is larger, or follows from a number of
    samples with a coarse pitch.
    """
    shadow = radius * rng.uniform(0.3, 1.5) * (0.1 if focused else 1.0)
    rings = rng.uniform(3, 12) * WAVELENGTH * distance / (2 * radius)
    shape = tuple(int(n) for n in rng.integers(SIDES[0], SIDES[1] + 1, 2))
    half = max(shadow, rings)
    if rng.random() < COARSE:
        half = _log_uniform(rng, 0.3, COARSEST) * WAVELENGTH * distance / (2 * radius) * max(shape) / 2
    half = min(half, 1.2 * distance)
    return {"dx": half / (max(shape) / 2), "shape": shape}
