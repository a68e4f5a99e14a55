"""Rows of four floats in which a kernel finds what differs from world to world."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import three


@dataclass(frozen=True)
class WorldRows:
    """fours: of all worlds, flat · first: the first row of a lane's world"""

    fours: Array
    first: Array

    def point(self, row: Array | int) -> Array:
        """The first three floats of one of the world's rows."""
        return three(self.fours, self.first + row)

    def four(self, row: Array | int) -> Array:
        """All four (Vector4f)."""
        return dr.gather(mi.Vector4f, self.fours, self.first + row)
