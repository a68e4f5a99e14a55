"""Light that the world's own walls and floor send on to each other, looked up in tables that are baked beforehand.

Every free cell of the grid has a table of its own for its floor and for each of the walls around it, and one for bodies
in it: how much light arrives on their surface from any side (`sim.tracing.areas.light_baking`).
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
    """bodies: harmonics of the light on bodies of each kind, an array per component"""

    bodies: list[list[Array]]


class LightTable(NodeLight):
    """tracer: of rays through the same world, whose components the tables have
    radii, heights: of the bodies that are seen and of their centres [m]

    tables: for the kernel

    Raises:
        NoClosedForm: no walls, or so many cells that their tables would be too large.
    """

    def __init__(self, tracer: ClosedForm, radii: np.ndarray, heights: np.ndarray) -> None:
        kinds = [(float(r), float(h)) for r, h in zip(radii, heights, strict=True)]
        known = sorted(set(kinds))
        self._kinds = [known.index(kind) for kind in kinds]
        super().__init__(LightNodes.of(tracer.walls), len(tracer.basis))
        self.tables = _tables(light_store.stored(Baking(tracer, self._nodes, known)), self._nodes, len(known))

    def on_body(self, body: int, centre: Array, tables: LightTables) -> list[list[Array]]:
        """Harmonics of what arrives on a body, per component, for `sum_of`."""
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
    """What was baked, on the device."""

    def of(name: str) -> list[Array]:
        count = sum(key.startswith(f"{name}_") for key in baked)
        return [floats(baked[f"{name}_{k}"]) for k in range(count)]

    bodies = [of(f"bounced_body_{kind}") for kind in range(kinds)]
    return LightTables(floats(nodes.cells), of("bounced_floor"), of("bounced_walls"), bodies)


def sum_of(fours: list[Array], normal: Array) -> Array:
    """What harmonics, in fours, say of a direction."""
    values = spherical_harmonics(normal.x, normal.y, normal.z)
    return sum((four[i] * v for four, i, v in _spread(fours, values)), mi.Float(0))


def _spread(fours: list[Array], values: list[Array]) -> Iterator[tuple[Array, int, Array]]:
    for i, value in enumerate(values):
        yield fours[i // 4], i % 4, value
