"""The light that falls on a patch."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas.branches import only_where
from sim.tracing.areas.patch import Patch
from sim.tracing.areas.shadows import WallShadows, lit_past_sphere
from sim.tracing.closed_form_tracer import ClosedForm

REACH = 8  # radii; beyond, a body fills less than 1/64 of the view of what it lights or shades
ITSELF_NONE = -1  # a patch that is on none of the bodies


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
        self._colours = _colours(rays)
        self._shadows = WallShadows(rays.walls, self._directions)
        self.tables = self._shadows.tables

    def irradiance(self, patch: Patch, now: Moment, itself: int = ITSELF_NONE) -> list[Array]:
        """Per component: sum over the lights of level · cos θ · share that is lit; itself: the body that the patch is
        part of."""
        lit = self._shadows.lit(patch, self._directions, now.inputs)
        for k, (centre, radius) in enumerate(zip(now.bodies, self._radii, strict=True)):
            if k != itself:
                past = lit_past_sphere(patch, self._directions, centre, radius)
                lit = [share * other for share, other in zip(lit, past, strict=True)]
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, lit, strict=True):
            arrives = share * dr.maximum(dr.dot(patch.normal, mi.Vector3f(*direction)), 0)
            total = [dr.fma(arrives, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        return total

    def moment(self, bodies: list[Array], inputs: dict[str, Array]) -> Moment:
        """With what light reaches the bodies."""
        lit = []
        for centre, radius in zip(bodies, self._radii, strict=True):
            side = math.sqrt(math.pi) * radius
            disk = Patch(centre, mi.Normal3f(0, 0, 1), mi.Vector3f(side, 0, 0), mi.Vector3f(0, side, 0))
            lit.append(self._shadows.lit(disk, self._directions, inputs))
        return Moment(bodies, inputs, lit)

    def past_bodies(self, patch: Patch, arriving: list[Array], now: Moment, itself: int = ITSELF_NONE) -> list[Array]:
        """What is left of reflected light on its way to a patch, per component, where bodies stand in it, with what
        they reflect themselves; they are taken as far away, and what they hide as average."""
        for k, (centre, radius) in enumerate(zip(now.bodies, self._radii, strict=True)):
            if k != itself:
                way = centre - patch.point
                near = dr.squared_norm(way) < (REACH * radius) ** 2
                change = only_where(near, partial(self._exchanged, patch, arriving, k, now), [0.0] * len(arriving))
                arriving = [a + c for a, c in zip(arriving, change, strict=True)]
        return arriving

    def _exchanged(self, patch: Patch, arriving: list[Array], k: int, now: Moment) -> list[Array]:
        """Light from a body instead of what it hides: sphere's form factor, where it rises over the patch's horizon
        as Snyder (1996) has it."""
        way, radius = now.bodies[k] - patch.point, self._radii[k]
        distance = dr.maximum(dr.norm(way), radius)
        height = dr.dot(patch.normal, way)
        rising = dr.square(dr.maximum(height + radius, 0)) / (4 * radius)
        factor = dr.select(height > radius, height, rising) * radius**2 / (distance * distance * distance)
        sent = self._sent(k, -way / distance, now)
        return [factor * (mine - hidden) for mine, hidden in zip(sent, arriving, strict=True)]

    def _sent(self, k: int, towards: Array, now: Moment) -> list[Array]:
        """Radiosity of a body as seen from far away, per component: Lambert's phase function, with its mean colour."""
        total = [mi.Float(0) for _ in range(self._levels.shape[1])]
        for direction, level, share in zip(self._directions, self._levels, now.lit[k], strict=True):
            cosine = dr.clip(dr.dot(towards, mi.Vector3f(*direction)), -1, 1)
            phase = dr.sqrt(1 - cosine * cosine) + (dr.pi - dr.acos(cosine)) * cosine
            arrives = share * phase * (2 / (3 * np.pi))
            total = [
                dr.fma(arrives, float(factor * colour), sum_)
                for factor, colour, sum_ in zip(level, self._colours[k], total, strict=True)
            ]
        return total


def _colours(rays: ClosedForm) -> list[np.ndarray]:
    """Mean reflectance of each body's texture, (component,), of those that light is reflected from."""
    table = rays.components.reflectance
    return [table[int(first) : int(first + n)].mean(axis=0) for _, (first, n, _) in rays.sphere_textures]
