"""An aperture's face: its shape, softened so that a grid can carry it, or as edge-fitted quadrature nodes.

A hard edge has no band limit: sampled on a Cartesian grid, its error falls only like N⁻¹ to N⁻¹·⁵. Here the aperture is
convolved with a low-pass kernel of compact support (optics.soft_edge), so that sums over samples (the trapezoid rule)
converge as fast as the kernel's side lobes fall. The function is 1 or 0 except within `reach` of the edge.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np

from optics.arguments import LARGEST, in_range, positive
from optics.precision import Precision, opaque
from optics.quadrature import gauss_legendre
from optics.soft_edge import SoftEdge, kaiser_beta

__all__ = ["EDGE_REACH", "Aperture", "Nodes", "SoftAperture", "SoftDisk"]

# The soft edge reaches at most this far beyond the aperture, in radii.
EDGE_REACH = 0.25


class SoftAperture(ABC):
    """An aperture whose edge a grid can carry. Lengths in units of the pupil's radius R, frequencies in cycles per R.

    Its spectrum is the aperture's own up to `passband` and vanishes beyond `stopband`, to `ripple`; further than
    `reach` from the edge it is 1 or 0.
    """

    edge: SoftEdge

    @property
    def passband(self) -> float:
        return self.edge.passband

    @property
    def stopband(self) -> float:
        return self.edge.stopband

    @property
    def ripple(self) -> float:
        return self.edge.ripple

    @property
    def reach(self) -> float:
        return self.edge.reach

    @abstractmethod
    def transmittance(self, x: Any, y: Any, types: Precision) -> Any:
        """At points (x, y), flat Dr.Jit Float64 arrays; differentiable in both."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Quadrature nodes x, y and weights over an aperture: flat float64 arrays, in units of R and R²."""

    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray

    def __len__(self) -> int:
        return len(self.weight)


class Aperture(ABC):
    """An opening in an opaque screen, within the unit circle: lengths are in units of the pupil's radius R."""

    @property
    @abstractmethod
    def area(self) -> float:
        """In R²."""

    @property
    @abstractmethod
    def rotationally_symmetric(self) -> bool:
        """Whether the aperture is the same seen from every side."""

    @property
    @abstractmethod
    def half_widths(self) -> tuple[float, float]:
        """Half the width and height of the smallest centred rectangle that holds the aperture."""

    @abstractmethod
    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which points lie within the aperture."""

    def nodes(self, cycles: float, digits: float) -> Nodes:
        """Nodes whose sum is good to 10^-digits of the area, for integrands of at most `cycles` cycles per R.

        That bounds the local frequency in any direction, everywhere; a varying amplitude needs a share of it too.

        Raises:
            ValueError: cycles outside [0, 1e5] or digits outside [0, 16].
        """
        return self._nodes(in_range("cycles", cycles, 0.0, 1e5), in_range("digits", digits, 0.0, 16.0))

    def soften(self, passband: float, ripple: float, widest_reach: float = EDGE_REACH) -> SoftAperture:
        """The aperture, low-passed from `passband` [cycles per R] on with the transition that costs fewest samples.

        Raises:
            ValueError: passband negative, ripple outside [1e-13, 0.5], or widest_reach not positive.
        """
        in_range("passband", passband, 0.0, LARGEST)
        in_range("ripple", ripple, 1e-13, 0.5)
        positive("widest_reach", widest_reach, "pupil radii")
        return self._softened(SoftEdge.cheapest(passband, ripple, widest_reach, self.half_widths))

    @abstractmethod
    def _nodes(self, cycles: float, digits: float) -> Nodes:
        """Edge-fitted nodes."""

    @abstractmethod
    def _softened(self, edge: SoftEdge) -> SoftAperture:
        """The aperture convolved with the edge's kernel."""


