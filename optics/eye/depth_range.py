"""Distances in a scene, and the layers into which they are divided."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.eye.kernel_interpolation import nodes
from optics.numerics.arguments import positive, shown, without_derivative
from optics.numerics.autodiff import Scalar, is_differentiable, number
from optics.numerics.number_types import full_precision, is_boolean

__all__ = ["DISTINCT", "MOST_DISTINCT", "MOST_NODES", "DepthRange", "inverse_distances_in", "layers_for"]

MOST_NODES = 64  # choice: largest number of layers or zones that can be requested
DISTINCT = "distinct"  # value of `depth_layers` for one layer at each distance
MOST_DISTINCT = 17  # choice: largest number of distances that `Eye.see` computes exactly


@dataclass(frozen=True)
class DepthRange:
    """The different distances [m] in a scene, from the farthest to the nearest.

    only: the single distance, which may be a Dr.Jit array; None if there are several.
    """

    distances: tuple[float, ...]
    only: Scalar

    @classmethod
    def from_distances(cls, z: Any) -> DepthRange:
        if is_differentiable(z):
            positive("z", z, infinite=True, carried=True)
            return cls((number(z),), z)
        found = tuple(map(float, np.unique(_distances(z))[::-1]))
        return cls(found, found[0] if len(found) == 1 else None)

    def distance(self, place: float) -> Scalar:
        """Return the distance z [m] at the relative depth `place`, from -1 (farthest) to 1 (nearest).

        1/z is linear in `place`.
        """
        if self.only is not None:
            return self.only
        far, near = 1 / self.distances[0], 1 / self.distances[-1]
        at = (near + far + place * (near - far)) / 2
        return 1 / at if at > 0 else math.inf

    def layers(self, count: int) -> list[Scalar]:
        """Return the distances [m] of this number of layers, from the farthest to the nearest."""
        return [self.distance(place) for place in nodes(count)]

    def each(self) -> list[Scalar]:
        """Return all distances [m], from the farthest to the nearest.

        Raises:
            ValueError: there are more than MOST_NODES distances.
        """
        if len(self.distances) > MOST_NODES:
            many = f"z holds {len(self.distances)} distances"
            raise ValueError(f"depth_layers = {DISTINCT!r} and {many}: must be at most {MOST_NODES}, or use 'auto'")
        return list(self.distances)


def layers_for(z: Any) -> tuple[str, tuple[float, ...]]:
    """Return the `depth_layers` that `Eye.see` uses for a scene, and the distances [m] that determine the kernels.

    `depth_layers` is "distinct" or "auto". With "auto", the distances are the farthest and the nearest.

    z: distances [m] in the scene, a number or an array.
    """
    found = DepthRange.from_distances(z).distances
    return (DISTINCT, found) if 1 < len(found) <= MOST_DISTINCT else ("auto", (found[0], found[-1]))


def inverse_distances_in(shape: tuple[int, int], z: Any) -> np.ndarray:
    """Return 1/z [1/m] of every cell (Y, X) of a scene.

    z: distances [m], a number or (Y, X).

    Raises:
        ValueError: z has the wrong shape, or a distance is invalid.
    """
    if is_differentiable(z):
        positive("z", z, infinite=True, carried=True)
        return np.full(shape, 1 / number(z))
    found = _distances(z)
    if np.ndim(z) and found.shape != shape:
        raise ValueError(f"z has shape {np.shape(z)}: must be one distance or one per cell, {shape}")
    return 1 / np.broadcast_to(found, shape)


def _distances(z: Any) -> np.ndarray:
    z = full_precision("z", without_derivative("z", z))
    try:
        if is_boolean(z):
            raise TypeError
        distances = np.atleast_1d(np.asarray(z, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"z = {shown(z)}: must be a distance [m], or an array of them") from None
    if distances.size == 0 or np.isnan(distances).any():
        raise ValueError("z is empty or holds NaN: must be distances greater than 0, in m, or infinite")
    positive("z", float(distances.min()), infinite=True)
    return distances
