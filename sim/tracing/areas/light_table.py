"""Light that the walls and the floor of a world reflect to each other, looked up in tables that are baked beforehand.

Every free cell of the grid has its own table for its floor and for each of the walls around it. Another table contains
the light that arrives from all sides on the surface of bodies in the cell (`sim.tracing.areas.light_baking`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats
from sim.tracing.areas import light_store
from sim.tracing.areas.light_baking import FOURS, Baking, spherical_harmonics
from sim.tracing.areas.light_nodes import LightNodes, NodeLight, NodeTables, corners
from sim.tracing.closed_form_tracer import ClosedForm


@dataclass(frozen=True)
class LightTables(NodeTables):
    """Reflected light at the nodes and on bodies. bodies: harmonics of the light on each kind of body, one array per
    component."""

    bodies: list[list[Array]]


class LightTable(NodeLight):
    """Lookup of reflected light on floor, walls and bodies of one world.

    tracer: tracer of rays through the same world, whose components of light the tables have
    radii, heights: radii of the visible bodies, and heights of their centres [m]

    tables: for the kernel

    Raises:
        NoClosedForm: no walls, or too many cells for the tables.
    """

    def __init__(self, tracer: ClosedForm, radii: np.ndarray, heights: np.ndarray) -> None:
        kinds = [(float(r), float(h)) for r, h in zip(radii, heights, strict=True)]
        known = sorted(set(kinds))
        self._kinds = [known.index(kind) for kind in kinds]
        super().__init__(LightNodes.from_walls(tracer.walls), len(tracer.basis))
        self.tables = _tables(light_store.stored(Baking(tracer, self._nodes, known)), self._nodes, len(known))

    def on_body(self, body: int, centre: Array, tables: LightTables) -> list[list[Array]]:
        """Return harmonics of the light that arrives on a body, per component, for `sum_of`."""
        cell, x, y = self._nodes.grid.locate(centre, tables.cells)
        n, found = self._nodes.places, []
        for table in tables.bodies[self._kinds[body]]:
            rows = list(corners(cell * (n * n), (x, n), (y, n)))
            found.append(
                [
                    sum((dr.gather(mi.Vector4f, table, i * FOURS + four) * w for i, w in rows), mi.Vector4f(0))
                    for four in range(FOURS)
                ]
            )
        return found


def _tables(baked: dict[str, np.ndarray], nodes: LightNodes, kinds: int) -> LightTables:
    """Return the baked tables on the device."""

    def of(name: str) -> list[Array]:
        count = sum(key.startswith(f"{name}_") for key in baked)
        return [floats(baked[f"{name}_{k}"]) for k in range(count)]

    bodies = [of(f"bounced_body_{kind}") for kind in range(kinds)]
    return LightTables(floats(nodes.cells), of("bounced_floor"), of("bounced_walls"), bodies)


def sum_of(fours: list[Array], normal: Array) -> Array:
    """Return the value of a sum of spherical harmonics, whose coefficients are given in fours, in the direction
    `normal`."""
    values = spherical_harmonics(normal.x, normal.y, normal.z)
    return sum((four[i] * v for four, i, v in _spread(fours, values)), mi.Float(0))


def _spread(fours: list[Array], values: list[Array]) -> Iterator[tuple[Array, int, Array]]:
    for i, value in enumerate(values):
        yield fours[i // 4], i % 4, value
