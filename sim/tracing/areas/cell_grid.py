"""The grid of square cells, free or filled by a wall, that divides a world, and a lookup of the cell around a point."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.wall_intersection import cells_of
from sim.tracing.walls import Walls


@dataclass(frozen=True)
class CellGrid:
    """Cells of the grid in which the walls of a world stand. The grid ends at the outermost faces of the walls.

    side: side of a cell [m]
    corner: corner of the grid with the smallest x and y [m], (2,)
    free: True for cells without a wall, (row, column)
    """

    side: float
    corner: np.ndarray
    free: np.ndarray

    @classmethod
    def from_walls(cls, walls: Walls) -> CellGrid:
        """Return the coarsest grid in which each wall fills whole cells.

        Raises:
            NoClosedForm: the walls do not lie on a grid, or they overlap.
        """
        side, origin, cells = cells_of(walls)
        return cls(side, origin, cells < 0)

    @property
    def numbers(self) -> np.ndarray:
        """Index of each free cell, a cell without a wall, among the free cells, (row, column).

        Free cells are counted from 0, row by row. Cells with a wall have the value 0, like the first free cell.
        """
        return np.where(self.free, np.cumsum(self.free).reshape(self.free.shape) - 1, 0)

    @property
    def corners(self) -> np.ndarray:
        """Corner with the smallest x and y [m] of each cell without a wall, (cell, 2)."""
        row, column = np.nonzero(self.free)
        found: np.ndarray = self.corner + self.side * np.stack([column, row], axis=-1)
        return found

    def locate(self, point: Array, table: Array) -> tuple[Array, Array, Array]:
        """Return the table's entry for the cell that contains a point, and the point's x and y in this cell, in [0, 1].

        Points outside the grid are moved to its border.

        table: one number per cell, row by row
        """
        rows, columns = self.free.shape
        x, y = ((point[i] - float(self.corner[i])) * (1 / self.side) for i in range(2))
        column, row = dr.clip(dr.floor(x), 0, columns - 1), dr.clip(dr.floor(y), 0, rows - 1)
        value = dr.gather(mi.Float, table, mi.UInt32(row * columns + column))
        return value, dr.clip(x - column, 0, 1), dr.clip(y - row, 0, 1)
