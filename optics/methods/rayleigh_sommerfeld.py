"""The first Rayleigh-Sommerfeld integral as a direct sum over quadrature nodes that fit the edge of the aperture.

It is the reference with which other methods are compared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.apertures.aperture import Aperture, Nodes
from optics.elements.beam import Beam
from optics.methods.carrier import on_line
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.cost import CALL, ITEM_BYTES, NODE, NODE_BYTES, PAIRS_PER_SECOND
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision
from optics.numerics.quadrature import stepped_up
from optics.numerics.radial_profile import RadialProfile

__all__ = [
    "LANES",
    "MOST_DIGITS",
    "NodeSampling",
    "cached_nodes",
    "direct_sum",
    "node_count",
    "node_rule",
    "nodes",
    "turns",
]

MOST_DIGITS = 14.0  # choice: largest number of digits of a sum in float64, which has 16 digits itself
# Choice: digits beyond the tolerance. Few suffice, because the rule resolves the highest frequency everywhere.
SPARE_DIGITS = 0.5
ON_AXIS = 1e-9  # rounding: points closer to the x axis than this fraction of the radius lie on it
# Choice, limited by memory: numbers of nodes up to which 128 or 16 rules are cached. Of larger rules, one is cached.
SMALL_RULE, LARGE_RULE = 5000, 2**20
AT_ONCE = 2**22  # choice, limited by memory: number of nodes that are summed at once
LANES = 16  # number of points that a processor with AVX-512 sums in the time of one
FAR = 0.25  # choice: ratio of radius to distance below which nodes for the phase also resolve the kernel


Rule = tuple[Aperture, float, float, bool]


@dataclass(frozen=True)
class NodeSampling:
    """Quadrature nodes that fit the edge of the aperture.

    Sums over the nodes are accurate to `digits` decimal digits if the integrand has at most `cycles` cycles per radius.

    line: radii at which a rotationally symmetric image is computed. None if the image is computed at every sample of
        the window.
    """

    aperture: Aperture
    cycles: float
    digits: float
    count: int
    line: RadialProfile | None
    seconds: float
    bytes: float
    method: str = "rayleigh_sommerfeld"
    model_error: float = 0.0
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        types = precision(problem.dtype)
        if self.line is None:
            x, y = problem.window.coordinates(types)
            return direct_sum(beam, self.rule, x, y, types).intensity
        r = types.Float64(padded_for_packets(self.line.positions))
        return self.line.onto(direct_sum(beam, self.rule, r, 0 * r, types).intensity, problem.window, types)

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the complex amplitude U over the window, without the carrier e^{ikz} of a plane wave."""
        types = precision(problem.dtype)
        if self.line is None:
            x, y = problem.window.coordinates(types)
            found = direct_sum(beam, self.rule, x, y, types)
            return Field(found.re, found.im, problem.window, types)
        r = types.Float64(padded_for_packets(self.line.positions))
        return on_line(direct_sum(beam, self.rule, r, 0 * r, types), self.line, beam, problem)

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are taken as evenly spread.

        The power of all rounding errors is a fraction of the power of the light. `Sampling.plane` explains how their
        size in the window follows from this power and the width. The width is in proportion to the width λz/R of a
        focus, where z is the distance of the window and R the radius of the pupil. It is also in proportion to the
        square root of the number of nodes, because the rounding errors of the summands are independent.
        """
        return problem.wavelength * problem.distance / problem.radius * math.sqrt(self.count / math.pi)

    @property
    def rule(self) -> Rule:
        return self.aperture, self.cycles, self.digits, self.line is not None

    @property
    def samples(self) -> tuple[int, int]:
        return self.count, 1


def nodes(problem: Problem) -> list[NodeSampling]:
    """Return a list with one sampling. Its nodes resolve the phase of paths through the pupil to points of the window.

    The list is empty if derivatives with respect to samples of a relief, wavefront or mask are requested, and the pupil
    would have to be divided into too many rectangles (see `Problem.cells`).
    """
    (cycles, digits), aperture = node_rule(problem), problem.aperture
    if problem.knots is not None:
        cells = problem.cells()
        if cells is None:
            return []
        aperture, cycles = cells, 0.0  # the cells have a fixed number of nodes
    count = node_count(aperture, cycles, digits)
    line, outputs = None, math.prod(problem.window.shape)
    if problem.symmetric:
        outermost = max(min(problem.window.half_diagonal, problem.outermost), problem.window.dx)
        line = RadialProfile.resolving(outermost, _intensity_band(problem), problem.distance, problem.ripple)
        line = line if line.pays(outputs) else None
        outputs = line.points if line else outputs
        count = count if line is None else math.ceil(count / 2)
    pairs = count * max(outputs, LANES)
    seconds = CALL["rayleigh_sommerfeld"] + pairs / PAIRS_PER_SECOND[problem.dtype] + count * NODE
    needed = count * NODE_BYTES + (line.entries * ITEM_BYTES[problem.dtype] if line else 0.0)
    return [NodeSampling(aperture, cycles, digits, count, line, seconds, needed)]


def node_rule(problem: Problem) -> tuple[float, float]:
    """Return the cycles per pupil radius that a quadrature rule must resolve, and the digits it must provide."""
    digits = min(SPARE_DIGITS - math.log10(problem.tolerance), MOST_DIGITS)
    cycles = turns(problem, digits)
    # Rounding up limits the number of different rules. For pixels, there are few different rules anyway.
    return cycles if problem.pixelated else stepped_up(cycles), digits


def turns(problem: Problem, digits: float) -> float:
    """Return the cycles per radius that the nodes must resolve.

    These are the cycles of the phase of paths through the pupil to the window. In addition, the kernel has poles at the
    height z above the pupil's plane, where z is the distance of the window. If z is short, the poles slow convergence:
    with n nodes, the errors of Gauss-Legendre rules over [0, R] fall like e^{-4nz/R}, and those of the trapezoid rule
    around a ring of radius R like e^{-nz/R}. Further cycles are then added, so that there are enough nodes to converge.
    In a focus, where the phase is constant, only the poles matter.
    """
    phase, poles = problem.radius * problem.turning_inside, digits * math.log(10) / (2 * math.pi)
    nearness = problem.radius / problem.distance
    return max(phase + poles * max(nearness - FAR, 0.0), poles * nearness)


def node_count(aperture: Aperture, cycles: float, digits: float) -> int:
    """Return the number of nodes of a quadrature rule for an integrand with up to `cycles` cycles per pupil radius.

    For more than a hundred cycles, the number for a hundred is multiplied by the square of `cycles` / 100.
    """
    most = 100.0
    counted = aperture.node_count(min(cycles, most), digits)
    if counted is None:
        counted = len(cached_nodes(aperture, min(cycles, most), digits))
    return math.ceil(counted * max(cycles / most, 1.0) ** 2)


def cached_nodes(aperture: Aperture, cycles: float, digits: float, halved: bool = False) -> Nodes:
    """Return the quadrature nodes of an aperture, from a cache if possible.

    cycles: highest spatial frequency of the integrand [cycles per pupil radius].
    digits: number of decimal digits to which sums over the nodes are accurate.
    halved: True to return only the nodes on one side of the x axis, for mirror-symmetric pupils and points on the x
        axis. Both sides then contribute the same, so the weights of nodes off the axis are doubled.
    """
    count = aperture.node_count(cycles, digits) or LARGE_RULE
    rules = _small_rules if count <= SMALL_RULE else _large_rules if count <= LARGE_RULE else _largest_rule
    return rules(aperture, cycles, digits, halved)


def _made(aperture: Aperture, cycles: float, digits: float, halved: bool) -> Nodes:
    """Return quadrature nodes of an aperture that are not in the cache. `cached_nodes` explains the arguments."""
    found = aperture.nodes(cycles, digits)
    if not halved:
        return found
    weight = np.where(np.abs(found.y) < ON_AXIS, 1, 2) * found.weight
    kept = found.y > -ON_AXIS
    return Nodes(found.x[kept], found.y[kept], weight[kept])


_small_rules = lru_cache(maxsize=128)(_made)
_large_rules = lru_cache(maxsize=16)(_made)
_largest_rule = lru_cache(maxsize=1)(_made)


def _intensity_band(problem: Problem) -> float:
    """Return the highest spatial frequency [1/m] of the intensity over the window.

    It results from interference between rays from opposite sides of the rim.
    """
    reach = problem.radius + problem.outermost
    steepest = reach / math.hypot(reach, problem.distance) / problem.wavelength
    return min(2 * steepest, 2 * problem.radius / (problem.wavelength * problem.distance))


def direct_sum(beam: Beam, rule: Rule, x: Array, y: Array, types: Precision) -> Field:
    """Return the first Rayleigh-Sommerfeld integral at points (x, y) [m].

    U(x) = ∫ P(ξ) z/(2πD²) (1/D - ik) e^{ik(D - z)} dξ (Goodman, §3.5), where d = |x - ξ| and D = √(d² + z²). The
    difference D - z is computed as d²/(D + z). The phase is computed in float64, and whole multiples of 2π are
    subtracted before it is rounded to the type of the result.

    rule: aperture, `cycles`, `digits` and `halved`, the arguments with which `cached_nodes` returns the quadrature
        nodes.
    """
    import drjit as dr

    found = cached_nodes(*rule)
    parts = [slice(start, start + AT_ONCE) for start in range(0, max(len(found), 1), AT_ONCE)]
    re, im = dr.zeros(types.Float64, dr.width(x)), dr.zeros(types.Float64, dr.width(x))
    for part in parts:
        re, im = _added(beam, (found.x[part], found.y[part], found.weight[part]), (x, y), (re, im), types)
        if len(parts) > 1:
            dr.eval(re, im)
    return Field(types.Float(re), types.Float(im), Grid((1, dr.width(x)), 1.0), types)


def _added(
    beam: Beam, rule: tuple[np.ndarray, ...], at: tuple[Array, Array], total: tuple[Array, Array], types: Precision
) -> tuple[Array, Array]:
    """Return `total` plus the part of the integral of `direct_sum` that is summed over given nodes.

    The result is the real and the imaginary part, in float64.

    rule: x, y and weight of the nodes, in units of the pupil's radius.
    at: points (x, y) [m] of the image.
    total: real and imaginary part of the sum over the previous nodes, at these points.
    """
    import drjit as dr

    x, y = at
    found_x, found_y, found_weight = (types.Float64(padded_for_packets(column)) for column in rule)
    radius = opaque(types, beam.radius)
    nodes_x, nodes_y = found_x * radius, found_y * radius
    z, wavelength = opaque(types, beam.distance), opaque(types, beam.wavelength / beam.index)
    weight = found_weight * dr.square(radius) * z / (2 * math.pi)
    if beam.pupil.mask is not None:
        weight *= beam.pupil.amplitude(found_x, found_y)
    waves = beam.waves(nodes_x, nodes_y)
    dr.eval(nodes_x, nodes_y, weight, waves, x, y)
    count = dr.opaque(types.Index, len(rule[0]))
    cycles = 1 / wavelength  # multiplication by this number is faster than division by the wavelength
    k = 2 * math.pi * cycles

    def add(i: Array, re: Array, im: Array) -> tuple[Array, Array, Array]:
        dx, dy = x - dr.gather(types.Float64, nodes_x, i), y - dr.gather(types.Float64, nodes_y, i)
        d2 = dx * dx + dy * dy
        distance = dr.sqrt(d2 + z * z)
        phase = d2 / (distance + z) * cycles + dr.gather(types.Float64, waves, i)
        sin, cos = dr.sincos(types.Float((phase - dr.round(phase)) * (2 * math.pi)))
        nearness = 1 / distance
        size = dr.gather(types.Float64, weight, i) * nearness * nearness
        near, far, sin, cos = size * nearness, size * k, types.Float64(sin), types.Float64(cos)
        return i + 1, re + near * cos + far * sin, im + near * sin - far * cos

    start = dr.zeros(types.Index, dr.width(x))
    _, re, im = dr.while_loop((start, *total), lambda i, re, im: i < count, add, max_iterations=-1)
    return re, im
