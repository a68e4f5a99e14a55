"""Textures along one axis, averaged over stretches of it and over parallelograms: differences of integrals that are
known beforehand.

A stretch takes two looks at the integral, as prefix sums do; a parallelogram four looks at the integral of that.
Between texels, textures are straight lines, so their integrals are parabolas and cubics. Only how a texture departs
from its mean is integrated. Such integrals repeat with the texture and stay small, which float32 likes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats

# Texels: shorter stretches are as long. An integral of 100 texels is known to 4e-6, a mean over these to 1e-4.
LEAST = 0.1
# Of a texture's columns, at least: sides of parallelograms are as long. Then the second integral, some 10⁻² of the
# columns squared, is known well enough for a mean to 1e-3.
LEAST_SIDE = 1 / 256


@dataclass(frozen=True)
class Texture:
    """Where the kernel finds one: first: of its texels · columns: of them."""

    first: Array
    columns: Array


@dataclass(frozen=True)
class StripeTables:
    """Of all textures, an array per component. rows: in fours, the second and the first integral up to each texel's
    centre and how it and the next one depart from the texture's mean · means: that mean"""

    rows: list[Array]
    means: list[Array]


class Stripes:
    """reflectance: (texel, component) · places: first texel and columns of each texture, (texture, 2)

    tables: for the kernel
    """

    def __init__(self, reflectance: np.ndarray, places: np.ndarray) -> None:
        self.components = reflectance.shape[1]
        rows, means = np.zeros((len(reflectance), self.components, 4)), np.zeros_like(reflectance)
        for first, columns in places.astype(int):
            own = reflectance[first : first + columns]
            means[first : first + columns] = own.mean(axis=0)
            here = own - own.mean(axis=0)
            beyond = np.roll(here, -1, axis=0)
            once = _integral_up_to((here + beyond) / 2)
            once -= (once + (2 * here + beyond) / 6).mean(axis=0)  # whose own integral then repeats, too
            twice = _integral_up_to(once + (2 * here + beyond) / 6)
            rows[first : first + columns] = np.stack([twice, once, here, beyond], axis=-1)
        count = range(self.components)
        self.tables = StripeTables([floats(rows[:, k]) for k in count], [floats(means[:, k]) for k in count])

    def mean(self, texture: Texture, ends: list[Array], spread: Array | float, tables: StripeTables) -> list[Array]:
        """Mean reflectance, per component, over stretches one after the other that count the same.

        ends: of the stretches, texel centres at whole numbers · spread: what is seen beside, half to either side
        """
        found = self._mean(texture, tables)
        for one, other in pairwise(ends):
            reach = dr.maximum(dr.abs(other - one) + spread, LEAST)
            middle = (one + other) / 2
            upper, lower = (self._once(texture, middle + sign * reach / 2, tables) for sign in (1, -1))
            share = dr.rcp(reach * (len(ends) - 1))
            found = [dr.fma(u - v, share, f) for f, u, v in zip(found, upper, lower, strict=True)]
        return found

    def mean_over(
        self, texture: Texture, middle: Array, sides: tuple[Array, Array], tables: StripeTables
    ) -> list[Array]:
        """Mean reflectance, per component, over a parallelogram.

        middle: of it, a column · sides: columns from one end to the other of either side, of any sign
        """
        one, other = (dr.maximum(dr.abs(side), LEAST_SIDE * texture.columns) for side in sides)
        outer, inner, scale = (one + other) / 2, (one - other) / 2, dr.rcp(one * other)
        found = self._mean(texture, tables)
        for place, sign in ((outer, 1), (inner, -1), (-inner, -1), (-outer, 1)):
            twice = self._twice(texture, middle + place, tables)
            found = [dr.fma(value, sign * scale, sum_) for value, sum_ in zip(twice, found, strict=True)]
        return found

    def _mean(self, texture: Texture, tables: StripeTables) -> list[Array]:
        return [dr.gather(mi.Float, tables.means[k], mi.UInt32(texture.first)) for k in range(self.components)]

    def _once(self, texture: Texture, x: Array, tables: StripeTables) -> list[Array]:
        """Integral of the departures from the mean, up to x."""
        rows, past = self._rows(texture, x, tables)
        return [dr.fma(dr.fma((row.w - row.z) / 2, past, row.z), past, row.y) for row in rows]

    def _twice(self, texture: Texture, x: Array, tables: StripeTables) -> list[Array]:
        """Integral of that."""
        rows, past = self._rows(texture, x, tables)
        return [dr.fma(dr.fma(dr.fma((row.w - row.z) / 6, past, row.z / 2), past, row.y), past, row.x) for row in rows]

    def _rows(self, texture: Texture, x: Array, tables: StripeTables) -> tuple[list[Array], Array]:
        """Of the texel below x, per component, and how far x is beyond its centre."""
        x = x - texture.columns * dr.floor(x / texture.columns)
        whole = dr.clip(dr.floor(x), 0, texture.columns - 1)
        index = mi.UInt32(texture.first + whole)
        return [dr.gather(mi.Vector4f, tables.rows[k], index) for k in range(self.components)], x - whole


def _integral_up_to(steps: np.ndarray) -> np.ndarray:
    """Sums of all steps before each one."""
    return np.cumsum(steps, axis=0) - steps
