"""Averages of textures that vary along one axis, from differences of precomputed integrals.

An average over a stretch of the axis takes two lookups of the first integral, as with prefix sums. An average over a
parallelogram takes four lookups of the second integral. Textures are linear between texels, so their integrals are
parabolas and cubics. Only the deviation of a texture from its mean is integrated. Such integrals repeat with the
texture and stay small, which suits float32.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats

# Smallest length of a stretch [texels]. An integral over 100 texels is accurate to 4e-6, and a mean over this smallest
# length to 1e-4.
LEAST = 0.1
# Chosen: largest rounding error of a mean over a parallelogram. It determines the shortest side.
ROUNDING = 1e-3
HALF_ULP = 2.0**-24  # largest relative error of a number that is rounded to float32


@dataclass(frozen=True)
class Texture:
    """The place of a texture in the tables of all textures, which a kernel reads (`StripeTables`).

    first: index of the first texel
    columns: number of columns
    least_side: smallest allowed side [texels] of a parallelogram over which the texture is averaged.
        `Stripes.mean_over` lengthens shorter sides to this length
    """

    first: Array
    columns: Array
    least_side: float = 1.0


@dataclass(frozen=True)
class StripeTables:
    """Tables of all textures, with one array per component of the light (a spectral band, or a fixed spectrum).

    rows: four numbers for each texel: the second and the first integral of the texture's deviation from its mean, at
        the texel's centre, and the deviations of this texel and of the next one
    means: for each texel, the mean of its texture
    """

    rows: list[Array]
    means: list[Array]


class Stripes:
    """Averages of textures along one axis.

    reflectance: reflectance of the texels of all textures for each component of the light, (texel, component)
    places: for each texture, the index of its first texel and its number of columns, (texture, 2)
    tables: the tables as Dr.Jit arrays, which are passed to the kernel (an attribute)
    """

    def __init__(self, reflectance: np.ndarray, places: np.ndarray) -> None:
        self.components = reflectance.shape[1]
        self._least_sides: dict[int, float] = {}
        rows, means = np.zeros((len(reflectance), self.components, 4)), np.zeros_like(reflectance)
        for first, columns in places.astype(int):
            own = reflectance[first : first + columns]
            means[first : first + columns] = own.mean(axis=0)
            here = own - own.mean(axis=0)
            beyond = np.roll(here, -1, axis=0)
            once = _integral_up_to((here + beyond) / 2)
            once -= (once + (2 * here + beyond) / 6).mean(axis=0)  # makes the second integral periodic, too
            twice = _integral_up_to(once + (2 * here + beyond) / 6)
            twice -= (twice.max(axis=0) + twice.min(axis=0)) / 2  # smaller values have smaller errors
            self._least_sides[first] = _least_side(float(np.abs(twice).max()))
            rows[first : first + columns] = np.stack([twice, once, here, beyond], axis=-1)
        count = range(self.components)
        self.tables = StripeTables([floats(rows[:, k]) for k in count], [floats(means[:, k]) for k in count])

    def texture(self, first: float, columns: float) -> Texture:
        """Return the texture with this number of columns and this index of its first texel, for `mean_over`."""
        return Texture(mi.Float(first), mi.Float(columns), self._least_sides[int(first)])

    def mean(self, texture: Texture, ends: list[Array], spread: Array | float, tables: StripeTables) -> list[Array]:
        """Return a texture's mean reflectance over consecutive stretches, each of which has the same weight.

        There is one array for each component of the light (a spectral band, or a fixed spectrum).

        ends: columns at which the stretches begin and end, in order; texel centres are at whole numbers
        spread: number of columns by which each stretch is widened, half of it on either side
        """
        found = self._mean(texture, tables)
        for one, other in pairwise(ends):
            reach = dr.maximum(dr.abs(other - one) + spread, LEAST)
            middle = (one + other) / 2
            upper, lower = (self._once(texture, middle, sign * reach / 2, tables) for sign in (1, -1))
            share = dr.rcp(reach * (len(ends) - 1))
            found = [dr.fma(u - v, share, f) for f, u, v in zip(found, upper, lower, strict=True)]
        return found

    def mean_over(
        self, texture: Texture, middle: Array, sides: tuple[Array, Array], tables: StripeTables
    ) -> list[Array]:
        """Return a texture's mean reflectance over a parallelogram.

        There is one array for each component of the light, a spectral band or a fixed spectrum.

        middle: texture column at the parallelogram's middle
        sides: number of columns that each side spans; the sign has no effect
        """
        one: Array = dr.maximum(dr.abs(sides[0]), texture.least_side)
        other: Array = dr.maximum(dr.abs(sides[1]), texture.least_side)
        outer, inner, scale = (one + other) / 2, (one - other) / 2, dr.rcp(one * other)
        found = self._mean(texture, tables)
        for place, sign in ((outer, 1), (inner, -1), (-inner, -1), (-outer, 1)):
            twice = self._twice(texture, middle, place, tables)
            found = [dr.fma(value, sign * scale, sum_) for value, sum_ in zip(twice, found, strict=True)]
        return found

    def _mean(self, texture: Texture, tables: StripeTables) -> list[Array]:
        return [dr.gather(mi.Float, tables.means[k], mi.UInt32(texture.first)) for k in range(self.components)]

    def _once(self, texture: Texture, middle: Array, beyond: Array, tables: StripeTables) -> list[Array]:
        """Return the integral of the texture's deviation from its mean, at the column `middle + beyond`.

        The deviation is integrated along the texture's axis, separately for each component of the light. The constant
        of integration makes the mean of the integral 0.
        """
        rows, past = self._rows(texture, middle, beyond, tables)
        return [dr.fma(dr.fma((row.w - row.z) / 2, past, row.z), past, row.y) for row in rows]

    def _twice(self, texture: Texture, middle: Array, beyond: Array, tables: StripeTables) -> list[Array]:
        """Return the second integral of the texture's deviation from its mean, at the column `middle + beyond`.

        The second integral is the integral of the first one (`_once`), separately for each component of the light.
        """
        rows, past = self._rows(texture, middle, beyond, tables)
        return [dr.fma(dr.fma(dr.fma((row.w - row.z) / 6, past, row.z / 2), past, row.y), past, row.x) for row in rows]

    def _rows(self, texture: Texture, middle: Array, beyond: Array, tables: StripeTables) -> tuple[list[Array], Array]:
        """Return a texel's row in each of the tables, and the distance [texels] from the texel's centre to a position.

        The position is the column `middle + beyond`. The texel is the last one whose centre is not beyond the position.
        There is one table for each component of the light.

        The number of whole texels in `middle` is split off before `beyond` is added to the remainder, because the sum
        of a large column number and `beyond` would be rounded. A mean is computed from differences of integrals at
        several positions. Rounding would change each position differently, so the errors would not cancel.
        """
        whole = dr.floor(middle)
        past = (middle - whole) + beyond
        steps = dr.floor(past)
        column = whole + steps
        column = dr.clip(column - texture.columns * dr.floor(column / texture.columns), 0, texture.columns - 1)
        index = mi.UInt32(texture.first + column)
        return [dr.gather(mi.Vector4f, tables.rows[k], index) for k in range(self.components)], past - steps


def _least_side(largest: float) -> float:
    """Return the least side [texels] of parallelograms whose mean reflectance has a rounding error of at most 0.001.

    The length is at least one texel, because textures are linear between texels. The mean reflectance over a
    parallelogram is computed from four values of the second integral of the texture's deviation from its mean. Their
    sum is divided by the product of the parallelogram's sides. Each value is rounded twice: when the integral at a
    texel's centre is stored as float32, and when the change from this centre to the position is added.

    largest: largest absolute value of the second integral
    """
    return max(1.0, math.sqrt(8 * HALF_ULP * largest / ROUNDING))


def _integral_up_to(steps: np.ndarray) -> np.ndarray:
    """Return, for each entry, the sum of all entries before it along the first axis."""
    return np.cumsum(steps, axis=0) - steps
