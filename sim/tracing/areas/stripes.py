"""Averages of textures along one axis, over stretches and parallelograms, from differences of precomputed integrals.

A stretch takes two lookups of the first integral, as with prefix sums. A parallelogram takes four lookups of the second
integral. Textures are linear between texels, so their integrals are parabolas and cubics. Only the deviation of a
texture from its mean is integrated. Such integrals repeat with the texture and stay small, which suits float32.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats

# Smallest length of a stretch [texels]. An integral of 100 texels is accurate to 4e-6, a mean over this length to 1e-4.
LEAST = 0.1
# Smallest side of a parallelogram, as a share of the texture's columns. The second integral is about 10⁻² of the
# columns squared. With this side, it is accurate enough for a mean with an error of 1e-3.
LEAST_SIDE = 1 / 256


@dataclass(frozen=True)
class Texture:
    """The place of a texture in the kernel's tables. first: its first texel · columns: number of its columns."""

    first: Array
    columns: Array


@dataclass(frozen=True)
class StripeTables:
    """Tables of all textures, one array per component.

    rows: in fours, the second and the first integral up to each texel's centre, and the deviations of this texel and of
        the next one from the texture's mean
    means: the textures' means, for each texel
    """

    rows: list[Array]
    means: list[Array]


class Stripes:
    """Averages of textures along one axis.

    reflectance: (texel, component) · places: first texel and number of columns of each texture, (texture, 2)

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
            once -= (once + (2 * here + beyond) / 6).mean(axis=0)  # so that the second integral repeats, too
            twice = _integral_up_to(once + (2 * here + beyond) / 6)
            rows[first : first + columns] = np.stack([twice, once, here, beyond], axis=-1)
        count = range(self.components)
        self.tables = StripeTables([floats(rows[:, k]) for k in count], [floats(means[:, k]) for k in count])

    def mean(self, texture: Texture, ends: list[Array], spread: Array | float, tables: StripeTables) -> list[Array]:
        """Return the mean reflectance, per component, over consecutive stretches of equal weight.

        ends: ends of the stretches, texel centres at whole numbers · spread: additional width, half of it on either
            side
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
        """Return the mean reflectance, per component, over a parallelogram.

        middle: column of its middle · sides: number of columns that each side spans, of any sign
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
        """Return the integral of the deviation from the mean, up to x."""
        rows, past = self._rows(texture, x, tables)
        return [dr.fma(dr.fma((row.w - row.z) / 2, past, row.z), past, row.y) for row in rows]

    def _twice(self, texture: Texture, x: Array, tables: StripeTables) -> list[Array]:
        """Return the second integral of the deviation from the mean, up to x."""
        rows, past = self._rows(texture, x, tables)
        return [dr.fma(dr.fma(dr.fma((row.w - row.z) / 6, past, row.z / 2), past, row.y), past, row.x) for row in rows]

    def _rows(self, texture: Texture, x: Array, tables: StripeTables) -> tuple[list[Array], Array]:
        """Return the rows of the texel below x, per component, and the distance of x from the texel's centre."""
        x = x - texture.columns * dr.floor(x / texture.columns)
        whole = dr.clip(dr.floor(x), 0, texture.columns - 1)
        index = mi.UInt32(texture.first + whole)
        return [dr.gather(mi.Vector4f, tables.rows[k], index) for k in range(self.components)], x - whole


def _integral_up_to(steps: np.ndarray) -> np.ndarray:
    """Return the sum of all steps before each step."""
    return np.cumsum(steps, axis=0) - steps
