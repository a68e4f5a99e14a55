"""Textures along one axis, averaged over any stretch of it: the difference of two integrals that are known beforehand.

Between texels, textures are straight lines, so their integrals are parabolas. Only how a texture departs from its mean
is integrated. Such an integral repeats with the texture, so that stretches of any length take two looks at it, and
stays small, which float32 likes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array

# Texels: shorter stretches are as long. An integral of 100 texels is known to 4e-6, a mean over these to 1e-4.
LEAST = 0.1


@dataclass(frozen=True)
class Texture:
    """Where the kernel finds one: first: of its texels · columns: of them · all per lane, or numbers."""

    first: Array | float
    columns: Array | float


class Stripes:
    """reflectance: (texel, component) · places: first texel and columns of each texture, (texture, 2)

    tables: float32 arrays for the kernel, by name: for every component, in fours, the integral up to each texel's
        centre, how it and the next one depart from the texture's mean, and that mean
    """

    def __init__(self, reflectance: np.ndarray, places: np.ndarray) -> None:
        self.components = reflectance.shape[1]
        rows = np.zeros((len(reflectance), self.components, 4))
        for first, columns in places.astype(int):
            own = reflectance[first : first + columns]
            mean = own.mean(axis=0)
            here = own - mean
            beyond = np.roll(here, -1, axis=0)
            integral = np.cumsum((here + beyond) / 2, axis=0) - (here + beyond) / 2
            rows[first : first + columns] = np.stack([integral, here, beyond, np.broadcast_to(mean, own.shape)], -1)
        self.tables = {f"stripes_{k}": rows[:, k].astype(np.float32).ravel() for k in range(self.components)}

    def mean(self, texture: Texture, ends: list[Array], spread: Array | float, inputs: dict[str, Array]) -> list[Array]:
        """Mean reflectance, per component, over stretches one after the other that count the same.

        ends: of the stretches, texel centres at whole numbers · spread: what is seen beside, half to either side
        """
        means = 4 * mi.UInt32(texture.first) + 3
        found = [dr.gather(mi.Float, inputs[f"stripes_{k}"], means) for k in range(self.components)]
        for one, other in pairwise(ends):
            reach = dr.maximum(dr.abs(other - one) + spread, LEAST)
            middle = (one + other) / 2
            upper, lower = (self._integral(texture, middle + sign * reach / 2, inputs) for sign in (1, -1))
            share = dr.rcp(reach * (len(ends) - 1))
            found = [dr.fma(u - v, share, f) for f, u, v in zip(found, upper, lower, strict=True)]
        return found

    def _integral(self, texture: Texture, x: Array, inputs: dict[str, Array]) -> list[Array]:
        """Of departures from the mean up to x, from the first texel's centre."""
        x = x - texture.columns * dr.floor(x / texture.columns)
        whole = dr.clip(dr.floor(x), 0, texture.columns - 1)
        past, index = x - whole, mi.UInt32(texture.first + whole)
        rows = [dr.gather(mi.Vector4f, inputs[f"stripes_{k}"], index) for k in range(self.components)]
        return [dr.fma(dr.fma((row.z - row.y) / 2, past, row.y), past, row.x) for row in rows]
