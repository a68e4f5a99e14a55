"""The light that falls on a patch."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas.branches import only_where
from sim.tracing.areas.patch import Patch
from sim.tracing.areas.shadows import WallShadows, lit_past_sphere
from sim.tracing.closed_form_tracer import ClosedForm

REACH = 8  # radii; beyond, a body fills less than 1/64 of the view of what it lights or shades
MIDDLE = 2 / 3  # of the radius: from a body's centre to the middle of the side that is seen, weighted as it is seen
ITSELF_NONE = 2**16  # no body's number: a patch that is on none of them


@dataclass(frozen=True)
class Moment:
    """What changes from call to call. bodies: centres of the spheres that move, the agent's last · inputs: arrays
    lit: which share of each body each light reaches past walls, where light that they reflect is followed."""

    bodies: list[Array]
    inputs: dict[str, Array]
    lit: list[list[Array]] = field(default_factory=list)


class Illumination:
    """Straight from the lights, past walls and bodies.

    tables: float32 arrays for the kernel

    Raises:
        NoClosedForm: what WallShadows does not know.
    """

    def __init__(self, rays: ClosedForm, radii: np.ndarray) -> None:
        self._radii, self._levels = list(map(float, radii)), rays.components.levels
        self._directions = [list(map(float, light.direction)) for light in rays.lights]
        self._colours = [_mean_colour(rays, place) for _, place in rays.sphere_textures]
        self._floor, self._floor_colour = rays.walls.floor, _mean_colour(rays, rays.faces[-1, 8:10])
        self._shadows = WallShadows(rays.walls, self._directions)
        self.tables = self._shadows.tables

    def irradiance(self, patch: Patch, now: Moment, itself: int = ITSELF_NONE) -> list[Array]:
        """Per component: sum over the lights of level · cos θ · share that is lit; itself: the body that the patch is
        part of."""

        def past(k: Array, lit: list[Array]) -> list[Array]:
            left = lit_past_sphere(patch, self._directions, _of(k, now.bodies), _of(k, self._radii))
            return [dr.select(k == itself, share, share * other) for share, other in zip(lit, left, strict=True)]

        lit = self._for_bodies(past, self._shadows.lit(patch, self._directions, now.inputs))
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            arrives = share * dr.maximum(dr.dot(patch.normal, mi.Vector3f(*direction)), 0)
            total = [dr.fma(arrives, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        return total

    def moment(self, bodies: list[Array], inputs: dict[str, Array]) -> Moment:
        """With what light reaches the bodies."""
        lit = []
        for centre, radius in zip(bodies, self._radii, strict=True):
            lit.append(self._shadows.lit(_disk(centre, radius), self._directions, inputs))
        return Moment(bodies, inputs, lit)

    def past_bodies(self, patch: Patch, arriving: list[Array], now: Moment, itself: int = ITSELF_NONE) -> list[Array]:
        """What is left of reflected light on its way to a patch, per component, where bodies stand in it, with what
        they reflect themselves; what they hide is taken as average."""

        def past(k: Array, arriving: list[Array]) -> list[Array]:
            radius = _of(k, self._radii)
            near = dr.squared_norm(_of(k, now.bodies) - patch.point) < dr.square(REACH * radius)
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
        way, radius = _of(k, now.bodies) - patch.point, _of(k, self._radii)
        distance = dr.maximum(dr.norm(way), radius)
        height = dr.dot(patch.normal, way)
        rising = dr.square(dr.maximum(height + radius, 0)) / (4 * radius)
        factor = dr.select(height > radius, height, rising) * dr.square(radius) / (distance * distance * distance)
        sent, lost = self._sent(k, -way / distance, radius / distance, now), self._shadow(k, patch, now)
        exchanged = zip(sent, arriving, lost, strict=True)
        return [factor * (mine - hidden) - dark for mine, hidden, dark in exchanged]

    def _shadow(self, k: Array, patch: Patch, now: Moment) -> list[Array]:
        """What the floor does not send to a patch, per component, where a body's shadows lie: disks' form factors."""
        centre, disk = _of(k, now.bodies), math.pi * dr.square(_of(k, self._radii))
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for i, (direction, level) in enumerate(zip(self._directions, self._levels, strict=True)):
            share = _of(k, [lit[i] for lit in now.lit])
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
        radius, near = _of(k, self._radii), nearness * (1.4 - 0.4 * nearness)
        lit = self._reaching(k, _disk(_of(k, now.bodies) + towards * (MIDDLE * radius), radius / 2), now)
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            cosine = dr.clip(dr.dot(towards, mi.Vector3f(*direction)), -1, 1)
            phase = dr.sqrt(1 - cosine * cosine) + (dr.pi - dr.acos(cosine)) * cosine
            arrives = share * dr.lerp(phase * (2 / (3 * np.pi)), dr.maximum(cosine, 0), near)
            total = [dr.fma(arrives, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        colours = [_of(k, list(map(float, column))) for column in np.transpose(self._colours)]
        return [colour * light for colour, light in zip(colours, total, strict=True)]

    def _reaching(self, k: Array, disk: Patch, now: Moment) -> list[Array]:
        """What share of each light reaches a disk of a body, past walls and the other bodies."""

        def past(other: Array, lit: list[Array]) -> list[Array]:
            left = lit_past_sphere(disk, self._directions, _of(other, now.bodies), _of(other, self._radii))
            return [dr.select(other == k, share, share * more) for share, more in zip(lit, left, strict=True)]

        return self._for_bodies(past, self._shadows.lit(disk, self._directions, now.inputs))


def _of(k: Array, values: list[Any]) -> Array:
    """The k-th."""
    found = values[-1]
    for i, value in reversed(list(enumerate(values[:-1]))):
        found = value if value is found else dr.select(k == i, value, found)
    return found


def _disk(centre: Array, radius: Array) -> Patch:
    """A level square of a disk's area."""
    side = math.sqrt(math.pi) * radius
    return Patch(centre, mi.Normal3f(0, 0, 1), mi.Vector3f(side, 0, 0), mi.Vector3f(0, side, 0))


def _mean_colour(rays: ClosedForm, place: np.ndarray) -> np.ndarray:
    """Mean reflectance of the texture there, (component,), of those that light is reflected from."""
    first, columns = map(int, place[:2])
    return rays.components.reflectance[first : first + columns].mean(axis=0)
