"""The fraction of a patch that a light reaches.

Edges of shadows are treated as straight lines across the patch, unless a sphere's shadow is small and lies within it.
"""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats
from sim.tracing.areas.branches import only_where
from sim.tracing.areas.half_planes import share_above
from sim.tracing.areas.patch import Patch
from sim.tracing.wall_intersection import NEVER_ZERO, cells_of
from sim.tracing.walls import NoClosedForm, Walls

# [m] distance of a point in front of a patch; the point identifies the cell from which the patch is visible
BESIDE = 1e-3
NEIGHBOURS = tuple((row, column) for row in (-1, 0, 1) for column in (-1, 0, 1))


def lit_past_sphere(patch: Patch, directions: list[list[float]], centre: Array, radius: Array) -> list[Array]:
    """Return the fraction of a patch that lies outside a sphere's shadow, for each light.

    directions: unit vectors towards the lights
    """
    way = centre - patch.point
    slope = max(math.hypot(*d[:2]) / d[2] for d in directions)
    patch_reach = (dr.norm(patch.along) + dr.norm(patch.across)) / 2
    reach = slope * dr.maximum(way.z + radius, 0) + (radius + patch_reach)
    near = dr.squared_norm(way.xy) < reach * reach

    def lit() -> list[Array]:
        return [_lit_past_sphere(patch, direction, way, radius) for direction in directions]

    return only_where(near, lit, [1.0] * len(directions))


def _lit_past_sphere(patch: Patch, direction: list[float], way: Array, radius: Array) -> Array:
    """Return the fraction of a patch of a surface that lies outside a sphere's shadow, for one light.

    The fraction in the shadow is the smaller of two estimates. The first estimate treats the shadow as a strip between
    two parallel straight lines that touch its rim on opposite sides. It suits patches much smaller than the shadow. The
    second estimate treats the shadow as a disk that lies wholly within the patch. It suits large patches.

    direction: unit vector towards the light
    way: vector from the middle of the patch to the centre of the sphere
    """
    towards = mi.Vector3f(*direction)
    ahead = dr.dot(way, towards)
    beside = way - ahead * towards
    distance = dr.norm(beside)
    across = beside / dr.maximum(distance, NEVER_ZERO)
    p, q = dr.dot(across, patch.along), dr.dot(across, patch.across)
    strip = share_above(radius - distance, p, q) - share_above(-radius - distance, p, q)
    seen = dr.abs(dr.dot(towards, dr.cross(patch.along, patch.across)))  # area of the patch, seen from the light
    disk = math.pi * dr.square(radius) / dr.maximum(seen, NEVER_ZERO)
    return 1 - dr.select(ahead > 0, dr.minimum(strip, disk), 0)


