"""Intersections of rays with upright walls.

If there are at most 8 walls, each ray is tested against every wall. If there are more, each ray is followed from cell
to cell through a grid in which walls fill whole cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats
from sim.tracing.walls import ALIGNED, SIDES, NoClosedForm, Walls

# Largest number of walls that are tested one by one. For this number, a walk through a grid takes about the same time.
FEW = 8
CELLS = 1_000_000  # largest number of cells in a grid
NEVER_ZERO = 1e-9  # replaces smaller components of directions; this shifts no hit past the end of a wall


@dataclass(frozen=True)
class CellTables:
    """Tables of a grid's cells, row by row.

    wall: index of the wall that fills the cell; 0 for an empty cell
    top: height of this wall's top [m]; -inf for an empty cell
    stop: height [m] below which a ray is followed no further. It equals `top`, except that it is infinite in a ring of
        cells around the walls, where all rays stop
    """

    wall: Array
    top: Array
    stop: Array


class Footprints(Protocol):
    """A method of intersecting rays with upright walls.

    how: description of the method, for reports
    tables: cells of the grid through which the method follows rays, as arrays for the kernel; None: there is no grid,
        and walls are tested one by one
    """

    how: str
    tables: CellTables | None

    def hit(self, ray: Array, cells: CellTables | None) -> tuple[Array, Array, Array]:
        """Return the distance [m] to the first wall that a ray hits, the index of the hit face, and its normal.

        The distance is infinite without a hit, and 0 if the ray starts inside a wall.

        cells: the attribute `tables` of this method, which the kernel (the program that traces rays) receives as an
            argument
        """

    def blocks(self, start: Array, direction: np.ndarray, cells: CellTables | None) -> Array:
        """Return whether a wall stands between a point outside all walls and a light at infinity.

        start, direction: the point (Point3f), and the unit vector from it to the light, which points upwards, (3,)
        cells: the attribute `tables` of this method, which the kernel (the program that traces rays) receives as an
            argument
        """


def footprints_of(walls: Walls) -> Footprints:
    """Return the faster method to intersect rays with these walls: `EachWall` for up to 8 walls, `Cells` for more.

    `EachWall` tests every wall. `Cells` follows each ray through a grid of square cells.

    Raises:
        NoClosedForm: there are more than 8 walls, and they overlap, or no grid of at most 10⁶ cells exists in which
            each wall fills whole cells.
    """
    return EachWall(walls) if len(walls) <= FEW else Cells(walls)


class EachWall:
    """A slab test of every wall; the loop over walls is unrolled."""

    def __init__(self, walls: Walls) -> None:
        self._walls = walls
        self.how = "each solved"
        self.tables: CellTables | None = None

    def hit(self, ray: Array, cells: CellTables | None) -> tuple[Array, Array, Array]:
        """See Footprints."""
        dx, dy = _never_zero(ray.d.x), _never_zero(ray.d.y)
        ix, iy = 1 / dx, 1 / dy
        t, face, through_x = mi.Float(math.inf), mi.UInt32(0), mi.Bool(False)
        for i in range(len(self._walls)):
            near_x, near_y, far = self._slabs(i, ray.o, ix, iy)
            near = dr.maximum(near_x, near_y)
            start = dr.maximum(near, 0)
            low_enough = dr.fma(ray.d.z, start, ray.o.z) < float(self._walls.top[i])
            hit = (far > 0) & (near < far) & (start < t) & low_enough
            t = dr.select(hit, start, t)
            through_x = dr.select(hit, near_x > near_y, through_x)
            face = dr.select(hit, SIDES * i, face)
        return _finished(t, face, through_x, dx, dy)

    def blocks(self, start: Array, direction: np.ndarray, cells: CellTables | None) -> Array:
        """See Footprints."""
        dx, dy = (math.copysign(max(abs(float(d)), NEVER_ZERO), float(d)) for d in direction[:2])
        blocked = mi.Bool(False)
        for i in range(len(self._walls)):
            near_x, near_y, far = self._slabs(i, start, 1 / dx, 1 / dy)
            near = dr.maximum(dr.maximum(near_x, near_y), 0)
            blocked |= (near < far) & (dr.fma(near, float(direction[2]), start.z) < float(self._walls.top[i]))
        return blocked

    def _slabs(self, i: int, o: Array, ix: Array, iy: Array) -> tuple[Array, Array, Array]:
        (lx, ly), (ux, uy) = (map(float, corner[i]) for corner in (self._walls.lower, self._walls.upper))
        x0, x1 = (lx - o.x) * ix, (ux - o.x) * ix
        y0, y1 = (ly - o.y) * iy, (uy - o.y) * iy
        far = dr.minimum(dr.maximum(x0, x1), dr.maximum(y0, y1))
        return dr.minimum(x0, x1), dr.minimum(y0, y1), far


class Cells:
    """A walk through a grid of cells that are empty or filled by one wall.

    Rays that leave the grid stop in a ring of cells around it.
    """

    def __init__(self, walls: Walls) -> None:
        self._side, origin, cells = cells_of(walls)
        shape = cells.shape
        self._climb, self._ceiling = float(walls.top.max() - walls.floor), float(walls.top.max())
        self.how = f"found in a grid of {shape[1]} x {shape[0]} cells"
        padded = np.pad(cells, 1, constant_values=-1)
        self._corner = origin - self._side
        self._rows, self._columns = padded.shape
        filled = padded >= 0
        tops = np.where(filled, walls.top[np.maximum(padded, 0)], -np.inf)
        edge = np.ones_like(filled)
        edge[1:-1, 1:-1] = False
        # A ray that leaves the grid stops without a hit.
        tables = np.maximum(padded, 0), tops, np.where(edge, np.inf, tops)
        self.tables: CellTables | None = CellTables(*(floats(table) for table in tables))

    def hit(self, ray: Array, cells: CellTables | None) -> tuple[Array, Array, Array]:
        """See Footprints."""
        assert cells is not None
        dx, dy = _never_zero(ray.d.x), _never_zero(ray.d.y)
        x, y = self._place(ray.o)
        column, row = dr.floor(x), dr.floor(y)
        per_x, per_y = self._side / abs(dx), self._side / abs(dy)
        next_x = dr.select(dx > 0, column + 1 - x, x - column) * per_x
        next_y = dr.select(dy > 0, row + 1 - y, y - row) * per_y
        step_x = dr.select(dx > 0, mi.Int32(1), mi.Int32(-1))
        step_y = dr.select(dy > 0, mi.Int32(self._columns), mi.Int32(-self._columns))
        cell = dr.select(self._inside(column, row), mi.Int32(row * self._columns + column), 0)
        z, dz, stop = ray.o.z, ray.d.z, cells.stop

        def going(t: Array, cell: Array, next_x: Array, next_y: Array, through_x: Array) -> Array:
            height = dr.fma(dz, t, z)
            return (height >= dr.gather(mi.Float, stop, cell)) & ((height <= self._ceiling) | (dz <= 0))

        def walk(t: Array, cell: Array, next_x: Array, next_y: Array, through_x: Array) -> tuple[Array, ...]:
            through_x = next_x < next_y
            t = dr.minimum(next_x, next_y)
            cell = cell + dr.select(through_x, step_x, step_y)
            next_x = dr.select(through_x, next_x + per_x, next_x)
            next_y = dr.select(through_x, next_y, next_y + per_y)
            return t, cell, next_x, next_y, through_x

        state = (mi.Float(0), cell, next_x, next_y, mi.Bool(False))
        t, cell, _, _, through_x = dr.while_loop(state, going, walk, label="cells")
        hit = dr.fma(dz, t, z) < dr.gather(mi.Float, cells.top, cell)
        face = SIDES * mi.UInt32(dr.gather(mi.Float, cells.wall, cell))
        return _finished(dr.select(hit, t, math.inf), face, through_x, dx, dy)

    def blocks(self, start: Array, direction: np.ndarray, cells: CellTables | None) -> Array:
        """See Footprints.

        The loop over the grid's cells is unrolled, because a ray towards the light crosses only a few cells until it is
        above all walls.
        """
        assert cells is not None
        dx, dy, dz = map(float, direction)
        x, y = self._place(start)
        column, row = dr.floor(x), dr.floor(y)
        per_x, per_y = (self._side / max(abs(d), NEVER_ZERO) for d in (dx, dy))
        next_x = (column + 1 - x if dx > 0 else x - column) * per_x
        next_y = (row + 1 - y if dy > 0 else y - row) * per_y
        blocked = mi.Bool(False)
        for _ in range(self._crossings(direction)):
            through_x = next_x < next_y
            t = dr.minimum(next_x, next_y)
            column = dr.select(through_x, column + math.copysign(1, dx), column)
            row = dr.select(through_x, row, row + math.copysign(1, dy))
            next_x = dr.select(through_x, next_x + per_x, next_x)
            next_y = dr.select(through_x, next_y, next_y + per_y)
            inside = self._inside(column, row)
            cell = mi.UInt32(row * self._columns + column)
            blocked |= inside & (dr.fma(t, dz, start.z) < dr.gather(mi.Float, cells.top, cell, inside))
        return blocked

    def _crossings(self, direction: np.ndarray) -> int:
        """Return the largest number of cell borders that a ray from the floor crosses until it is above all walls."""
        reach = self._climb * np.abs(direction[:2]) / direction[2] / self._side
        return int(np.ceil(reach).sum())

    def _inside(self, column: Array, row: Array) -> Array:
        return (column >= 0) & (column < self._columns) & (row >= 0) & (row < self._rows)

    def _place(self, point: Array) -> tuple[Array, Array]:
        """Return x and y of a point relative to the grid's lower corner, in units of a cell's side."""
        return tuple((point[i] - float(self._corner[i])) * (1 / self._side) for i in range(2))


def cells_of(walls: Walls) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the coarsest grid in which each wall fills whole cells.

    The result is the side of a cell [m], the grid's lower corner (2,), and the index of the wall that fills each cell
    (row, column), -1 for none.

    Raises:
        NoClosedForm: the walls do not lie on a grid, or they overlap.
    """
    side, origin, shape = _grid(walls)
    cells = np.full(shape, -1)
    for i, (low, high) in enumerate(zip(walls.lower, walls.upper, strict=True)):
        first, last = (np.rint((c - origin) / side).astype(int) for c in (low, high))
        if (cells[first[1] : last[1], first[0] : last[0]] >= 0).any():
            raise NoClosedForm("walls overlap")
        cells[first[1] : last[1], first[0] : last[0]] = i
    return side, origin, cells


