"""Tables, computed in advance, of the light that the walls and the floor of a world reflect to each other.

Every free cell of the walls' grid has a table for its floor, and one for each of its four sides, where walls may stand.
Another table contains the light that arrives from all sides on the surface of bodies in the cell
(`sim.tracing.areas.light_baking`).
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
from sim.tracing.areas.illuminated_bodies import select
from sim.tracing.areas.light_baking import FOURS, Baking, spherical_harmonics
from sim.tracing.areas.light_nodes import LightNodes, NodeLight, NodeTables, corners
from sim.tracing.closed_form_tracer import ClosedForm


@dataclass(frozen=True)
class LightTables(NodeTables):
    """Reflected light at nodes, which are points of floor and walls, and on moving bodies.

    bodies: spherical harmonics of the light on bodies: their coefficients for each combination of a body's radius and
        the height of its centre, one array for each component of the light (a spectral band or a fixed spectrum)
    """

    bodies: list[Array]


class LightTable(NodeLight):
    """Lookup of reflected light on floor, walls and bodies of one world.

    tracer: tracer of rays through the same world. It divides light into components (spectral bands or fixed spectra),
        and there are separate tables for each component
    radii, heights: radii of the bodies, and heights of their centres [m]
    tables: the tables as Dr.Jit arrays, which are passed to the kernel (an attribute)

    Raises:
        NoClosedForm: the world has no walls, some walls overlap or do not fit a grid, or the tables would be too large.
    """

    def __init__(self, tracer: ClosedForm, radii: np.ndarray, heights: np.ndarray) -> None:
        kinds = [(float(r), float(h)) for r, h in zip(radii, heights, strict=True)]
        known = sorted(set(kinds))
        self._kinds = [mi.UInt32(known.index(kind)) for kind in kinds]
        nodes = LightNodes.from_walls(tracer.walls)
        super().__init__(nodes, len(tracer.basis))
        self.tables = _tables(light_store.stored(Baking(tracer, nodes, known)), nodes, len(known))
        self._margins = [nodes.body_margin(radius) for radius, _ in kinds]
        self._body_nodes = int(nodes.grid.free.sum()) * nodes.places**2

    def on_body(self, body: Array, four: Array, centre: Array, tables: LightTables) -> list[Array]:
        """Return four coefficients (Vector4f) of the spherical harmonics of the light that arrives on a body.

        There is one Vector4f for each component of the light (a spectral band or a fixed spectrum). The harmonics have
        sixteen coefficients, in four groups of four. `sum_of` computes the light that arrives at a point of the body's
        surface from all four groups.

        body: index of the body
        four: index of the group of four coefficients
        centre: centre of the body
        """
        cell, x, y = self._nodes.grid.locate(centre, tables.cells)
        n, margin = self._nodes.places, mi.Float(select(body, self._margins) / self._nodes.grid.side)
        x, y = ((share - margin) / (1 - 2 * margin) for share in (x, y))
        first = select(body, self._kinds) * self._body_nodes
        rows = [((first + i) * FOURS + four, w) for i, w in corners(cell * (n * n), (x, n), (y, n))]
        return [sum((dr.gather(mi.Vector4f, table, i) * w for i, w in rows), mi.Vector4f(0)) for table in tables.bodies]


def _tables(baked: dict[str, np.ndarray], nodes: LightNodes, kinds: int) -> LightTables:
    """Return the baked tables on the device."""

    def of(name: str) -> list[Array]:
        count = sum(key.startswith(f"{name}_") for key in baked)
        return [floats(baked[f"{name}_{k}"]) for k in range(count)]

    floor = of("bounced_floor")
    bodies = [
        floats(np.concatenate([baked[f"bounced_body_{kind}_{k}"] for kind in range(kinds)])) for k in range(len(floor))
    ]
    return LightTables(floats(nodes.cells), floor, of("bounced_walls"), bodies)


def sum_of(fours: list[Array], normal: Array) -> Array:
    """Return the sum of spherical harmonics in the direction `normal`.

    fours: coefficients of the harmonics, in groups of four
    """
    values = spherical_harmonics(normal.x, normal.y, normal.z)
    return sum((four[i] * v for four, i, v in _spread(fours, values)), mi.Float(0))


def _spread(fours: list[Array], values: list[Array]) -> Iterator[tuple[Array, int, Array]]:
    for i, value in enumerate(values):
        yield fours[i // 4], i % 4, value