class WallShadows:
    """Shadows of walls that all have the same height.

    A shadow must not be longer than a cell, a square of the walls' grid. Below the walls' tops, a ray towards a light
    therefore crosses at most one border of cells along x and one along y. It enters the neighbouring cell along x or
    the one along y, and then possibly their common neighbour, the diagonal one. A table states which neighbours of each
    cell are walls. A patch of a surface is divided by three straight lines. The first line separates points whose rays
    are above the walls' tops when they reach the neighbour along x from points whose rays are below. The second line
    does the same for the neighbour along y. The third line separates points whose rays enter the neighbour along x
    first from points whose rays enter the neighbour along y first.

    around: this table, an array for the kernel; None without walls

    Raises:
        NoClosedForm: some walls overlap or do not fit a grid, or shadows are longer than a cell.
    """

    def __init__(self, walls: Walls, directions: list[list[float]]) -> None:
        self._top = float(walls.top.max(initial=walls.floor))
        self._any = len(walls) > 0
        self.around: Array | None = None
        if not self._any:
            return
        self._side, origin, cells = cells_of(walls)
        reach = max(max(abs(d[0]), abs(d[1])) / d[2] for d in directions) * (self._top - walls.floor)
        if reach > self._side:
            raise NoClosedForm(f"shadows of {reach:.2g} m on a grid of {self._side:.2g} m")
        filled = np.pad(cells >= 0, 2)
        around = sum(
            2**bit * filled[1 + row : filled.shape[0] - 1 + row, 1 + column : filled.shape[1] - 1 + column]
            for bit, (row, column) in enumerate(NEIGHBOURS)
        )
        self._corner, (self._rows, self._columns) = origin - self._side, around.shape
        self.around = floats(around)

    def visibility(self, patch: Patch, directions: list[list[float]], table: Array | None) -> list[Array]:
        """Return the fraction of a patch of a surface that the light of each lamp reaches, one array per lamp.

        directions: unit vectors towards the lamps
        table: the attribute `around`, which states which neighbours of each cell are walls; None without walls
        """
        if table is None:
            return [mi.Float(1) for _ in directions]
        clear = patch.point + patch.normal * BESIDE
        x, y = ((clear[i] - float(self._corner[i])) * (1 / self._side) for i in range(2))
        column, row = dr.clip(dr.floor(x), 0, self._columns - 1), dr.clip(dr.floor(y), 0, self._rows - 1)
        around = mi.UInt32(dr.gather(mi.Float, table, mi.UInt32(row * self._columns + column)))
        concerns = mi.Bool(False)
        for direction in directions:
            facing = dr.dot(patch.normal, mi.Vector3f(*direction)) > 0
            bits = sum(1 << NEIGHBOURS.index(cell) for cell in _behind(direction))
            concerns |= facing & ((around & bits) != 0)

        def lit() -> list[Array]:
            return [self._lit_from(patch, direction, row, column, around) for direction in directions]

        return only_where(concerns, lit, [1.0] * len(directions))

    def _lit_from(self, patch: Patch, direction: list[float], row: Array, column: Array, around: Array) -> Array:
        """Return the fraction of a patch of a surface that lies outside the shadows of walls in neighbouring cells.

        Rays to the light may enter three neighbours: the one along x, the one along y, and the diagonal one.

        direction: unit vector towards the light
        row, column: cell in front of the patch
        around: bits that state which of the nine cells around are walls, in the order of `NEIGHBOURS`
        """
        dx, dy = (math.copysign(max(abs(d), NEVER_ZERO), d) for d in direction[:2])
        dz = direction[2]
        crosses_x, crosses_y = (
            (float(self._corner[i]) + (cell + (d > 0)) * self._side - patch.point[i]) / d
            for i, (cell, d) in enumerate(((column, dx), (row, dy)))
        )
        climbs = (self._top - patch.point.z) / dz
        behind_x = _share(climbs - crosses_x, patch, (1 / dx, 0, -1 / dz))
        behind_y = _share(climbs - crosses_y, patch, (0, 1 / dy, -1 / dz))
        x_first = _share(crosses_y - crosses_x, patch, (1 / dx, -1 / dy, 0))
        in_x, in_y, in_corner = (_has(around, cell) for cell in _behind(direction))
        corner = behind_x * behind_y
        dark = dr.select(in_corner, corner, 0)
        dark = dr.select(in_x, dr.select(in_corner, behind_x, behind_x * x_first), dark)
        alone_y = dr.select(in_corner, behind_y, behind_y * (1 - x_first))
        dark = dr.select(in_y, dr.select(in_x, behind_x + behind_y - corner, alone_y), dark)
        return 1 - dark


def _share(value: Array, patch: Patch, gradient: tuple[float, float, float]) -> Array:
    g = mi.Vector3f(*gradient)
    return share_above(value, dr.dot(g, patch.along), dr.dot(g, patch.across))


def _behind(direction: list[float]) -> tuple[tuple[int, int], ...]:
    """Return the three neighbouring cells that a ray may enter on its way from a cell to a light.

    They are the neighbour along x, the neighbour along y and the diagonal neighbour, each as its offset in rows and
    columns from the cell.

    direction: vector towards the light
    """
    x, y = (1 if d > 0 else -1 for d in direction[:2])
    return (0, x), (y, 0), (y, x)


def _has(around: Array, cell: tuple[int, int]) -> Array:
    return (around & (1 << NEIGHBOURS.index(cell))) != 0
