"""Depth layers: distances for which an eye has a PSF, because blur depends on distance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr

from optics.numerics.autodiff import Array


@dataclass(frozen=True)
class DepthLayers:
    """Distances z for which an eye has a PSF. They are evenly spaced in 1/z, because defocus is linear in 1/z.

    Light from a distance between two layers is divided between the two, linearly in 1/z. Light from beyond the farthest
    layer is attributed to the farthest layer, and light from in front of the nearest layer to the nearest one.

    farthest, nearest: distances [m]; farthest may be infinite
    count: number of layers; the inverse distance of a single layer is the mean of 1/farthest and 1/nearest

    Raises:
        ValueError: `nearest` is not positive, or is larger than `farthest`; `count` is less than 1; or there are
            several layers although `nearest` equals `farthest`.
    """

    farthest: float = math.inf
    nearest: float = math.inf
    count: int = 1

    def __post_init__(self) -> None:
        if not 0 < self.nearest <= self.farthest:
            raise ValueError(
                f"depth: nearest = {self.nearest!r}: must be positive and at most farthest {self.farthest!r}"
            )
        if self.count < 1 or (self.count > 1 and self.nearest == self.farthest):
            raise ValueError(
                f"depth: {self.count} layers from {self.nearest!r} to {self.farthest!r} m: must be 1, or more if the "
                "distances differ"
            )

    @property
    def distances(self) -> tuple[float, ...]:
        """Distances of the layers [m], farthest first, (layer,)."""
        far, near = 1 / self.farthest, 1 / self.nearest
        places = [i / (self.count - 1) for i in range(self.count)] if self.count > 1 else [0.5]
        return tuple(1 / v if (v := far + place * (near - far)) > 0 else math.inf for place in places)

    def shares(self, inverse_distance: Array) -> list[Array]:
        """Return the fraction of the light that each layer receives: one Dr.Jit array per layer. The sum is 1.

        A single layer receives all light; its fraction is the number 1.

        inverse_distance: 1/z of the point from which the light comes [1/m]
        """
        if self.count == 1:
            return [1.0]
        far, near = 1 / self.farthest, 1 / self.nearest
        place = dr.clip((inverse_distance - far) * ((self.count - 1) / (near - far)), 0, self.count - 1)
        return [dr.maximum(1 - dr.abs(place - float(layer)), 0) for layer in range(self.count)]

    def __str__(self) -> str:
        if self.count == 1:
            return f"one PSF at {self.distances[0]:.3g} m"
        return f"{self.count} layers, {self.farthest:.3g} to {self.nearest:.3g} m"


ONE_PSF = DepthLayers()
