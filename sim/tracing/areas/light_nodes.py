"""Nodes at which the light that walls and floor reflect to each other is computed, and interpolation between them.

Every free cell of the walls' grid has nodes on its floor and on its four sides, where walls may stand. For every free
cell, the light on a moving body is computed as well, with the body's centre at several positions in the cell.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas.cell_grid import CellGrid
from sim.tracing.areas.patch import Patch
from sim.tracing.walls import NoClosedForm, Walls

# Chosen. In navigation, half the density of nodes doubles the error. In a maze, where an agent hides light from walls
# nearby, half the density of bodies' places increases the error by a fifth; twice the density decreases it by 3 %.
SPACING = 0.25  # largest spacing of nodes on floor and walls [m]
BODY_SPACING = 0.5  # largest spacing of bodies' places [m]
MARGIN = 0.02  # smallest distance from a cell's borders [m], so that nodes lie on one side of each edge
MOST_MARGIN = 1 / 4  # largest distance of bodies' places from a cell's borders, as a fraction of the cell's side
MOST_NODES = 2**22
SIDES = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])  # sides of a cell, on which walls may stand


@dataclass(frozen=True)
class LightNodes:
    """Nodes of a world: points of floor and walls, and positions of bodies, at which reflected light is tabulated.

    grid: free cells
    floor, top: heights of the floor and of the walls' tops [m]
    across, up: numbers of nodes along a cell and up a wall
    places: number of positions of a body's centre along a cell
    """

    grid: CellGrid
    floor: float
    top: float
    across: int
    up: int
    places: int

    @classmethod
    def from_walls(cls, walls: Walls) -> LightNodes:
        """Return the nodes, at which reflected light is tabulated, of a world whose walls all have the same height.

        Raises:
            NoClosedForm: there are no walls, the walls overlap or do not lie on a grid, or there are too many nodes.
        """
        if not len(walls):
            raise NoClosedForm("no walls, between which light would be reflected")
        grid, floor, top = CellGrid.from_walls(walls), walls.floor, float(walls.top.max())
        across, up = _count(grid.side, SPACING), _count(top - floor, SPACING)
        total = grid.free.sum() * across * (across + len(SIDES) * up)
        if total > MOST_NODES:
            raise NoClosedForm(f"{total} nodes for reflected light")
        return cls(grid, floor, top, across, up, _count(grid.side, BODY_SPACING))

    def body_margin(self, radius: float) -> float:
        """Return the smallest distance [m] of a body's centre from a cell's border in the tables of light on bodies.

        The tables contain the light for several positions of the body in each cell of the walls' grid. The smallest
        distance is the body's radius, because walls may stand at the borders, and a body's centre cannot be closer to a
        wall. For large bodies, the smallest distance is a quarter of the cell's side instead.

        radius: radius of the body [m]
        """
        return min(radius, MOST_MARGIN * self.grid.side)

    @property
    def cells(self) -> np.ndarray:
        """Index of each cell of the walls' grid among the cells without a wall; cells with a wall have the value 0.

        The indices start at 0. They are a flat float32 array for the kernel, row by row (`CellGrid.numbers`).
        """
        return self.grid.numbers.astype(np.float32).ravel()


@dataclass(frozen=True)
class NodeTables:
    """Tables of the reflected light at the nodes, the points of floor and walls for which it was computed in advance.

    cells: index of each cell of the walls' grid among the cells without a wall, see `CellGrid.numbers`
    floor, walls: irradiance at the nodes of the floor and of the walls, one array for each component of the light (a
        spectral band or a fixed spectrum)
    """

    cells: Array
    floor: list[Array]
    walls: list[Array]


class NodeLight:
    """Light interpolated between nodes, from tables that are passed to each call.

    nodes: nodes at which the light is known
    components: number of components of the light, which are spectral bands or fixed spectra
    """

    def __init__(self, nodes: LightNodes, components: int) -> None:
        self._nodes, self._components = nodes, components

    def on_floor(self, patch: Patch, tables: NodeTables) -> list[Array]:
        """Return the irradiance of a patch of the floor due to reflected light.

        There is one array for each component of the light, a spectral band or a fixed spectrum.
        """
        cell, x, y = self._nodes.grid.locate(patch.point, tables.cells)
        n = self._nodes.across
        return self._interpolate(tables.floor, cell * (n * n), (x, n), (y, n))

    def on_wall(self, patch: Patch, tables: NodeTables) -> list[Array]:
        """Return the irradiance of a patch of a wall due to reflected light.

        There is one array for each component of the light, a spectral band or a fixed spectrum.
        """
        normal = patch.normal
        cell, x, y = self._nodes.grid.locate(patch.point + normal * MARGIN, tables.cells)
        along_y = dr.abs(normal.x) > 0.5
        side = dr.select(along_y, dr.select(normal.x > 0, 0.0, 1.0), dr.select(normal.y > 0, 2.0, 3.0))
        z = (patch.point.z - self._nodes.floor) * (1 / (self._nodes.top - self._nodes.floor))
        first = (cell * len(SIDES) + side) * (self._nodes.across * self._nodes.up)
        across = dr.select(along_y, y, x)
        return self._interpolate(tables.walls, first, (across, self._nodes.across), (z, self._nodes.up))

    def on_surface(self, point: Array, normal: Array, tables: NodeTables) -> list[Array]:
        """Return the irradiance that reflected light causes at a point of the floor or of a wall.

        There is one array for each component of the light, a spectral band or a fixed spectrum.
        """
        nothing = mi.Vector3f(0)
        patch = Patch(point, normal, nothing, nothing)
        either = zip(self.on_floor(patch, tables), self.on_wall(patch, tables), strict=True)
        return [dr.select(normal.z > 0.5, floor, wall) for floor, wall in either]

    @staticmethod
    def _interpolate(light: list[Array], first: Array, across: tuple[Array, int], up: tuple[Array, int]) -> list[Array]:
        found = list(corners(first, across, up))
        return [sum((dr.gather(mi.Float, of, i) * w for i, w in found), mi.Float(0)) for of in light]


def corners(first: Array, *axes: tuple[Array, int]) -> Iterator[tuple[Array, Array]]:
    """Yield the index of each of the four nodes around a position, and its weight in bilinear interpolation.

    The nodes form a regular grid on a rectangle, such as one wall.

    first: index of the rectangle's first node
    axes: the position's x and y on the rectangle, in [0, 1], each with the number of nodes along this axis
    """
    (x, nx), (y, ny) = axes
    x, y = dr.clip(x, 0, 1) * (nx - 1), dr.clip(y, 0, 1) * (ny - 1)
    i, j = dr.minimum(dr.floor(x), nx - 2), dr.minimum(dr.floor(y), ny - 2)
    for b, wy in ((0, 1 - (y - j)), (1, y - j)):
        for a, wx in ((0, 1 - (x - i)), (1, x - i)):
            yield mi.UInt32(first + (j + b) * nx + i + a), wx * wy


def _count(length: float, spacing: float) -> int:
    return max(math.ceil(length / spacing - 1e-6), 1) + 1