@dataclass(frozen=True)
class SoftDisk:
    """Disk of `radius` [m], low-passed between `passband` and `stopband` [1/m] with ripple `ripple`."""

    radius: float
    passband: float
    stopband: float
    ripple: float

    @classmethod
    def cheapest(cls, radius: float, passband: float, ripple: float, widest_reach: float) -> SoftDisk:
        """The transition that minimises samples: (radius + reach) x (2 passband + transition), reach limited."""
        beta = kaiser_beta(ripple)
        half = max(sqrt(passband * beta / (2 * pi * radius)), beta / (2 * pi * widest_reach))
        return cls(radius, passband, passband + 2 * half, ripple)

    @property
    def beta(self) -> float:
        return kaiser_beta(self.ripple)

    @property
    def reach(self) -> float:
        """Half width [m] of the soft edge: the window's spectrum ends at half the transition."""
        return self.beta / (pi * (self.stopband - self.passband))

    def profile(self, distance: np.ndarray) -> np.ndarray:
        """Transmittance at a distance [m] from the axis, by quadrature in float64 (at most `reach` from the edge).

        A(ρ) = ∫ g(r) r θ(ρ, r) dr / ∫ 2π g(r) r dr, θ = 2 arccos((ρ² + r² - R²)/(2ρr)) the angle under which a circle
        of radius r about the point lies inside the disk. r = lower + span sin²(πu/2) smooths the arccos at both ends.
        """
        rho = np.maximum(np.asarray(distance, dtype=np.float64), 1e-9 * self.radius)[:, None]
        lower = np.abs(rho - self.radius)
        span = np.maximum(np.minimum(self.reach, rho + self.radius) - lower, 0)
        u, weight = gauss_legendre(self._nodes)
        r = np.maximum(lower + span * np.sin(pi * u / 2) ** 2, 1e-300)
        cosine = np.clip((rho**2 + r**2 - self.radius**2) / (2 * rho * r), -1, 1)
        jacobian = span * np.sin(pi * u) * pi / 2
        partly = np.sum(weight * jacobian * self._kernel(r) * 2 * np.arccos(cosine), axis=1)
        wholly = np.where(rho < self.radius, np.minimum(lower, self.reach), 0)  # circles inside the disk
        fully = 2 * pi * np.sum(weight * wholly * self._kernel(wholly * u), axis=1)
        return (partly + fully) / (2 * pi * np.sum(weight * self.reach * self._kernel(self.reach * u)))

    def transmittance(self, x: Any, y: Any, types: Precision) -> Any:
        """A(x, y) on flat Dr.Jit arrays: cubic interpolation in a table of the profile."""
        import drjit as dr

        n = self._table_size
        edge = np.linspace(-1, 1, n)
        step = edge[1] - edge[0]
        padded = np.arange(-2, n + 2) * step - 1
        table = types.Float64(self.profile(self.radius + padded * self.reach))
        place = (dr.sqrt(x * x + y * y) - opaque(types, self.radius)) * opaque(types, 1 / (self.reach * step))
        place = dr.clip(place, -opaque(types, (n - 1) / 2), opaque(types, (n - 1) / 2)) + opaque(types, (n - 1) / 2)
        cell = dr.minimum(dr.floor(place), opaque(types, n - 2))
        t = place - cell
        first = types.Index(cell)
        values = [dr.gather(types.Float64, table, first + i) for i in range(6)]
        return sum((w * v for w, v in zip(_lagrange6(t), values, strict=True)), types.Float64(0))

    @property
    def _nodes(self) -> int:
        """The kernel turns through reach x (cut-off) cycles."""
        return int(16 + 4 * self.reach * self.stopband + 2 * self.beta)

    @property
    def _table_size(self) -> int:
        per_cycle = 6 if self.ripple > 1e-4 else 16
        return int(32 + 2 * per_cycle * self.reach * self.stopband)

    def _kernel(self, r: np.ndarray) -> np.ndarray:
        """g(r) r: jinc of the mid-transition cut-off under the Kaiser window (not normalised)."""
        from scipy.special import i0, j1

        cutoff = (self.passband + self.stopband) / 2
        return j1(2 * pi * cutoff * r) * i0(self.beta * np.sqrt(np.maximum(1 - (r / self.reach) ** 2, 0)))


def _lagrange6(t: Any) -> list[Any]:
    """Weights of six-point Lagrange interpolation at nodes -2 ... 3, t in [0, 1]."""
    a, b, c, d, e, f = t + 2, t + 1, t, t - 1, t - 2, t - 3
    return [
        b * c * d * e * f / -120,
        a * c * d * e * f / 24,
        a * b * d * e * f / -12,
        a * b * c * e * f / 12,
        a * b * c * d * f / -24,
        a * b * c * d * e / 120,
    ]
