"""Textures along one axis, averaged over any stretch of it: the difference of two sums that are known beforehand.

Only how a texture departs from its mean is summed up. Such a sum repeats with the texture, so that stretches of any
length take two looks at it, and stays small, which float32 likes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array

# Texels: shorter stretches are as long. Textures have many texels per stripe, whose borders are no sharper than that.
LEAST = 0.5


@dataclass(frozen=True)
class Texture:
    """Where the kernel finds one: first: of its texels · columns: of them · all per lane, or numbers."""

    first: Array | float
    columns: Array | float


class Stripes:
    """reflectance: (texel, component) · places: first texel and columns of each texture, (texture, 2)

    tables: float32 arrays for the kernel, by name: for every component the sum up to each texel and up to its end, in
        twos, and the mean of the texture that a texel belongs to
    """

    def __init__(self, reflectance: np.ndarray, places: np.ndarray) -> None:
        self.components = reflectance.shape[1]
        sums, means = np.zeros((len(reflectance), self.components, 2)), np.zeros_like(reflectance)
        for first, columns in places.astype(int):
            own = reflectance[first : first + columns]
            up_to = np.concatenate([np.zeros((1, self.components)), np.cumsum(own - own.mean(axis=0), axis=0)])
            sums[first : first + columns] = np.stack([up_to[:-1], up_to[1:]], axis=-1)
            means[first : first + columns] = own.mean(axis=0)
        self.tables = {f"sums_{k}": sums[:, k].astype(np.float32).ravel() for k in range(self.components)}
        self.tables |= {f"means_{k}": means[:, k].astype(np.float32) for k in range(self.components)}

    def mean(self, texture: Texture, ends: list[Array], spread: Array | float, inputs: dict[str, Array]) -> list[Array]:
        """Mean reflectance, per component, over stretches one after the other that count the same.

        ends: of the stretches, texel centres at whole numbers · spread: what is seen beside, half to either side
        """
        found = [dr.gather(mi.Float, inputs[f"means_{k}"], _index(texture.first)) for k in range(self.components)]
        for one, other in pairwise(ends):
            reach = dr.maximum(dr.abs(other - one) + spread, LEAST)
            middle = (one + other) / 2 + 0.5
            upper, lower = (self._sum(texture, middle + sign * reach / 2, inputs) for sign in (1, -1))
            share = dr.rcp(reach * (len(ends) - 1))
            found = [dr.fma(u - v, share, f) for f, u, v in zip(found, upper, lower, strict=True)]
        return found

    def _sum(self, texture: Texture, x: Array, inputs: dict[str, Array]) -> list[Array]:
        """Of departures from the mean up to x, counted from the first texel's beginning."""
        x = x - texture.columns * dr.floor(x / texture.columns)
        whole = dr.clip(dr.floor(x), 0, texture.columns - 1)
        index = _index(texture.first + whole)
        twos = [dr.gather(mi.Vector2f, inputs[f"sums_{k}"], index) for k in range(self.components)]
        return [dr.fma(two.y - two.x, x - whole, two.x) for two in twos]


def _index(texel: Array | float) -> Array:
    return mi.UInt32(texel)
