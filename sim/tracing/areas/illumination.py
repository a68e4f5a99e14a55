"""The light that reaches a patch of a surface.

Walls and bodies block a part of the light, and reflect other light towards the patch.
"""

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
from sim.tracing.areas.illuminated_bodies import IlluminatedBodies, select
from sim.tracing.areas.light_table import LightTables, sum_of
from sim.tracing.areas.patch import Patch
from sim.tracing.areas.shadows import WallShadows, lit_past_sphere
from sim.tracing.areas.stripes import StripeTables
from sim.tracing.closed_form_tracer import ClosedForm
from sim.tracing.wall_intersection import CellTables

REACH = 8  # [radii] more distant bodies are ignored, because they fill less than 1/64 of the view from a patch
ITSELF_NONE = 2**16  # index for a patch that does not lie on a body


@dataclass(frozen=True)
class AreaTables:
    """Tables, shared by all worlds, from which the light in areas of the visual field is computed.

    faces: eight numbers for each wall face, which locate its texture, see `area_tracer`
    face_ends: x and y of the left and right end of each face
    cells: the grid of cells in which walls stand; None: there is no grid, and the few walls are tested one by one
    around: for each cell of the grid, a number that states which of its neighbours are walls; None without walls
    stripes: tables of the surfaces' textures
    reflected: light that walls and floor reflect to each other; None: reflected light is neglected
    """

    faces: Array
    face_ends: Array
    cells: CellTables | None
    around: Array | None
    stripes: StripeTables
    reflected: LightTables | None


@dataclass(frozen=True)
class FrameState:
    """Inputs for one frame, from which the light in areas, rectangles of the visual field, is computed.

    bodies: centres of the moving spheres. If the body that carries the eyes is a sphere, its centre is the last one
    inputs: tables that are the same in all worlds
    world: index of the world to which each area belongs
    body_light: tables of `IlluminatedBodies`, world by world; empty if light that bodies reflect is neglected
    """

    bodies: list[Array]
    inputs: AreaTables
    world: Array
    body_light: list[Array]


