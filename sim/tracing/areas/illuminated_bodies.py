"""Light on the moving bodies: the fraction of each light that reaches them, and the reflected light around them.

The light does not depend on the eye. It is therefore computed once per world and stored in a table, which serves all
areas of the eyes' visual fields.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.tracing.areas.light_baking import FOURS
from sim.tracing.areas.light_nodes import corners
from sim.tracing.areas.patch import Patch
from sim.tracing.areas.shadows import WallShadows, lit_past_sphere

MIDDLE = 2 / 3  # distance from a body's centre to the middle of its visible side, weighted by projected area [radii]
# Number of places on a body along x and along y. The outer ones are at the middles of the body's sides. Interpolation
# between places has an error of 0.05.
SIDES = 3
WHOLE = SIDES * SIDES  # index of the place that represents the whole body
PLACES = WHOLE + 1

Reflected = Callable[[Array, Array, Array], list[Array]]


class IlluminatedBodies:
    """Computation and lookup of a table of the light on the moving bodies of all worlds.

    Each row of the table describes one of ten places on a body. For each light, the row contains the fraction of the
    light that reaches this place. A row stores these fractions in groups of four ("fours").

    The table also contains sixteen spherical harmonics of the reflected light around each body, for each component of
    the light's spectrum. Each of the first four rows of a body stores four of these harmonics.

    shadows: shadows of walls
    directions: directions towards the lights
    radii: radii of the bodies [m]
    """

    def __init__(self, shadows: WallShadows, directions: list[list[float]], radii: list[float]) -> None:
        self._shadows, self._directions, self._radii = shadows, directions, radii
        self._fours = -(-len(directions) // 4)  # groups of four fractions in a row

    @property
    def nodes_per_body_set(self) -> int:
        """Number of rows that one world has in the table of the light on bodies.

        Each body has ten rows: one for each of nine places on its sides, and one for the body as a whole.
        """
        return PLACES * len(self._radii)

    def table(self, place: Array, bodies: list[Array], walls_around: Array | None, reflected: Reflected) -> list[Array]:
        """Return rows of the table of light on bodies. A row contains the light at one place on a body.

        A row starts with one number per light: the fraction of this light that reaches the place. The numbers are
        stored in groups of four. After them, the row contains four spherical harmonics of the reflected light around
        the body, for each component of the light's spectrum.

        A body has nine places on its sides, in a grid of three by three, and a tenth place that stands for the whole
        body. Walls block the light at all ten places. Other bodies block it only at the nine places on the sides.

        place: index of the row among the rows of one world: 10 · (index of the body) + (index of the place on it)
        bodies: centres of the world's bodies
        walls_around: for each cell of the walls' grid, which of its neighbours are walls (`WallShadows.around`)
        reflected: function that returns one group of four harmonics; its arguments are the index of the body, the index
            of the group, and the body's centre
        """
        k, side = place // PLACES, place % PLACES
        radius, whole = select(k, self._radii), side == WHOLE
        x, y = (mi.Float(i) * (2 / (SIDES - 1)) - 1 for i in (side % SIDES, side // SIDES))
        offset = dr.select(whole, 0, MIDDLE * radius) * mi.Vector2f(x, y)
        centre = select(k, bodies) + mi.Vector3f(offset.x, offset.y, 0)
        disk = _disk(centre, dr.select(whole, radius, radius / 2))
        lit = self._shadows.visibility(disk, self._directions, walls_around)
        for other, (body, its_radius) in enumerate(zip(bodies, self._radii, strict=True)):
            past = lit_past_sphere(disk, self._directions, body, mi.Float(its_radius))
            free = whole | (k == other)
            lit = [share * dr.select(free, 1, more) for share, more in zip(lit, past, strict=True)]
        nothing = [mi.Float(0)] * (-len(lit) % 4)
        lights = [*lit, *nothing]
        shares = [mi.Vector4f(*lights[i : i + 4]) for i in range(0, len(lights), 4)]
        harmonics = reflected(k, dr.minimum(side, FOURS - 1), select(k, bodies))
        return [dr.ravel(four) for four in (*shares, *harmonics)]

    def reflected_around(self, k: Array, world: Array, table: list[Array]) -> list[list[Array]]:
        """Return the harmonics of the reflected light around the k-th body of a world.

        There is one list for each component of the light's spectrum, with the harmonics in groups of four.
        """
        first = (world * len(self._radii) + k) * PLACES
        return [[dr.gather(mi.Vector4f, rows, first + i) for i in range(FOURS)] for rows in table[self._fours :]]

    def on_whole(self, k: Array, world: Array, table: list[Array]) -> list[Array]:
        """Return the fraction of each light that reaches the k-th body of a world."""
        return self._row((world * len(self._radii) + k) * PLACES + WHOLE, table)

    def on_side(self, k: Array, towards: Array, world: Array, table: list[Array]) -> list[Array]:
        """Return the fraction of each light that reaches one side of the k-th body of a world.

        towards: unit vector from the body's centre to the middle of this side
        """
        # In whole numbers, because with many worlds, float32 is not accurate enough.
        first = (world * len(self._radii) + k) * PLACES
        found = [mi.Float(0) for _ in self._directions]
        for side, weight in corners(mi.Float(0), ((towards.x + 1) / 2, SIDES), ((towards.y + 1) / 2, SIDES)):
            shares = self._row(first + side, table)
            found = [dr.fma(weight, share, sum_) for share, sum_ in zip(shares, found, strict=True)]
        return found

    def _row(self, row: Array, table: list[Array]) -> list[Array]:
        fours = [dr.gather(mi.Vector4f, shares, row) for shares in table[: self._fours]]
        return [fours[i // 4][i % 4] for i in range(len(self._directions))]


def select(k: Array, values: list[Array] | list[float]) -> Array:
    """Return the k-th value, where k may differ between lanes."""
    found = values[-1]
    for i, value in reversed(list(enumerate(values[:-1]))):
        found = value if value is found else dr.select(k == i, value, found)
    return found


def _disk(centre: Array, radius: Array) -> Patch:
    """Return a horizontal square with the area of a disk."""
    side = math.sqrt(math.pi) * radius
    return Patch(centre, mi.Normal3f(0, 0, 1), mi.Vector3f(side, 0, 0), mi.Vector3f(0, side, 0))