def _finished(t: Array, face: Array, through_x: Array, dx: Array, dy: Array) -> tuple[Array, Array, Array]:
    """Return the distance [m], the index of the hit face, and its normal.

    face: index of the wall's first face. The faces of a wall are in the order -x, +x, -y, +y.
    through_x: True if the ray enters through a face that is perpendicular to x
    dx, dy: direction of the ray
    """
    x, y = dr.select(dx > 0, -1.0, 1.0), dr.select(dy > 0, -1.0, 1.0)
    side = dr.select(
        through_x, dr.select(dx > 0, mi.UInt32(0), mi.UInt32(1)), dr.select(dy > 0, mi.UInt32(2), mi.UInt32(3))
    )
    normal = mi.Normal3f(dr.select(through_x, x, 0), dr.select(through_x, 0, y), 0)
    return t, face + side, normal


def _never_zero(d: Array) -> Array:
    return dr.select(abs(d) < NEVER_ZERO, dr.copysign(mi.Float(NEVER_ZERO), d), d)


def _grid(walls: Walls) -> tuple[float, np.ndarray, tuple[int, int]]:
    """Return the coarsest square grid whose lines contain all faces of the walls.

    The result is the side of a cell [m], the lower corner (2,), and the numbers of rows and columns.

    Raises:
        NoClosedForm: there is no such grid, or it has more than 10⁶ cells.
    """
    faces = [np.unique(np.round(np.concatenate([walls.lower[:, a], walls.upper[:, a]]), 6)) for a in range(2)]
    origin = np.array([f[0] for f in faces])
    side = 0.0
    for gap in np.concatenate([f - f[0] for f in faces]):
        side = _common(side, float(gap))
    extent = np.array([f[-1] - f[0] for f in faces]) / side
    columns, rows = np.rint(extent).astype(int)
    if side < ALIGNED or rows * columns > CELLS:
        raise NoClosedForm(f"{len(walls)} walls that lie on no grid")
    return side, origin, (int(rows), int(columns))


def _common(a: float, b: float) -> float:
    """Return the greatest common divisor of two lengths, with a tolerance of 10⁻⁶ m."""
    while b > ALIGNED:
        a, b = b, a % b
        if a - b < ALIGNED:
            b = 0.0
    return a
