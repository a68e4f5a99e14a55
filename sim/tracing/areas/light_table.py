"""Light that the world's own walls and floor send on to each other, baked: found once by brute force, then looked up.

Every free cell of the grid has a table of its own for its floor and for each of the walls around it, and one for bodies
in it: how much light arrives on their surface from any side. Nothing that moves is in the tables, but the shadow that a
body casts on the floor from which light reaches it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.receptive_fields import low_discrepancy
from sim.tracing import lighting
from sim.tracing.areas.cell_grid import CellGrid
from sim.tracing.areas.patch import Patch
from sim.tracing.closed_form_tracer import ClosedForm

SPACING = 0.25  # [m] of nodes on floor and walls, at most
BODY_SPACING = 0.5  # [m] of the places of bodies, at most
MARGIN = 0.02  # [m] from a cell's borders, at least: nodes lie on one side of each edge
RAYS = 1024  # from a node
NORMALS = 96  # of a body's surface, to which sixteen harmonics are fitted
LANES = 2**21  # rays traced at once
SIDES = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])  # on which side of its cell a wall stands
FOURS = 4  # of floats: sixteen harmonics


class LightTable:
    """tracer: of rays through the same world, whose components the tables have
    radii, heights: of the bodies and of their centres [m]

    tables: float32 arrays for the kernel
    """

    def __init__(self, tracer: ClosedForm, radii: np.ndarray, heights: np.ndarray) -> None:
        walls = tracer.walls
        self._grid, self._tracer, self._radii, self._heights = CellGrid.of(walls), tracer, radii, heights
        self._floor, self._top = walls.floor, float(walls.top.max())
        self._across = _nodes(self._grid.side, SPACING)
        self._up = _nodes(self._top - self._floor, SPACING)
        self._places = _nodes(self._grid.side, BODY_SPACING)
        self._kinds = sorted({(float(r), float(h)) for r, h in zip(radii, heights, strict=True)})
        self.tables = {"cells": self._grid.numbers.astype(np.float32).ravel()}
        for name, light in (("floor", self._on_floor()), ("walls", self._on_walls())):
            self.tables |= {f"bounced_{name}_{k}": column for k, column in enumerate(light.T.astype(np.float32))}
        for i, kind in enumerate(self._kinds):
            light = self._on_body(*kind)
            self.tables |= {f"bounced_body_{i}_{k}": light[..., k].ravel() for k in range(light.shape[-1])}

    def on_floor(self, patch: Patch, inputs: dict[str, Array]) -> list[Array]:
        """Irradiance of what is reflected onto a patch of the floor, per component."""
        cell, x, y = self._grid.locate(patch.point, inputs["cells"])
        n = self._across
        return self._interpolate("bounced_floor", cell * (n * n), (x, n), (y, n), inputs)

    def on_wall(self, patch: Patch, inputs: dict[str, Array]) -> list[Array]:
        """The same of a wall."""
        normal = patch.normal
        cell, x, y = self._grid.locate(patch.point + normal * MARGIN, inputs["cells"])
        along_y = dr.abs(normal.x) > 0.5
        side = dr.select(along_y, dr.select(normal.x > 0, 0.0, 1.0), dr.select(normal.y > 0, 2.0, 3.0))
        z = (patch.point.z - self._floor) * (1 / (self._top - self._floor))
        first = (cell * len(SIDES) + side) * (self._across * self._up)
        across = dr.select(along_y, y, x)
        return self._interpolate("bounced_walls", first, (across, self._across), (z, self._up), inputs)

    def on_body(self, body: int, centre: Array, inputs: dict[str, Array]) -> list[list[Array]]:
        """Harmonics of what arrives on a body, per component, for `sum_of`."""
        kind = self._kinds.index((float(self._radii[body]), float(self._heights[body])))
        cell, x, y = self._grid.locate(centre, inputs["cells"])
        n, found = self._places, []
        for k in range(len(self._tracer.basis)):
            rows = list(_corners(cell * (n * n), (x, n), (y, n)))
            table = inputs[f"bounced_body_{kind}_{k}"]
            found.append(
                [
                    sum((dr.gather(mi.Vector4f, table, i * FOURS + four) * w for i, w in rows), mi.Vector4f(0))
                    for four in range(FOURS)
                ]
            )
        return found

    def _interpolate(
        self, name: str, first: Array, across: tuple[Array, int], up: tuple[Array, int], inputs: dict[str, Array]
    ) -> list[Array]:
        corners = list(_corners(first, across, up))
        return [
            sum((dr.gather(mi.Float, inputs[f"{name}_{k}"], i) * w for i, w in corners), mi.Float(0))
            for k in range(len(self._tracer.basis))
        ]

    def _on_floor(self) -> np.ndarray:
        """(node, component), in order of cell, y and x."""
        places = _within(self._grid.side, self._across)
        y, x = (a.ravel() for a in np.meshgrid(places, places, indexing="ij"))
        points = self._grid.corners[:, None] + np.stack([x, y], axis=-1)
        points = np.dstack([points, np.full(points.shape[:2], self._floor)]).reshape(-1, 3)
        return self._gathered(points, np.tile([0.0, 0, 1], (len(points), 1)))

    def _on_walls(self) -> np.ndarray:
        """(node, component), in order of cell, side, z and place along the wall; 0 where there is no wall."""
        n, grid = self._across * self._up, self._grid
        light = np.zeros((len(grid.corners), len(SIDES), n, len(self._tracer.basis)))
        free = np.pad(grid.free, 1, constant_values=True)
        row, column = np.nonzero(grid.free)
        places, ups = _within(grid.side, self._across), self._floor + _within(self._top - self._floor, self._up)
        z, along = (a.ravel() for a in np.meshgrid(ups, places, indexing="ij"))
        for s, side in enumerate(SIDES):
            mine = ~free[row + 1 + side[1], column + 1 + side[0]]
            axis = int(np.argmax(np.abs(side)))
            points = np.empty((mine.sum(), n, 3))
            points[..., axis] = grid.corners[mine, axis, None] + (grid.side if side[axis] > 0 else 0)
            points[..., 1 - axis] = grid.corners[mine, 1 - axis, None] + along
            points[..., 2] = z
            normal = np.array([-side[0], -side[1], 0.0])
            found = self._gathered(points.reshape(-1, 3), np.tile(normal, (mine.sum() * n, 1)))
            light[mine, s] = found.reshape(mine.sum(), n, -1)
        return light.reshape(-1, light.shape[-1])

    def _on_body(self, radius: float, height: float) -> np.ndarray:
        """Harmonics (place, FOURS * 4, component) of the light on a body's surface, in order of cell, y and x."""
        offsets = np.linspace(0, self._grid.side, self._places)
        y, x = (a.ravel() for a in np.meshgrid(offsets, offsets, indexing="ij"))
        centres = (self._grid.corners[:, None] + np.stack([x, y], axis=-1)).reshape(-1, 2)
        centres = np.column_stack([centres, np.full(len(centres), height)])
        normals = _evenly(NORMALS)
        points = (centres[:, None] + radius * normals).reshape(-1, 3)
        turned, owners = np.tile(normals, (len(centres), 1)), np.repeat(centres, NORMALS, axis=0)
        light = self._gathered(points, turned, RAYS // 4, (radius, owners)).reshape(len(centres), NORMALS, -1)
        fit = np.linalg.pinv(np.stack(harmonics(*normals.T), axis=-1))
        fours = np.zeros((len(centres), 4 * FOURS, light.shape[-1]), np.float32)
        fours[:, : len(fit)] = np.einsum("hn,cnk->chk", fit, light)
        return fours

    def _gathered(
        self, points: np.ndarray, normals: np.ndarray, rays: int = RAYS, shade: tuple[float, np.ndarray] | None = None
    ) -> np.ndarray:
        """Irradiance of what walls and floor reflect onto points (n, 3), per component, (n, component); shade: radius
        and centre of a body at each point that casts its shadow."""
        samples = mi.Point2f(
            *(mi.Float(np.tile(c, max(LANES // rays, 1)).astype(np.float32)) for c in low_discrepancy(rays).T)
        )
        dr.eval(samples)
        step, found = max(LANES // rays, 1), []
        for first in range(0, len(points), step):
            part = slice(first, first + step)
            # As many lanes every time, so that one kernel serves all.
            point, normal, body = (
                mi.Point3f(*(mi.Float(np.repeat(np.resize(c, step), rays).astype(np.float32)) for c in a[part].T))
                for a in (points, normals, shade[1] if shade else points)
            )
            ray = lighting.onwards(point, mi.Normal3f(normal), samples)
            light = self._tracer.returned(ray, body, shade[0] if shade else 0.0)
            means = [dr.block_reduce(dr.ReduceOp.Add, c, rays) for c in light]
            dr.eval(means)
            found.append(np.stack([np.array(m) / rays for m in means], axis=-1)[: len(points[part])])
        return np.concatenate(found) if found else np.zeros((0, len(self._tracer.basis)))


def sum_of(fours: list[Array], normal: Array) -> Array:
    """What harmonics, in fours, say of a direction."""
    values = harmonics(normal.x, normal.y, normal.z)
    return sum((four[i] * v for four, i, v in _spread(fours, values)), mi.Float(0))


def _spread(fours: list[Array], values: list[Array]) -> Iterator[tuple[Array, int, Array]]:
    for i, value in enumerate(values):
        yield fours[i // 4], i % 4, value


def harmonics(x: Array, y: Array, z: Array) -> list[Array]:
    """Spherical harmonics of degree 0 to 3 in the direction (x, y, z), not normalised."""
    xx, yy, zz = x * x, y * y, z * z
    flat = [x * 0 + 1, x, y, z, x * y, y * z, z * x, xx - yy, 3 * zz - 1]
    cubic = [y * (3 * xx - yy), x * y * z, y * (5 * zz - 1), z * (5 * zz - 3), x * (5 * zz - 1), z * (xx - yy)]
    return [*flat, *cubic, x * (xx - 3 * yy)]


def _corners(first: Array, *axes: tuple[Array, int]) -> Iterator[tuple[Array, Array]]:
    """Index and weight of the four nodes around a place (x, y) in [0, 1], of so many nodes along each axis."""
    (x, nx), (y, ny) = axes
    x, y = dr.clip(x, 0, 1) * (nx - 1), dr.clip(y, 0, 1) * (ny - 1)
    i, j = dr.minimum(dr.floor(x), nx - 2), dr.minimum(dr.floor(y), ny - 2)
    for b, wy in ((0, 1 - (y - j)), (1, y - j)):
        for a, wx in ((0, 1 - (x - i)), (1, x - i)):
            yield mi.UInt32(first + (j + b) * nx + i + a), wx * wy


def _nodes(length: float, spacing: float) -> int:
    return max(math.ceil(length / spacing - 1e-6), 1) + 1


def _within(length: float, nodes: int) -> np.ndarray:
    """Their places, off the ends."""
    return np.clip(np.linspace(0, length, nodes), MARGIN, length - MARGIN)


def _evenly(n: int) -> np.ndarray:
    """n directions (n, 3): Fibonacci's spiral."""
    i = np.arange(n) + 0.5
    z, azimuth = 1 - 2 * i / n, np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], axis=-1)
