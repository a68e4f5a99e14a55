"""Circular and annular apertures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, pi
from typing import ClassVar

import numpy as np

from optics.apertures.aperture import Aperture, Nodes, SoftAperture
from optics.apertures.outline import Outline
from optics.apertures.soft_edge import SoftEdge
from optics.numerics.arguments import in_range, reals, shown
from optics.numerics.autodiff import Array
from optics.numerics.interpolation import Interpolant
from optics.numerics.precision import Precision
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count, harmonics

__all__ = ["Annulus", "Circle", "disk_table", "ring_nodes"]


@dataclass(frozen=True)
class Circle(Aperture):
    """The whole unit disk."""

    @property
    def area(self) -> float:
        return pi

    @property
    def rotationally_symmetric(self) -> bool:
        return True

    @property
    def half_widths(self) -> tuple[float, float]:
        return 1.0, 1.0

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(np.hypot(reals("x", x), reals("y", y)) <= 1)

    @property
    def outline(self) -> Outline:
        return Outline.circles((1.0,))

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        return ring_nodes(0.0, 1.0, cycles, digits)

    def node_count(self, cycles: float, digits: float) -> int:
        return int(_ring_rule(0.0, 1.0, cycles, digits)[2].sum())

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        return SoftAnnulus(edge, 0.0)


@dataclass(frozen=True)
class Annulus(Aperture):
    """The unit disk without the disk of radius `inner`.

    Raises:
        ValueError: inner is outside (0, 1).
    """

    inner: float

    def __post_init__(self) -> None:
        inner = in_range("inner", self.inner, 0.0, 1.0)
        if not 0 < inner < 1:
            raise ValueError(f"inner = {shown(self.inner)}: must lie between 0 and 1, both excluded")
        object.__setattr__(self, "inner", inner)

    @property
    def area(self) -> float:
        return pi * (1 - self.inner**2)

    @property
    def rotationally_symmetric(self) -> bool:
        return True

    @property
    def rings(self) -> tuple[tuple[float, float], ...]:
        return ((self.inner, 1.0),)

    @property
    def half_widths(self) -> tuple[float, float]:
        return 1.0, 1.0

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r = np.hypot(reals("x", x), reals("y", y))
        return np.asarray((r >= self.inner) & (r <= 1))

    @property
    def outline(self) -> Outline:
        return Outline.circles((self.inner, 1.0))

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        return ring_nodes(self.inner, 1.0, cycles, digits)

    def node_count(self, cycles: float, digits: float) -> int:
        return int(_ring_rule(self.inner, 1.0, cycles, digits)[2].sum())

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        return SoftAnnulus(edge, self.inner)


@dataclass(frozen=True)
class SoftAnnulus(SoftAperture):
    """A ring with soft edges: the difference of two disks with soft edges; a single such disk if `inner` is 0."""

    rotationally_symmetric: ClassVar[bool] = True
    edge: SoftEdge
    inner: float

    def transmittance(self, x: Array, y: Array, types: Precision) -> Array:
        import drjit as dr

        distance = dr.sqrt(x * x + y * y + 1e-40)  # differentiable on the axis
        disk = disk_table(self.edge, 1.0).at(distance, types)
        return disk if self.inner == 0 else disk - disk_table(self.edge, self.inner).at(distance, types)


@lru_cache(maxsize=512)
def disk_table(edge: SoftEdge, radius: float) -> Interpolant:
    """Return a table of the transmittance within the soft edge of a disk, as a function of the distance from its axis.

    `disk_profile` computes the values.
    """
    ends = radius - edge.reach, radius + edge.reach
    return Interpolant.from_function(
        lambda rho: disk_profile(edge, radius, rho), ends, 2 * edge.cycles, edge.ripple / 4
    )


def disk_profile(edge: SoftEdge, radius: float, distance: np.ndarray) -> np.ndarray:
    """Return the transmittance of a soft disk at distances ρ from its axis, by quadrature. It is an even function of ρ.

    A(ρ) = ∫ g(r) r θ(ρ, r) dr, where g is the kernel and R the radius of the disk. θ = 2 arccos((ρ² + r² - R²)/(2ρr))
    is the angle over which a circle of radius r about the point at ρ lies inside the disk. The angle θ varies only for
    r from |ρ - R| to ρ + R. Near both ends of this range, it varies like a square root. Let s be the length of the
    part of this range that lies within the kernel's reach. The substitution r = |ρ - R| + s sin²(πu/2), with u from 0
    to 1, makes the integrand smooth.
    """
    rho = np.maximum(np.abs(np.asarray(distance, dtype=np.float64)), 1e-9 * radius)[:, None]
    lower = np.abs(rho - radius)
    span = np.maximum(np.minimum(edge.reach, rho + radius) - lower, 0)
    # Choice: more nodes than the kernel's cycles and the steepness of its window require.
    u, weight = gauss_legendre(int(24 + 4 * edge.cycles + 2 * edge.beta))
    r = np.maximum(lower + span * np.sin(pi * u / 2) ** 2, 1e-300)
    cosine = np.clip((rho**2 + r**2 - radius**2) / (2 * rho * r), -1, 1)
    jacobian = span * np.sin(pi * u) * pi / 2
    partly = np.sum(weight * jacobian * edge.ring(r) * np.arccos(cosine) / pi, axis=1)
    within = np.where(rho < radius, np.minimum(lower, edge.reach), 0)  # circles wholly inside the disk
    return np.asarray(partly + np.sum(weight * within * edge.ring(within * u), axis=1))


def ring_nodes(inner: float, outer: float, cycles: float, digits: float) -> Nodes:
    """Return nodes over a ring: Gauss-Legendre nodes along the radius, and equidistant nodes around each circle.

    Smaller circles have fewer nodes. The rule represents the edge exactly and converges spectrally. Over a full disk,
    the integrand's mean on the circle of radius r is a smooth function of r². For low spatial frequencies,
    fewer Gauss-Legendre nodes along r² than along r are therefore needed. Nodes along r² are used in this case.

    cycles: highest spatial frequency of the integrand [cycles per pupil radius].
    digits: number of accurate digits. For integrands of at most 1, the error is at most 10^-digits times the area.
    """
    r, weight, count = _ring_rule(inner, outer, cycles, digits)
    place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    angle = 2 * pi * (place + 0.5) / np.repeat(count, count)
    r = np.repeat(r, count)
    return Nodes(r * np.cos(angle), r * np.sin(angle), np.repeat(weight * 2 * pi / count, count) * r)


@lru_cache(maxsize=256)
def _ring_rule(inner: float, outer: float, cycles: float, digits: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the circles on which the nodes of `ring_nodes` lie: radii, weights, and number of nodes on each circle."""
    digits += 0.3  # log10 2: each of the two rules, in radius and in angle, may contribute half the error
    span = outer - inner
    u, weight = gauss_legendre(gauss_legendre_count(cycles * span, digits))
    rings = [(inner + span * u, span * weight)]
    if inner == 0:
        # The count is for a whole diameter. In r², half of the nodes are enough.
        u, weight = gauss_legendre(ceil(gauss_legendre_count(2 * cycles * outer, digits) / 2))
        rings.append((outer * np.sqrt(u), outer * weight / (2 * np.sqrt(u))))
    counts = [harmonics(2 * pi * cycles * r, digits) for r, _ in rings]
    best = min(range(len(rings)), key=lambda i: int(counts[i].sum()))
    return *rings[best], counts[best]
