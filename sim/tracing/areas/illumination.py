"""The light that falls on a patch."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing.areas.patch import Patch
from sim.tracing.areas.shadows import WallShadows, lit_past_sphere
from sim.tracing.closed_form_tracer import ClosedForm

ITSELF_NONE = -1  # a patch that is on none of the bodies


@dataclass(frozen=True)
class Moment:
    """What changes from call to call. bodies: centres of the spheres that move, the agent's last · inputs: arrays."""

    bodies: list[Array]
    inputs: dict[str, Array]


class Illumination:
    """Straight from the lights, past walls and bodies.

    tables: float32 arrays for the kernel

    Raises:
        NoClosedForm: what WallShadows does not know.
    """

    def __init__(self, rays: ClosedForm, radii: np.ndarray) -> None:
        self._radii, self._levels = list(map(float, radii)), rays.components.levels
        self._directions = [list(map(float, light.direction)) for light in rays.lights]
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
