"""Light that the world's own walls and floor send on to each other, looked up in tables that are baked beforehand.

Every free cell of the grid has a table of its own for its floor and for each of the walls around it, and one for bodies
in it: how much light arrives on their surface from any side (`sim.tracing.areas.light_baking`).
"""

from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas import light_store
from sim.tracing.areas.light_baking import FOURS, MARGIN, SIDES, Baking, LightNodes, spherical_harmonics
from sim.tracing.areas.patch import Patch
from sim.tracing.closed_form_tracer import ClosedForm


class LightTable:
    """tracer: of rays through the same world, whose components the tables have
    radii, heights: of the bodies that are seen and of their centres [m]

    tables: float32 arrays for the kernel

    Raises:
        NoClosedForm: no walls, or so many cells that their tables would be too large.
    """

    def __init__(self, tracer: ClosedForm, radii: np.ndarray, heights: np.ndarray) -> None:
        kinds = [(float(r), float(h)) for r, h in zip(radii, heights, strict=True)]
        known = sorted(set(kinds))
        self._kinds = [known.index(kind) for kind in kinds]
        self._components = len(tracer.basis)
        self._nodes = LightNodes.of(tracer.walls)
        self.tables = light_store.stored(Baking(tracer, self._nodes, known))
        self.tables["cells"] = self._nodes.grid.numbers.astype(np.float32).ravel()

    def on_floor(self, patch: Patch, inputs: dict[str, Array]) -> list[Array]:
        """Irradiance of what is reflected onto a patch of the floor, per component."""
        cell, x, y = self._nodes.grid.locate(patch.point, inputs["cells"])
        n = self._nodes.across
        return self._interpolate("bounced_floor", cell * (n * n), (x, n), (y, n), inputs)

    def on_wall(self, patch: Patch, inputs: dict[str, Array]) -> list[Array]:
        """The same of a wall."""
        normal = patch.normal
        cell, x, y = self._nodes.grid.locate(patch.point + normal * MARGIN, inputs["cells"])
        along_y = dr.abs(normal.x) > 0.5
        side = dr.select(along_y, dr.select(normal.x > 0, 0.0, 1.0), dr.select(normal.y > 0, 2.0, 3.0))
        z = (patch.point.z - self._nodes.floor) * (1 / (self._nodes.top - self._nodes.floor))
        first = (cell * len(SIDES) + side) * (self._nodes.across * self._nodes.up)
        across = dr.select(along_y, y, x)
        return self._interpolate("bounced_walls", first, (across, self._nodes.across), (z, self._nodes.up), inputs)

    def on_body(self, body: int, centre: Array, inputs: dict[str, Array]) -> list[list[Array]]:
        """Harmonics of what arrives on a body, per component, for `sum_of`."""
        cell, x, y = self._nodes.grid.locate(centre, inputs["cells"])
        n, found = self._nodes.places, []
        for k in range(self._components):
            rows = list(_corners(cell * (n * n), (x, n), (y, n)))
            table = inputs[f"bounced_body_{self._kinds[body]}_{k}"]
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
            for k in range(self._components)
        ]


def sum_of(fours: list[Array], normal: Array) -> Array:
    """What harmonics, in fours, say of a direction."""
    values = spherical_harmonics(normal.x, normal.y, normal.z)
    return sum((four[i] * v for four, i, v in _spread(fours, values)), mi.Float(0))


def _spread(fours: list[Array], values: list[Array]) -> Iterator[tuple[Array, int, Array]]:
    for i, value in enumerate(values):
        yield fours[i // 4], i % 4, value


def _corners(first: Array, *axes: tuple[Array, int]) -> Iterator[tuple[Array, Array]]:
    """Index and weight of the four nodes around a place (x, y) in [0, 1], of so many nodes along each axis."""
    (x, nx), (y, ny) = axes
    x, y = dr.clip(x, 0, 1) * (nx - 1), dr.clip(y, 0, 1) * (ny - 1)
    i, j = dr.minimum(dr.floor(x), nx - 2), dr.minimum(dr.floor(y), ny - 2)
    for b, wy in ((0, 1 - (y - j)), (1, y - j)):
        for a, wx in ((0, 1 - (x - i)), (1, x - i)):
            yield mi.UInt32(first + (j + b) * nx + i + a), wx * wy
