"""The light that falls on a patch."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas.branches import only_where
from sim.tracing.areas.light_table import LightTables
from sim.tracing.areas.lit_bodies import LitBodies, of
from sim.tracing.areas.patch import Patch
from sim.tracing.areas.shadows import WallShadows, lit_past_sphere
from sim.tracing.areas.stripes import StripeTables
from sim.tracing.closed_form_tracer import ClosedForm
from sim.tracing.wall_intersection import CellTables

REACH = 8  # radii; beyond, a body fills less than 1/64 of the view of what it lights or shades
ITSELF_NONE = 2**16  # no body's number: a patch that is on none of them


@dataclass(frozen=True)
class AreaTables:
    """What kernels that see areas read of any world.

    faces: of walls, in eights, see `area_tracer` · face_ends: see `Columns` · cells: see `Footprints`
    around: see `WallShadows` · stripes: textures · reflected: light that walls and floor send on to each other; None:
        it is not followed
    """

    faces: Array
    face_ends: Array
    cells: CellTables | None
    around: Array | None
    stripes: StripeTables
    reflected: LightTables | None


@dataclass(frozen=True)
class Moment:
    """What changes from call to call. bodies: centres of the spheres that move, the agent's last · inputs: tables
    world: in which an area lies · lit: tables of `LitBodies`, world by world, where light that bodies reflect is
    followed."""

    bodies: list[Array]
    inputs: AreaTables
    world: Array
    lit: list[Array]


class Illumination:
    """Straight from the lights, past walls and bodies.

    around: which cells around each one are walls, for the kernel · bodies: how they are lit

    Raises:
        NoClosedForm: what WallShadows does not know.
    """

    def __init__(self, rays: ClosedForm, radii: np.ndarray) -> None:
        self._radii, self._levels = list(map(float, radii)), rays.components.levels
        self._directions = [list(map(float, light.direction)) for light in rays.lights]
        self._colours = [_mean_colour(rays, place) for _, place in rays.sphere_textures]
        self._floor, self._floor_colour = rays.walls.floor, _mean_colour(rays, rays.faces[-1, 8:10])
        self._shadows = WallShadows(rays.walls, self._directions)
        self.around = self._shadows.around
        self.bodies = LitBodies(self._shadows, self._directions, self._radii)

    def irradiance(self, patch: Patch, now: Moment) -> list[Array]:
        """Per component: sum over the lights of level · cos θ · share that is lit."""
        return self.arriving(patch.normal, self.lit(patch, now))

    def lit(self, patch: Patch, now: Moment, itself: int = ITSELF_NONE) -> list[Array]:
        """Share of a patch that each light reaches; itself: the body that the patch is part of."""

        def past(k: Array, lit: list[Array]) -> list[Array]:
            left = lit_past_sphere(patch, self._directions, of(k, now.bodies), of(k, self._radii))
            return [dr.select(k == itself, share, share * other) for share, other in zip(lit, left, strict=True)]

        return self._for_bodies(past, self._shadows.lit(patch, self._directions, now.inputs.around))

    def arriving(self, normal: Array, lit: list[Array]) -> list[Array]:
        """Per component: sum over the lights of level · cos θ · these shares."""
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            arrives = share * dr.maximum(dr.dot(normal, mi.Vector3f(*direction)), 0)
            total = [dr.fma(arrives, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        return total

    def past_bodies(self, patch: Patch, arriving: list[Array], now: Moment, itself: int = ITSELF_NONE) -> list[Array]:
        """What is left of reflected light on its way to a patch, per component, where bodies stand in it, with what
        they reflect themselves; what they hide is taken as average."""

        def past(k: Array, arriving: list[Array]) -> list[Array]:
            radius = of(k, self._radii)
            near = dr.squared_norm(of(k, now.bodies) - patch.point) < dr.square(REACH * radius)
            exchanged = partial(self._exchanged, patch, arriving, k, now)
            change = only_where(near & (k != itself), exchanged, [0.0] * len(arriving))
            return [a + c for a, c in zip(arriving, change, strict=True)]

        return self._for_bodies(past, arriving)

    def _for_bodies(self, step: Callable[[Array, list[Array]], list[Array]], start: list[Array]) -> list[Array]:
        """What is left after a step for each body: a loop of the kernel, which would be very long otherwise."""
        if len(self._radii) == 1:
            return step(mi.UInt32(0), start)
        _, found = dr.while_loop(
            (mi.UInt32(0), start),
            lambda k, values: k < len(self._radii),
            lambda k, values: (k + 1, step(k, values)),
            label="bodies",
        )
        return found

    def _exchanged(self, patch: Patch, arriving: list[Array], k: Array, now: Moment) -> list[Array]:
        """Light from a body instead of what it hides: sphere's form factor, where it rises over the patch's horizon
        as Snyder (1996) has it."""
        way, radius = of(k, now.bodies) - patch.point, of(k, self._radii)
        distance = dr.maximum(dr.norm(way), radius)
        height = dr.dot(patch.normal, way)
        rising = dr.square(dr.maximum(height + radius, 0)) / (4 * radius)
        factor = dr.select(height > radius, height, rising) * dr.square(radius) / (distance * distance * distance)
        sent, lost = self._sent(k, -way / distance, radius / distance, now), self._shadow(k, patch, now)
        exchanged = zip(sent, arriving, lost, strict=True)
        return [factor * (mine - hidden) - dark for mine, hidden, dark in exchanged]

    def _shadow(self, k: Array, patch: Patch, now: Moment) -> list[Array]:
        """What the floor does not send to a patch, per component, where a body's shadows lie: disks' form factors."""
        centre, disk = of(k, now.bodies), math.pi * dr.square(of(k, self._radii))
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        lit = self.bodies.on_whole(k, now.world, now.lit)
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            way = centre - mi.Vector3f(*direction) * ((centre.z - self._floor) / direction[2]) - patch.point
            area, apart = disk / direction[2], dr.squared_norm(way)
            cosines = dr.maximum(dr.dot(patch.normal, way), 0) * dr.maximum(-way.z, 0)
            factor = share * cosines * area / (apart * dr.fma(math.pi, apart, area))
            taken = level * self._floor_colour * direction[2]
            total = [dr.fma(factor, float(part), sum_) for part, sum_ in zip(taken, total, strict=True)]
        return total

    def _sent(self, k: Array, towards: Array, nearness: Array, now: Moment) -> list[Array]:
        """Radiosity of a body, per component, with its mean colour, in what light reaches the middle of the side that
        is seen: Lambert's phase function from far away, what its nearest point receives from close by.

        nearness: radius / distance; the share between the two is fitted (residual .05 of the light at most)
        """
        near = nearness * (1.4 - 0.4 * nearness)
        lit = self.bodies.on_side(k, towards, now.world, now.lit)
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            cosine = dr.clip(dr.dot(towards, mi.Vector3f(*direction)), -1, 1)
            phase = dr.sqrt(1 - cosine * cosine) + (dr.pi - dr.acos(cosine)) * cosine
            arrives = share * dr.lerp(phase * (2 / (3 * np.pi)), dr.maximum(cosine, 0), near)
            total = [dr.fma(arrives, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        colours = [of(k, list(map(float, column))) for column in np.transpose(self._colours)]
        return [colour * light for colour, light in zip(colours, total, strict=True)]


def _mean_colour(rays: ClosedForm, place: np.ndarray) -> np.ndarray:
    """Mean reflectance of the texture there, (component,), of those that light is reflected from."""
    first, columns = map(int, place[:2])
    return rays.components.reflectance[first : first + columns].mean(axis=0)
