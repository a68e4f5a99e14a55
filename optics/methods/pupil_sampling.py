"""Samples of the pupil: a grid for an aperture whose edge is softened, or quadrature nodes within an aperture's pixels.

In both cases, the samples form rows and columns, with the same positions along x and along y. Diffraction integrals
over such samples can be computed as matrix products.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from optics.apertures.pixelated import PixelatedAperture
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.pupil_edge import PupilEdge
from optics.methods.rayleigh_sommerfeld import node_rule
from optics.numerics.autodiff import Array
from optics.numerics.cost import PIXEL_NODE_GEOMETRY
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, padded_for_packets

__all__ = ["GridSamples", "PixelSamples", "PupilSamples", "cell_samples", "pixel_samples", "samples_of"]

MOST_ACROSS = 1e6  # choice, limited by memory: largest number of samples across the pupil


class PupilSamples(Protocol):
    """Rows and columns of samples of a pupil."""

    @property
    def at(self) -> np.ndarray:
        """Positions of the samples, the same along x and along y.

        They are in metres, or they are sines: components of the unit vectors from the window's centre to the samples,
        minus those of the unit vector to the pupil's centre.
        """

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which the pupil is dark."""

    @property
    def seconds(self) -> float:
        """Approximate time of `field`."""

    def places(self, i: Array, j: Array, beam: Beam, types: Precision) -> tuple[Array, Array]:
        """Return the points (x, y) [m] of samples. i and j are their float64 indices along x and along y.

        If the samples are quadrature nodes within pixels, their positions scale with the radius of the beam's pupil and
        carry derivatives with respect to it. The points of a grid are fixed.
        """

    def field(self, beam: Beam, types: Precision) -> Field:
        """Return the field behind the pupil times the areas of the samples [m²]."""


@dataclass(frozen=True)
class GridSamples:
    """A grid that represents a soft aperture."""

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

    def places(self, i: Array, j: Array, beam: Beam, types: Precision) -> tuple[Array, Array]:
        import drjit as dr

        middle, pitch = dr.opaque(types.Float64, self.grid.shape[0] // 2), opaque(types, self.grid.dx)
        return (i - middle) * pitch, (j - middle) * pitch

    def field(self, beam: Beam, types: Precision) -> Field:
        return beam.behind(self.edge.aperture, self.grid, types).scaled(self.grid.dx**2)


@dataclass(frozen=True)
class PixelSamples:
    """Nodes within the pixels of an aperture. Each pixel has `across` nodes along each axis.

    The nodes are computed on request and not stored, because objects of this class are cached for a long time.
    """

    aperture: PixelatedAperture
    across: int
    radius: float

    @property
    def at(self) -> np.ndarray:
        return self.aperture.rows(self.across) * self.radius

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which all quadrature nodes have the weight 0.

        It is the pupil's radius plus the diagonal of the aperture's widest pixel. A pixel that is partly outside the
        aperture has nodes outside it, too, with weights other than 0. The weights are such that sums over the pixel's
        nodes are integrals over its open part.
        """
        return self.radius * (1 + math.sqrt(2) * self.aperture.widest)

    @property
    def seconds(self) -> float:
        return (self.aperture.count * self.across) ** 2 * PIXEL_NODE_GEOMETRY

    def places(self, i: Array, j: Array, beam: Beam, types: Precision) -> tuple[Array, Array]:
        return self.along(i, beam, types), self.along(j, beam, types)

    def along(self, index: Array, beam: Beam, types: Precision) -> Array:
        """Return the positions of samples along one axis."""
        import drjit as dr

        rows = types.Float64(padded_for_packets(self.aperture.rows(self.across)))
        return dr.gather(types.Float64, rows, types.Index(index)) * opaque(types, beam.radius)

    def field(self, beam: Beam, types: Precision) -> Field:
        radius, at = opaque(types, beam.radius), self.aperture.rows(self.across)
        x, y = (types.Float64(padded_for_packets(axis)) for axis in np.meshgrid(at, at))
        weight = types.Float64(padded_for_packets(self.aperture.weights(self.across))) * radius * radius
        if beam.pupil.mask is not None:
            weight *= beam.pupil.amplitude(x, y)
        grid = Grid.square(len(at), 2 * self.radius / len(at))
        return Field.from_waves(weight, beam.waves(x * radius, y * radius), grid, types)


def pixel_samples(aperture: PixelatedAperture, cycles: float, digits: float, radius: float) -> PixelSamples | None:
    """Return the fewest nodes with which integrals over the aperture are accurate enough.

    The result is None if the pixels are so coarse that each would need too many nodes.

    cycles: highest spatial frequency of the integrand [cycles per pupil radius].
    digits: accuracy of the integrals [decimal digits].
    radius: radius of the pupil [m].
    """
    across = aperture.nodes_across(cycles, digits)
    return None if across is None else PixelSamples(aperture, across, radius)


def cell_samples(problem: Problem, band: float | None = None) -> PixelSamples | None:
    """Return quadrature nodes for derivatives with respect to the samples of a relief, wavefront or mask.

    These samples are interpolated by cubic splines, whose knots divide the pupil into rectangles (cells). Each cell has
    the same number of nodes. The result is None if there would be too many cells.

    band: highest frequency [1/m] of the light's spectrum that the nodes must resolve. None: for each point of the
        window, they resolve the phase of the light that passes the pupil and arrives at this point.
    """
    cells = problem.cells(band)
    return None if cells is None or cells.fixed is None else PixelSamples(cells, cells.fixed, problem.radius)


def samples_of(problem: Problem) -> PupilSamples | None:
    """Return the fewest samples that resolve the total phase: the pupil's phase plus that of the path to the window.

    The result is None if the pixels of a relief are so coarse that each would need too many nodes. For a pupil without
    pixels, it is None if the grid would be too large. It is also None if derivatives with respect to samples of a
    relief, wavefront or mask are requested, and the pupil would have to be divided into too many rectangles (see
    `cell_samples`).
    """
    if problem.knots is not None:
        return cell_samples(problem)
    if problem.pixelated is not None:
        return pixel_samples(problem.pixelated, *node_rule(problem), problem.radius)
    edge = problem.soft_edge(problem.turning)
    pitch = 1 / (problem.turning + edge.stopband)
    if edge.outermost / pitch > MOST_ACROSS:
        return None
    return GridSamples(edge, Grid.square(2 * math.ceil(edge.outermost / pitch) + 1, pitch))
