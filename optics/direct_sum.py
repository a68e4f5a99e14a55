"""The first Rayleigh-Sommerfeld integral as a direct sum over edge-fitted nodes: the reference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.beam import Beam
from optics.field import Field
from optics.precision import Precision, opaque, precision
from optics.problem import Problem

__all__ = ["NodeSampling", "nodes"]


@dataclass(frozen=True)
class NodeSampling:
    """Gauss-Legendre nodes in radius times trapezoid nodes in angle."""

    radial: int
    angular: int
    seconds: float
    method: str = "rayleigh_sommerfeld"

    def intensity(self, beam: Beam, problem: Problem) -> Any:
        """|U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""
        return _direct_sum(beam, problem, self, precision(problem.dtype)).intensity

    def plane(self, problem: Problem) -> float:
        """Width [m] over which rounding spreads the pupil's light: the focus, times the root of the summands."""
        return problem.wavelength * problem.distance / problem.radius * math.sqrt(self.radial * self.angular / math.pi)

    @property
    def samples(self) -> tuple[int, int]:
        return self.radial, self.angular

    @property
    def largest(self) -> int:
        return self.radial


def nodes(problem: Problem) -> list[NodeSampling]:
    """Enough nodes for the cycles that phase and path turn through."""
    cycles = problem.radius * (problem.phase_band + problem.band())
    digits = -math.log10(problem.ripple)
    radial = math.ceil(1.75 * cycles + 2 * digits + 4)
    angular = 2 * math.ceil(math.pi * cycles + 1.5 * digits * (1 + cycles ** (1 / 3)) + 4)
    pairs = radial * angular * problem.window.shape[0] * problem.window.shape[1]
    return [NodeSampling(radial, angular, pairs / 1e8 + 5e-3)]


def _direct_sum(beam: Beam, problem: Problem, how: NodeSampling, types: Precision) -> Field:
    """First Rayleigh-Sommerfeld integral over edge-fitted nodes (Goodman, §3.5):

    U(x) = ∫ P(ξ) z/(2πD²) (1/D - ik) e^{ikD} dξ. D - z = d²/(D + z) loses its whole waves in float64.
    """
    import drjit as dr

    nodes_x, nodes_y, weight = _disk_nodes(problem.radius, how, types)
    waves = beam.waves(nodes_x, nodes_y, types)
    dr.eval(nodes_x, nodes_y, weight, waves)
    count = dr.opaque(types.Index, len(weight))
    x, y = problem.window.coordinates(types)
    z, wavelength = opaque(types, problem.distance), opaque(types, problem.wavelength)
    k = 2 * math.pi / wavelength

    def add(i: Any, re: Any, im: Any) -> tuple[Any, Any, Any]:
        dx, dy = x - dr.gather(types.Float64, nodes_x, i), y - dr.gather(types.Float64, nodes_y, i)
        d2 = dx * dx + dy * dy
        distance = dr.sqrt(d2 + z * z)
        phase = d2 / (distance + z) / wavelength + dr.gather(types.Float64, waves, i)
        sin, cos = dr.sincos(types.Float((phase - dr.round(phase)) * (2 * math.pi)))
        size = dr.gather(types.Float64, weight, i) * z / (2 * math.pi * distance * distance)
        near, far, sin, cos = size / distance, size * k, types.Float64(sin), types.Float64(cos)
        return i + 1, re + near * cos + far * sin, im + near * sin - far * cos

    zero = dr.zeros(types.Float64, dr.width(x))
    start = dr.zeros(types.Index, dr.width(x))
    _, re, im = dr.while_loop((start, zero, zero), lambda i, re, im: i < count, add)
    return Field(types.Float(re), types.Float(im), problem.window, types)


def _disk_nodes(radius: float, how: NodeSampling, types: Precision) -> tuple[Any, Any, Any]:
    """Gauss-Legendre in radius, trapezoid in angle, weights r dr dφ: exact edge, spectral convergence."""
    nodes, weights = np.polynomial.legendre.leggauss(how.radial)
    r = radius * (nodes + 1) / 2
    angle = 2 * np.pi * (np.arange(how.angular) + 0.5) / how.angular
    x, y = np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))
    weight = np.outer(weights * r * radius / 2, np.full(how.angular, 2 * np.pi / how.angular))
    return types.Float64(x.ravel()), types.Float64(y.ravel()), types.Float64(weight.ravel())
