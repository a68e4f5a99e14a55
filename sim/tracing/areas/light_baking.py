"""Computation of the tables of reflected light by brute force: many rays are traced from each of many points.

The tables describe the static scene. They take moving bodies into account in one way only: a body's shadows on floor
and walls reduce the light that floor and walls reflect back to the body.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.receptive_fields import low_discrepancy
from sim.scene.device_arrays import floats
from sim.tracing import lighting
from sim.tracing.areas.light_nodes import BODY_SPACING, MARGIN, SIDES, SPACING, LightNodes, NodeLight, NodeTables
from sim.tracing.closed_form_tracer import ClosedForm, Irradiance

# Chosen. In navigation, four times the number of rays change the error by a fiftieth.
RAYS = 256  # rays from a node
BODY_RAYS = 128  # rays from each point of a body's surface; the rays of all points determine the harmonics
NORMALS = 96  # normals of a body's surface, to which sixteen harmonics are fitted
FOURS = 4  # groups of four floats: sixteen harmonics
# Largest number of reflections. Each further reflection adds at most the light of the previous reflection times the
# surfaces' reflectance.
ORDERS = 16
CHANGE = 1e-3  # the iteration ends if all changes are at most this fraction of the largest irradiance
LANES = 2**21  # rays traced at once


class Baking:
    """Computation of the tables of reflected light on floor, walls and bodies of one world.

    tracer: tracer of rays through the world
    nodes: points of floor and walls at which the light is computed
    kinds: for each kind of body, its radius and the height of its centre [m]
    """

    def __init__(self, tracer: ClosedForm, nodes: LightNodes, kinds: list[tuple[float, float]]) -> None:
        self._tracer, self._nodes, self._kinds = tracer, nodes, kinds
        self._orders = ORDERS if tracer.light == lighting.ALL else 1
        self._arriving: Irradiance | None = None  # irradiance after fewer reflections; None: not added

    @property
    def ingredients(self) -> list[np.ndarray]:
        """All arrays that the tables depend on."""
        walls, components = self._tracer.walls, self._tracer.components
        settings = [SPACING, BODY_SPACING, RAYS, BODY_RAYS, NORMALS, MARGIN]
        lights = [light.direction for light in self._tracer.lights]
        surfaces = [walls.lower, walls.upper, walls.top, walls.floor_lower, walls.floor_upper, self._tracer.faces]
        light = [components.reflectance, components.levels, *lights, self._orders]
        return [np.asarray(a, np.float64) for a in (*surfaces, walls.floor, *light, self._kinds, settings)]

    @property
    def layout(self) -> dict[str, int]:
        """Number of values in each table, by the table's name."""
        nodes, count = self._nodes, range(len(self._tracer.basis))
        cells = int(nodes.grid.free.sum())
        sizes = {"floor": cells * nodes.across**2, "walls": cells * len(SIDES) * nodes.across * nodes.up}
        bodies = {f"body_{i}": cells * nodes.places**2 * 4 * FOURS for i in range(len(self._kinds))}
        return {f"bounced_{name}_{k}": size for name, size in (sizes | bodies).items() for k in count}

    def tables(self) -> dict[str, np.ndarray]:
        """Return tables of the reflected light on floor, walls and each kind of body, as flat float32 arrays by name.

        Each component of the light's spectrum has its own tables.

        If the number of reflections is limited, walls and floor reflect light to each other once. If it is not limited
        (`lighting.ALL`), the tables of floor and walls are computed repeatedly, and each repetition adds one
        reflection. The repetitions end when the tables change by at most 0.1 % of their largest value, at the latest
        after 16 reflections.
        """
        found = self._surfaces()
        for _ in range(self._orders - 1):
            self._arriving = self._between(found)
            before, found = found, self._surfaces()
            if all(np.abs(found[name] - before[name]).max() <= CHANGE * found[name].max() for name in found):
                break
        for i, kind in enumerate(self._kinds):
            light = self._on_body(*kind)
            found |= {f"bounced_body_{i}_{k}": light[..., k].ravel() for k in range(light.shape[-1])}
        return {name: np.ascontiguousarray(table) for name, table in found.items()}

    def _between(self, found: dict[str, np.ndarray]) -> Irradiance:
        """Return a function that interpolates the irradiance at any point of floor and walls.

        found: tables of the irradiance at some points of floor and walls, by name
        """
        light, count = NodeLight(self._nodes, len(self._tracer.basis)), range(len(self._tracer.basis))
        floor, walls = ([floats(found[f"bounced_{name}_{k}"]) for k in count] for name in ("floor", "walls"))
        tables = NodeTables(floats(self._nodes.cells), floor, walls)
        return lambda point, normal: light.on_surface(point, normal, tables)

    def _surfaces(self) -> dict[str, np.ndarray]:
        tables = {"floor": self._on_floor(), "walls": self._on_walls()}
        return {
            f"bounced_{name}_{k}": np.ascontiguousarray(column)
            for name, light in tables.items()
            for k, column in enumerate(light.T.astype(np.float32))
        }

    def _on_floor(self) -> np.ndarray:
        """Return the reflected light on the floor, at the points ("nodes") for which the table has entries.

        The nodes are sorted by cell, then by y, then by x. The array has the shape (node, component of the light's
        spectrum).
        """
        places = _within(self._nodes.grid.side, self._nodes.across)
        y, x = (a.ravel() for a in np.meshgrid(places, places, indexing="ij"))
        points = self._nodes.grid.corners[:, None] + np.stack([x, y], axis=-1)
        points = np.dstack([points, np.full(points.shape[:2], self._nodes.floor)]).reshape(-1, 3)
        return self._gathered(points, np.tile([0.0, 0, 1], (len(points), 1)), RAYS)

    def _on_walls(self) -> np.ndarray:
        """Return the reflected light on walls, at the points ("nodes") for which the table has entries.

        The light is 0 on sides of a cell without a wall. The nodes are sorted by cell, then by side of the cell, then
        by z, then by the position along the wall. The array has the shape (node, component of the light's spectrum).
        """
        n, grid = self._nodes.across * self._nodes.up, self._nodes.grid
        light = np.zeros((len(grid.corners), len(SIDES), n, len(self._tracer.basis)))
        free = np.pad(grid.free, 1, constant_values=True)
        row, column = np.nonzero(grid.free)
        places, ups = (
            _within(grid.side, self._nodes.across),
            self._nodes.floor + _within(self._nodes.top - self._nodes.floor, self._nodes.up),
        )
        z, along = (a.ravel() for a in np.meshgrid(ups, places, indexing="ij"))
        for s, side in enumerate(SIDES):
            mine = ~free[row + 1 + side[1], column + 1 + side[0]]
            axis = int(np.argmax(np.abs(side)))
            points = np.empty((mine.sum(), n, 3))
            points[..., axis] = grid.corners[mine, axis, None] + (grid.side if side[axis] > 0 else 0)
            points[..., 1 - axis] = grid.corners[mine, 1 - axis, None] + along
            points[..., 2] = z
            normal = np.array([-side[0], -side[1], 0.0])
            found = self._gathered(points.reshape(-1, 3), np.tile(normal, (mine.sum() * n, 1)), RAYS)
            light[mine, s] = found.reshape(mine.sum(), n, -1)
        return light.reshape(-1, light.shape[-1])

    def _on_body(self, radius: float, height: float) -> np.ndarray:
        """Return spherical harmonics of the light on a body's surface, for many positions of the body.

        The positions form a grid in each free cell of the walls' grid. The result lists them in order of cell, y and
        x. Its shape is (position, 16 harmonics, component).

        radius, height: radius of the body, and height of its centre [m]
        """
        margin = self._nodes.body_margin(radius)
        offsets = np.linspace(margin, self._nodes.grid.side - margin, self._nodes.places)
        y, x = (a.ravel() for a in np.meshgrid(offsets, offsets, indexing="ij"))
        centres = (self._nodes.grid.corners[:, None] + np.stack([x, y], axis=-1)).reshape(-1, 2)
        centres = np.column_stack([centres, np.full(len(centres), height)])
        normals = _evenly(NORMALS)
        points = (centres[:, None] + radius * normals).reshape(-1, 3)
        turned, owners = np.tile(normals, (len(centres), 1)), np.repeat(centres, NORMALS, axis=0)
        light = self._gathered(points, turned, BODY_RAYS, (radius, owners)).reshape(len(centres), NORMALS, -1)
        fit = np.linalg.pinv(np.stack(spherical_harmonics(*normals.T), axis=-1))
        fours = np.zeros((len(centres), 4 * FOURS, light.shape[-1]), np.float32)
        fours[:, : len(fit)] = np.einsum("hn,cnk->chk", fit, light)
        return fours

    def _gathered(
        self, points: np.ndarray, normals: np.ndarray, rays: int, shade: tuple[float, np.ndarray] | None = None
    ) -> np.ndarray:
        """Return the irradiance at points (n, 3) due to light from walls and floor, (n, component).

        normals: normals of the surface at the points, (n, 3)
        rays: number of rays from each point
        shade: radius of a body that casts a shadow [m], and its centre for each point, (n, 3); None: no shadow
        """
        samples = mi.Point2f(*(floats(np.tile(c, max(LANES // rays, 1))) for c in low_discrepancy(rays).T))
        dr.eval(samples)
        step, found = max(LANES // rays, 1), []
        for first in range(0, len(points), step):
            part = slice(first, first + step)
            # The number of lanes is constant, so that one kernel serves all parts.
            point, normal, body = (
                mi.Point3f(*(floats(np.repeat(np.resize(c, step), rays)) for c in a[part].T))
                for a in (points, normals, shade[1] if shade else points)
            )
            ray = lighting.spawn_bounce_ray(point, mi.Normal3f(normal), samples)
            light = self._tracer.returned(ray, body, shade[0] if shade else 0.0, self._arriving)
            means = [dr.block_reduce(dr.ReduceOp.Add, c, rays) for c in light]
            dr.eval(means)
            found.append(np.stack([np.array(m) / rays for m in means], axis=-1)[: len(points[part])])
        return np.concatenate(found) if found else np.zeros((0, len(self._tracer.basis)))


def _within(length: float, nodes: int) -> np.ndarray:
    """Return positions along a length [m], evenly spaced from end to end, (nodes,).

    Only the first and the last position are shifted: they lie 0.02 m inwards from the ends.
    """
    return np.clip(np.linspace(0, length, nodes), MARGIN, length - MARGIN)


def _evenly(n: int) -> np.ndarray:
    """Return n evenly distributed directions (n, 3), which lie on a Fibonacci spiral."""
    i = np.arange(n) + 0.5
    z, azimuth = 1 - 2 * i / n, np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], axis=-1)


def spherical_harmonics(x: Array, y: Array, z: Array) -> list[Array]:
    """Return the spherical harmonics of degree 0 to 3 in the direction (x, y, z), not normalised."""
    xx, yy, zz = x * x, y * y, z * z
    flat = [x * 0 + 1, x, y, z, x * y, y * z, z * x, xx - yy, 3 * zz - 1]
    cubic = [y * (3 * xx - yy), x * y * z, y * (5 * zz - 1), z * (5 * zz - 3), x * (5 * zz - 1), z * (xx - yy)]
    return [*flat, *cubic, x * (xx - 3 * yy)]