class Illumination:
    """Direct and reflected light on patches of surfaces, without the light that walls and bodies block.

    rays: tracer of rays through the world
    radii: radii of the bodies [m], (body,)

    Attribute `around`: for each cell of the walls' grid, a number that states which neighbours of the cell are walls.
    Attribute `bodies`: computation and lookup of the light on bodies.

    Raises:
        NoClosedForm: `WallShadows` has no closed form for the shadows.
    """

    def __init__(self, rays: ClosedForm, radii: np.ndarray) -> None:
        self._radii, self._levels = list(map(float, radii)), rays.components.levels
        self._directions = [list(map(float, light.direction)) for light in rays.lights]
        self._colours = [_mean_colour(rays, place) for _, place in rays.sphere_textures]
        self._floor, self._floor_colour = rays.walls.floor, _mean_colour(rays, rays.faces[-1, 8:10])
        self._shadows = WallShadows(rays.walls, self._directions)
        self.around = self._shadows.around
        self.bodies = IlluminatedBodies(self._shadows, self._directions, self._radii)

    def irradiance(self, patch: Patch, now: FrameState) -> list[Array]:
        """Return the irradiance of a patch by the lights, for each component of the light's spectrum.

        It is the sum over lights of level · cos(angle of incidence) · visibility. The level is the light's strength in
        the component, and the visibility is the fraction of the patch that the light reaches.
        """
        return self.arriving(patch.normal, self.visibility(patch, now))

    def visibility(self, patch: Patch, now: FrameState, itself: int = ITSELF_NONE) -> list[Array]:
        """Return the fraction of a patch that each light reaches.

        itself: index of the body on which the patch lies
        """

        def past(k: Array, lit: list[Array]) -> list[Array]:
            left = lit_past_sphere(patch, self._directions, select(k, now.bodies), select(k, self._radii))
            return [dr.select(k == itself, share, share * other) for share, other in zip(lit, left, strict=True)]

        return self._for_bodies(past, self._shadows.visibility(patch, self._directions, now.inputs.around))

    def arriving(self, normal: Array, lit: list[Array]) -> list[Array]:
        """Return the irradiance of a surface by the lights, for each component of the light's spectrum.

        It is the sum over lights of level · cos(angle of incidence) · fraction, where the level is the light's strength
        in the component.

        lit: fraction of each light that arrives
        """
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            arrives = share * dr.maximum(dr.dot(normal, mi.Vector3f(*direction)), 0)
            total = [dr.fma(arrives, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        return total

    def past_bodies(
        self, patch: Patch, arriving: list[Array], now: FrameState, itself: int = ITSELF_NONE
    ) -> list[Array]:
        """Return the reflected light on a patch, without light that bodies hide, and with light that they reflect.

        There is one array for each component of the light's spectrum.

        arriving: reflected light on the patch as if there were no bodies, for each component
        itself: index of the body on which the patch lies
        """

        def past(k: Array, arriving: list[Array]) -> list[Array]:
            radius = select(k, self._radii)
            near = dr.squared_norm(select(k, now.bodies) - patch.point) < dr.square(REACH * radius)
            exchanged = partial(self._exchanged, patch, arriving, k, now)
            change = only_where(near & (k != itself), exchanged, [0.0] * len(arriving))
            return [a + c for a, c in zip(arriving, change, strict=True)]

        return self._for_bodies(past, arriving)

    def _for_bodies(self, step: Callable[[Array, list[Array]], list[Array]], start: list[Array]) -> list[Array]:
        """Run a step for each body, as a loop in the kernel, because unrolled code would be very long."""
        if len(self._radii) == 1:
            return step(mi.UInt32(0), start)
        _, found = dr.while_loop(
            (mi.UInt32(0), start),
            lambda k, values: k < len(self._radii),
            lambda k, values: (k + 1, step(k, values)),
            label="bodies",
        )
        return found

    def _exchanged(self, patch: Patch, arriving: list[Array], k: Array, now: FrameState) -> list[Array]:
        """Return the light that a body sends to a patch, minus the light that the body hides from the patch.

        Both amounts are computed with the form factor of a sphere. Light that the patch lacks because of the body's
        shadows on the floor is also subtracted, see `_shadow`.

        If the patch's horizon crosses the sphere, Snyder's (1996) form factor applies. The hidden light is the light
        that arrives on the body's far side, as seen from the patch. Its radiance follows from the irradiance of that
        side. The hidden light is at most the light that arrives at the patch (`arriving`, per component).
        """
        way, radius = select(k, now.bodies) - patch.point, select(k, self._radii)
        distance = dr.maximum(dr.norm(way), radius)
        height = dr.dot(patch.normal, way)
        rising = dr.square(dr.maximum(height + radius, 0)) / (4 * radius)
        factor = dr.select(height > radius, height, rising) * dr.square(radius) / (distance * distance * distance)
        sent, lost = self._sent(k, -way / distance, radius / distance, now), self._shadow(k, patch, now)
        far_side = way / distance
        hidden = [
            factor * sum_of(fours, far_side) for fours in self.bodies.reflected_around(k, now.world, now.body_light)
        ]
        exchanged = zip(sent, hidden, arriving, lost, strict=True)
        return [factor * mine - dr.clip(dark, 0, all_) - shadow for mine, dark, all_, shadow in exchanged]

    def _shadow(self, k: Array, patch: Patch, now: FrameState) -> list[Array]:
        """Return the light that a patch of a surface lacks because a body casts shadows on the floor.

        There is one array for each component of the light's spectrum. The light that would come from a shadowed part of
        the floor is computed with the form factor of a disk.
        """
        centre, disk = select(k, now.bodies), math.pi * dr.square(select(k, self._radii))
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        lit = self.bodies.on_whole(k, now.world, now.body_light)
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            way = centre - mi.Vector3f(*direction) * ((centre.z - self._floor) / direction[2]) - patch.point
            area, apart = disk / direction[2], dr.squared_norm(way)
            cosines = dr.maximum(dr.dot(patch.normal, way), 0) * dr.maximum(-way.z, 0)
            factor = share * cosines * area / (apart * dr.fma(math.pi, apart, area))
            taken = level * self._floor_colour * direction[2]
            total = [dr.fma(factor, float(part), sum_) for part, sum_ in zip(taken, total, strict=True)]
        return total

    def _sent(self, k: Array, towards: Array, nearness: Array, now: FrameState) -> list[Array]:
        """Return a body's radiosity as seen from a patch of a surface, for each component of the light's spectrum.

        The radiosity is the body's mean reflectance times the light on its visible side. This light is a weighted mean
        of its values for a distant patch and for a close one. A distant patch sees one half of the body, and the mean
        light on this half follows Lambert's phase function. A close patch sees only the body's nearest point, with the
        irradiance there.

        towards: unit vector from the body to the patch
        nearness: the body's radius divided by its distance. A fitted function of the nearness gives the weight of the
            value for a close patch. The weighted mean deviates from the true light by at most 0.05 of the light.
        """
        near = nearness * (1.4 - 0.4 * nearness)
        lit = self.bodies.on_side(k, towards, now.world, now.body_light)
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            cosine = dr.clip(dr.dot(towards, mi.Vector3f(*direction)), -1, 1)
            phase = dr.sqrt(1 - cosine * cosine) + (dr.pi - dr.acos(cosine)) * cosine
            arrives = share * dr.lerp(phase * (2 / (3 * np.pi)), dr.maximum(cosine, 0), near)
            total = [dr.fma(arrives, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        colours = [select(k, list(map(float, column))) for column in np.transpose(self._colours)]
        return [colour * light for colour, light in zip(colours, total, strict=True)]


def _mean_colour(rays: ClosedForm, place: np.ndarray) -> np.ndarray:
    """Return a texture's mean reflectance for each component of reflected light, (component,).

    The texture has one row of texels.

    place: place of the texture in the atlas, see `Atlas.places`
    """
    first, columns = map(int, place[:2])
    return rays.components.reflectance[first : first + columns].mean(axis=0)
