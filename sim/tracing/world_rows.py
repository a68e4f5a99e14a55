"""Rows of four floats that kernels read, for all values that differ between worlds."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import three


@dataclass(frozen=True)
class WorldRows:
    """Rows of one lane's world.

    fours: rows of all worlds, flat
    first: index of the first row of this world
    """

    fours: Array
    first: Array

    def point(self, row: Array | int) -> Array:
        """Return the first three floats of one of the world's rows."""
        return three(self.fours, self.first + row)

    def four(self, row: Array | int) -> Array:
        """Return all four floats of a row (Vector4f)."""
        return dr.gather(mi.Vector4f, self.fours, self.first + row)
