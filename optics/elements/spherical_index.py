"""Rays through a sphere whose refractive index depends on the distance from the centre.

Lengths are relative to the sphere's radius, and indices n relative to the medium. The height h of a ray is the distance
between the centre and the straight line of the incident ray. Along the ray, n r sin i = h is constant, where i is the
angle between the ray and the radius (Bouguer's theorem). Between entry and exit, the ray turns about the centre by

    ψ(h) = 2 ∫ h dr / (r √(n² r² - h²)),

integrated from the turning point, where n r = h, to the surface. Its optical path is 2 ∫ n² r dr / √(n² r² - h²) with
the same limits. The substitution r² = a² + y², where a is r at the turning point, makes both integrands smooth.

Source: Luneburg, Mathematical Theory of Optics, 1964, §27.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev

from optics.numerics.arguments import in_range
from optics.numerics.quadrature import gauss_legendre

__all__ = ["SphericalIndex", "generalized_luneburg"]

NODES = 64  # choice: quadrature nodes of an integral along a ray; errors below 1e-9 for the lenses in this folder
TERMS = 96  # choice: Chebyshev terms of a profile in (r/R)²
HALVINGS = 52  # bisection down to rounding
ROUNDING = 1e-9  # margin for n r in the check of a profile


@dataclass(frozen=True, eq=False)
class SphericalIndex:
    """The index of a sphere relative to its medium, as a polynomial in (r/R)².

    R is the radius of the sphere, and r the distance from its centre.
    """

    index: Chebyshev

    @classmethod
    def from_function(cls, relative: Callable[[np.ndarray], np.ndarray]) -> SphericalIndex:
        """Interpolate the index n of a sphere relative to its medium, at Chebyshev points in (r/R)².

        relative: function that returns n for an array of r/R, the distance from the centre divided by the radius.

        Raises:
            ValueError: light could stay inside the sphere, because n r/R decreases outwards where it exceeds neither 1
                nor n(R). The values of n r/R just outside and just inside the surface are 1 and n(R).
        """
        found = cls(Chebyshev.interpolate(lambda t: relative(np.sqrt(np.clip(t, 0, 1))), TERMS - 1, (0.0, 1.0)))
        t = np.linspace(0, 1, 20 * TERMS)
        moment = np.sqrt(t) * found.index(t)
        if (np.diff(np.minimum(moment, min(1.0, moment[-1]))) < -ROUNDING).any():
            raise ValueError("shape: n r must grow from the centre to the surface, or light stays inside the lens")
        return found

    def turning(self, h: np.ndarray) -> np.ndarray:
        """Return the angle ψ [rad], seen from the centre, between the points where a ray enters and leaves the sphere.

        h: heights of the rays relative to the radius, an array of any shape. The result has the same shape.

        Raises:
            ValueError: a ray is totally reflected at the surface.
        """
        y, end, n, least, radial = self._along(h)
        # The integrand of a straight ray has a known integral. The remainder of the integrand has no peak at small
        # heights.
        bend = (n * n - least * least) / (least * radial * (least * y + radial))
        return np.asarray(2 * np.arcsin(end) - 2 * h * end * (bend @ gauss_legendre(NODES)[1]))

    def path(self, h: np.ndarray) -> np.ndarray:
        """Return the optical path lengths of rays inside the sphere, in units of its radius times the medium's index.

        h: heights of the rays relative to the radius, an array of any shape. The result has the same shape.

        Raises:
            ValueError: see `turning`.
        """
        y, end, n, _, radial = self._along(h)
        return np.asarray(2 * end * ((n * n * y / radial) @ gauss_legendre(NODES)[1]))

    def power(self) -> float:
        """Return R/f for rays near the axis, where R is the sphere's radius and f its focal length.

        A ray at a small height h is deviated by the angle (h/R)(R/f). The result is 2 (1 - 1/n(R)) - 4 ∫ (dn/dt)/n²
        d(r/R), where n is the index at the distance r from the centre, and t = (r/R)².
        """
        u, weights = gauss_legendre(NODES)
        bend = self.index.deriv()(u * u) / self.index(u * u) ** 2
        return float(2 - 2 / self.index(1.0) - 4 * bend @ weights)

    def _turning_point(self, h: np.ndarray) -> np.ndarray:
        """Return (r/R)² at the turning points of rays of relative height h, where n r/R = h.

        Raises:
            ValueError: the index just inside the surface is so low that a ray is totally reflected there.
        """
        edge = float(self.index(1.0))
        if not (h < edge).all():
            raise ValueError(f"surface_n is {edge:.4g} of medium_n: must be larger, or rays at the rim are reflected")
        return _solved(lambda t: np.sqrt(t) * self.index(t), h)

    def _along(self, h: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return values at quadrature nodes along rays of relative height h, (*h.shape, node).

        The five values are y = √(r² - a²), where a is the radius of the ray's turning point; the largest y, √(1 - a²),
        with the shape of h; the index n(r); the index n(a), (*h.shape, 1); and √(n² r² - h²).
        """
        turn = self._turning_point(h)
        end, least = np.sqrt(1 - turn), self.index(turn)[..., None]
        y = end[..., None] * gauss_legendre(NODES)[0]
        t = turn[..., None] + y * y
        n = self.index(t)
        return y, end, n, least, np.sqrt((least * y) ** 2 + t * (n * n - least * least))


def _solved(rising: Callable[[np.ndarray], np.ndarray], value: np.ndarray) -> np.ndarray:
    """Return the arguments in [0, 1] at which an increasing function reaches given values, by bisection."""
    low, high = np.zeros_like(value), np.ones_like(value)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        below = rising(middle) < value
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return high


@lru_cache(maxsize=16)
def generalized_luneburg(focal_ratio: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the relative index n as a function of r/R for a sphere that focuses parallel light.

    The focus lies at the distance focal_ratio · R behind the centre of the sphere, which has the radius R:

        n(ρ) = exp ω(ρ),   ω(ρ) = 1/π ∫ arcsin(x/s) / √(x² - ρ²) dx  from ρ to 1,   r/R = ρ exp(-ω),   s = focal_ratio

    Sources: Luneburg, Mathematical Theory of Optics, 1964, §29; Morgan, J. Appl. Phys. 29, 1358, 1958.

    Raises:
        ValueError: focal_ratio is outside [1, 20].
    """
    s = in_range("focal_ratio", focal_ratio, 1.0, 20.0)
    v, weights = gauss_legendre(NODES)

    def omega(rho: np.ndarray) -> np.ndarray:
        end = np.sqrt(1 - rho * rho)
        x = np.hypot(rho[..., None], end[..., None] * (1 - v * v))
        return np.asarray(2 * end / math.pi * ((np.arcsin(np.minimum(x / s, 1.0)) / x) @ (v * weights)))

    def index(t: np.ndarray) -> np.ndarray:
        return np.exp(omega(_solved(lambda rho: rho * np.exp(-omega(rho)), np.sqrt(t))))

    profile = Chebyshev.interpolate(index, TERMS - 1, (0.0, 1.0))
    return lambda u: np.asarray(profile(np.square(u)))
