"""Values that differ between worlds, such as positions and colours, stored in rows of four floats for kernels."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import three


@dataclass(frozen=True)
class WorldRows:
    """Values that differ between worlds, such as positions and colours of geoms, in rows of four floats.

    A kernel traces rays of many worlds at once. Each ray belongs to one world and reads the rows of this world.

    fours: the rows of all worlds, one after another, in a flat array of floats
    first: index of the first row of the ray's world
    """

    fours: Array
    first: Array

    def point(self, row: Array | int) -> Array:
        """Return the first three floats of a row (Vector3f), such as a position."""
        return three(self.fours, self.first + row)

    def four(self, row: Array | int) -> Array:
        """Return all four floats of a row (Vector4f)."""
        return dr.gather(mi.Vector4f, self.fours, self.first + row)
