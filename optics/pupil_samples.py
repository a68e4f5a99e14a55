"""Where a matrix product samples the pupil: on a grid, its edge softened, or at nodes of pixels between which it jumps.

Both are rows and columns of places, the same along x and y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from optics.beam import Beam
from optics.direct_sum import node_rule
from optics.field import Field
from optics.grid import Grid
from optics.pixels import TensorNodes
from optics.precision import Precision, opaque
from optics.problem import Problem, PupilEdge

__all__ = ["GridSamples", "PixelSamples", "PupilSamples", "samples_of"]


class PupilSamples(Protocol):
    """Rows and columns of samples of a pupil."""

    @property
    def at(self) -> np.ndarray:
        """Places [m] along either axis."""

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which nothing counts."""

    @property
    def seconds(self) -> float:
        """What `field` takes, roughly."""

    def places(self, index: Any, beam: Beam, types: Precision) -> Any:
        """at[index] for float64 indices, with the derivatives that the beam's radius carries."""

    def field(self, beam: Beam, types: Precision) -> Field:
        """Behind the pupil, times the samples' areas [m²]."""


@dataclass(frozen=True)
class GridSamples:
    """A grid that carries a soft aperture."""

    edge: PupilEdge
    grid: Grid

    @property
    def at(self) -> np.ndarray:
        return self.grid.x

    @property
    def outermost(self) -> float:
        return self.edge.outermost

    @property
    def seconds(self) -> float:
        return self.grid.shape[0] ** 2 * self.edge.seconds_per_point

    def places(self, index: Any, beam: Beam, types: Precision) -> Any:
        import drjit as dr

        return (index - dr.opaque(types.Float64, self.grid.shape[0] // 2)) * opaque(types, self.grid.dx)

    def field(self, beam: Beam, types: Precision) -> Field:
        return beam.behind(self.edge.aperture, self.grid, types).scaled(self.grid.dx**2)


@dataclass(frozen=True)
class PixelSamples:
    """Nodes of an opening in pixels."""

    nodes: TensorNodes
    radius: float

    @property
    def at(self) -> np.ndarray:
        return self.nodes.at * self.radius

    @property
    def outermost(self) -> float:
        """Cut pixels have nodes beyond the edge, which is itself nowhere further off than the radius."""
        row, column = np.nonzero(self.nodes.weights)
        return self.radius * float(np.hypot(self.nodes.at[row], self.nodes.at[column]).max())

    @property
    def seconds(self) -> float:
        return self.nodes.weights.size * 1e-8

    def places(self, index: Any, beam: Beam, types: Precision) -> Any:
        import drjit as dr

        return dr.gather(types.Float64, types.Float64(self.nodes.at), types.Index(index)) * opaque(types, beam.radius)

    def field(self, beam: Beam, types: Precision) -> Field:
        radius, at = opaque(types, beam.radius), self.nodes.at
        x, y = (types.Float64(np.ascontiguousarray(axis.ravel())) for axis in np.meshgrid(at, at))
        weight = types.Float64(self.nodes.weights.ravel()) * radius * radius
        grid = Grid.square(len(at), 2 * self.radius / len(at))
        return Field.from_waves(weight, beam.waves(x * radius, y * radius, types), grid, types)


def samples_of(problem: Problem) -> PupilSamples | None:
    """As few as the turns of pupil and path together allow; None where pixels are too coarse for them."""
    if problem.pixelated is not None:
        nodes = problem.pixelated.tensor_nodes(*node_rule(problem))
        return None if nodes is None else PixelSamples(nodes, problem.radius)
    edge = problem.soft_edge(problem.turning)
    pitch = 1 / (problem.turning + edge.stopband)
    return GridSamples(edge, Grid.square(2 * math.ceil(edge.outermost / pitch) + 1, pitch))
