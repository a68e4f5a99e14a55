"""Quadrature nodes within the pixels of a stepped relief, for the method "low_rank" at coarse tolerances.

Light of a node is multiplied by the Fourier kernel e^{-ik s·u}. u is a position in the window, and s a direction. For
pupils without pixels, s contains the sines of a sample, the components of the unit vector from the window's centre to
the sample (see `sine_samples`). Here, s is the position of the node divided by the distance of the window's plane,
because the borders of pixels are straight lines in position, but not in sines. With this s, the Fourier kernel is a
worse approximation to the diffraction kernel than with sines. It is therefore multiplied by a factor that depends on x
and one that depends on y (`axis_kernel`), which correct most of the difference.

The number of nodes in a pixel follows from the phase that lens, wavefront and the path to the window cause. The error
is averaged over the points of the window, because a relief may send light to any of these points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from optics.apertures.pixelated import MOST_NODES
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.pupil_sampling import PixelSamples
from optics.methods.remaining_factor import RemainingFactor
from optics.methods.sine_samples import SineSamples
from optics.methods.sine_stack import SineStack
from optics.methods.slow_factor import RANKS, Path
from optics.methods.window_geometry import half_window, window_geometry
from optics.methods.window_plan import MOST_ENTRIES, plan_costs
from optics.methods.window_rank import MOST_RANK, PLACES, RANK_OF_DISTANCE, RANK_SHARE, interpolation_errors
from optics.numerics.array_library import turned
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.interpolation import chebyshev_points, lagrange_basis
from optics.numerics.kept_values import cached_arrays
from optics.numerics.precision import Precision
from optics.numerics.quadrature import gauss_legendre
from optics.numerics.read_only import read_only

__all__ = ["PixelNodes", "PixelPlan", "WindowSamples", "pixel_plan"]

QUADRATURE_SHARE = 0.7  # choice: part of the tolerance that quadrature errors may take, see test_pixel_nodes.py
PARTS = 0.25, 0.5, 0.75  # choice: open parts of pixels that the edge of the aperture cuts
LARGEST = 50.0  # largest phase [rad] of the table of errors, for which all numbers of nodes are too small
PHASES = np.linspace(0, LARGEST, 4001)
MOST_BYTES = 64e6  # choice, limited by memory: all nodes that are cached
POINTS = 40  # choice: number of points of the pupil that determine the rank


@dataclass(frozen=True)
class PixelNodes:
    """Quadrature nodes of a pupil of pixels, as a replacement for `SineSamples` in sums over the pupil.

    `SineSamples` describes a sample by its sines, the components of a unit vector. Here, the direction of a node takes
    the place of the sines. The direction is the node's position divided by the distance of the window's plane.

    nodes: positions and weights of the nodes.
    centre: centre (x, y) [m] of the window.
    distance: distance [m] of the window's plane.
    elsewhere: root mean square of the directions over the pupil. `axis_kernel.AxisFactor` computes a factor of the
        kernel along x for points of the pupil whose direction along y is this value, and vice versa.
    """

    nodes: PixelSamples
    centre: tuple[float, float]
    distance: float

    @property
    def elsewhere(self) -> float:
        return 0.5 * self.nodes.radius / self.distance  # root mean square over a disk

    @property
    def at(self) -> np.ndarray:
        """Directions of the nodes, which are their positions along one axis (x or y) divided by `distance`."""
        return self.nodes.at / self.distance

    @property
    def grid(self) -> Grid:
        """Evenly spaced directions, as many as there are nodes. Their pitch is the mean spacing of the nodes."""
        count = self.nodes.aperture.count * self.nodes.across
        return Grid.square(count, 2 * self.nodes.radius / self.distance / count)

    @property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates x and y [m] of the nodes, two arrays (row, column)."""
        x, y, _ = self.layout
        return x, y

    @property
    def layout(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates x and y [m] of the nodes, and their weights [m²], three arrays (row, column)."""
        return _layout(self.nodes)

    def points_at(self, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (x, y) [m] of the pupil with the directions (s, t) = (x, y) / `distance`."""
        return s * self.distance, t * self.distance

    def light(self, beam: Beam, dtype: str) -> np.ndarray:
        """Return the result of `field` as a complex NumPy array (y, x), without derivatives."""
        x, y, weight = self.layout
        if beam.pupil.mask is not None:
            weight = weight * beam.pupil.amplitude(x / self.nodes.radius, y / self.nodes.radius)
        found: np.ndarray = turned(weight, beam.waves(x, y), dtype)
        return found

    def field(self, beam: Beam, types: Precision) -> Field:
        """Return the field behind the pupil times the weights of the nodes [m²]."""
        return self.nodes.field(beam, types)

    def stack(self) -> PixelStack:
        """Return the nodes as a stack of pupils that contains only this pupil."""
        numbers = self.distance, self.nodes.radius / math.hypot(self.nodes.radius, self.distance), self.elsewhere
        distance, steepest, elsewhere, radius = (np.array([value]) for value in (*numbers, self.nodes.radius))
        return PixelStack(
            distance, self.centre, steepest, elsewhere, self.at[None], (), radius, np.zeros(1), self.nodes
        )


@dataclass(frozen=True, eq=False)
class PixelStack(SineStack):
    """A single pupil, whose relief consists of pixels, in the form of a `SineStack`.

    A `SineStack` represents several pupils. It describes each sample of a pupil by the sample's sines, the components
    of the unit vector from the window's centre to the sample. Here, the direction of a node takes the place of the
    sines. The direction is the node's position divided by the window's distance.

    nodes: positions and weights of the nodes.
    """

    nodes: PixelSamples

    def directions(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x / self.distance[0], y / self.distance[0]

    def points_at(self, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return s * self.distance[0], t * self.distance[0]

    def smooth(self, reach: float) -> bool:
        return False  # the nodes are not evenly spaced, as interpolation from a few points requires

    @cached_property
    def outermost(self) -> np.ndarray:
        return np.array([self.nodes.outermost])

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        x, y, _ = _layout(self.nodes)
        return x[None], y[None]

    def _cosine2(self, dtype: str = "float64") -> np.ndarray:
        x, y = self.points
        squared = np.square(self.distance[0])
        away = np.square(x - self.centre[0]) + np.square(y - self.centre[1])
        return np.asarray(squared / (squared + away), dtype)

    def _new_sizes(self, dtype: str) -> np.ndarray:
        weight = self.nodes.aperture.weights(self.nodes.across)[None] * np.square(self.radius[0])
        return np.asarray(weight * self._cosine2() / self.distance[0], dtype)


@cached_arrays(MOST_BYTES, lambda layout: sum(part.nbytes for part in layout))
def _layout(nodes: PixelSamples) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the coordinates x and y [m] of the nodes, and their weights [m²], three arrays (row, column).

    The arrays are cached, because many pupils have the same nodes.
    """
    x, y = np.meshgrid(nodes.at, nodes.at)
    return read_only(x), read_only(y), read_only(nodes.aperture.weights(nodes.across) * nodes.radius**2)


WindowSamples = SineSamples | PixelNodes


class PixelPlan(NamedTuple):
    """Quadrature nodes for a pupil whose relief consists of pixels, with the rank and the cost of sums over them.

    The slow factor, the ratio of the diffraction kernel to a Fourier kernel, is interpolated over the window.

    pupil: the nodes.
    finer: finer nodes, with which `window_check` estimates the error.
    rank: number of interpolation points along each axis of the window.
    half: distance [m] from the window's centre, along each axis, within which these points lie.
    seconds, bytes: predicted time and memory.
    """

    pupil: PixelNodes
    finer: PixelNodes
    rank: int
    half: float
    seconds: float
    bytes: float


def pixel_plan(problem: Problem) -> PixelPlan | None:
    """Return the plan with the fewest quadrature nodes per pixel for which the error is within the tolerance.

    The pupil is divided into the pixels of a stepped relief. The result is None if the pupil has no such pixels, or if
    too many nodes or interpolation points would be necessary. It is also None if derivatives with respect to the
    pupil's radius or to samples of a relief, wavefront or mask are requested.
    """
    aperture = problem.pixelated
    if aperture is None or problem.knots is not None or problem.resized or (across := _across(problem)) is None:
        return None
    pupil, finer = (
        PixelNodes(PixelSamples(aperture, count, problem.radius), problem.window.centre, problem.distance)
        for count in (across, across + 1)
    )
    rank = _rank(pupil, Path.from_problem(problem), problem.tolerance, RANK_OF_DISTANCE if problem.moves else 1)
    inner = 0 if rank is None else rank * len(pupil.at)
    if rank is None or max(inner, len(finer.at)) > math.sqrt(MOST_ENTRIES):
        return None
    seconds, needed = plan_costs(problem.window, rank, len(pupil.at), len(finer.at))
    return PixelPlan(pupil, finer, rank, half_window(problem.window), seconds, needed)


def _across(problem: Problem) -> int | None:
    """Return the smallest number of quadrature nodes along a pixel's side that makes the mean error small enough.

    This is the error of integrals over pixels. It is larger for pixels cut by the edge of the aperture than for whole
    pixels, see `_squared_errors`. The result is None if MOST_NODES or more nodes would be necessary.
    """
    assert problem.pixelated is not None
    level = problem.stack.level
    slopes, geometry = level.slopes, window_geometry(level, problem.window)
    path = geometry.to_middle(slopes.across)
    rays = np.stack([slopes.along_x + path.along_x, slopes.along_y + path.along_y]).ravel() * path.cycles[0, 0]
    side = geometry.cycles[0] * ((np.arange(PLACES) + 0.5) * 2 / PLACES - 1)
    cycles = np.abs(np.add.outer(rays, side)) + problem.detail * problem.radius
    phase = np.minimum(np.pi * cycles * problem.pixelated.widest, LARGEST)
    for count in range(1, MOST_NODES):
        whole, cut = (np.interp(phase, PHASES, table).mean() for table in _squared_errors(count))
        # Errors along x and y are independent. The relative error of the intensity is twice that of the amplitude.
        wrong = 2 * math.sqrt(2 * (whole + problem.pixelated.cut_share * cut))
        if wrong < QUADRATURE_SHARE * problem.tolerance:
            return count
    return None


@lru_cache(maxsize=MOST_NODES)
def _squared_errors(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return squared errors of integrals of the wave e^{2iφt} over a whole pixel, and over a part of a pixel.

    t in [0, 1] is the position across the pixel, and the table PHASES contains the values of φ. If the edge of the
    aperture cuts a pixel, only a part [0, p] is open. The second result is the mean over the values of p in PARTS. The
    wave is known at `count` Gauss-Legendre nodes in [0, 1]. A polynomial in t interpolates it between the nodes, and is
    integrated from 0 to 1 or from 0 to p. Both results are arrays (phase,).
    """
    (at, _), (t, size), found = gauss_legendre(count), gauss_legendre(MOST_NODES), []
    for part in (1.0, *PARTS):
        weight = part * lagrange_basis(part * t, at) @ size
        exact = part * np.exp(1j * part * PHASES) * np.sinc(part * PHASES / np.pi)
        found.append(np.square(np.abs(exact - np.exp(2j * np.outer(PHASES, at)) @ weight)))
    return found[0], np.mean(found[1:], axis=0)


@lru_cache(maxsize=64)
def _rank(pupil: PixelNodes, path: Path, tolerance: float, least: int) -> int | None:
    """Return the rank, the number of interpolation points that are necessary along each axis of the window.

    The slow factor, the ratio of the diffraction kernel to a Fourier kernel, is interpolated between these points.
    Here, this ratio is divided by its own values along the x axis and along the y axis of the window. The root mean
    square error of the interpolation over pupil and window must be a small part of the tolerance. The result is None if
    this takes too many points.

    least: smallest rank.
    """
    half = half_window(path.window)
    # Points on a spiral cover a disk evenly.
    turn, r = np.arange(POINTS) * (math.sqrt(5) - 1), np.sqrt((np.arange(POINTS) + 0.5) / POINTS)
    x, y = (pupil.nodes.radius * r * part(np.pi * turn) for part in (np.cos, np.sin))
    stack = pupil.stack()
    s, t = stack.directions(x[None, None, :], y[None, None, :])
    factor = RemainingFactor(path, stack, (s, t))
    side = half * ((np.arange(PLACES) + 0.5) * 2 / PLACES - 1)
    across, down = (at.reshape(1, -1, 1) for at in np.meshgrid(side, side))
    place = across, down
    exact = factor.at(place)
    for rank in (each for each in RANKS if least <= each <= MOST_RANK):
        nodes = half * chebyshev_points(rank)
        if interpolation_errors(factor, place, np.ones(1), nodes, exact)[0] < RANK_SHARE * tolerance / 2:
            return rank
    return None
