"""Kernels of an eye for a scene with a range of distances and directions: the fewest within the tolerance.

A kernel depends on the position of the light source. Kernels are computed at nodes, and interpolated linearly between
them (see `kernel_interpolation`). The nodes are evenly spaced over the tangent plane and in inverse distance 1/z,
because defocus is linear in 1/z:

    signal = Σ_l kernel_l ⊗ (share_l · radiance),   Σ_l share_l = 1 at every cell of the scene.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.eye.kernel_interpolation import Choice, NodeChoice, nodes
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import positive, shown, whole, without_derivative
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number, plain
from optics.numerics.interpolation import linear_weights
from optics.numerics.number_types import full_precision

__all__ = ["KernelBank", "distances_of", "prepare"]

MOST_NODES = 64  # choice: largest number of layers or zones that can be requested
# Choice: numbers of nodes to try. The nodes of each number include the nodes of all smaller numbers.
DEPTH_COUNTS, FIELD_COUNTS = (1, 3, 5, 9, 17), (1, 3, 5, 9)


@dataclass(frozen=True)
class KernelBank:
    """The kernels of an eye at all nodes, and the weights with which a cell of the scene uses them.

    inverse_distance: 1/z [1/m] of the (nearest, farthest) distance.
    field: (half height, half width) of the retina in cells.
    kernels: a Dr.Jit tensor (band, ky, kx) for each node (layer, row, column).
    choices: the chosen numbers of nodes, for depth and for the field.
    averaged: True if a receptor's signal is the mean over its cells. It is False with waveguides.
    """

    inverse_distance: tuple[float, float]
    field: tuple[float, float]
    kernels: dict[tuple[int, int, int], Array]
    choices: tuple[Choice, ...]
    averaged: bool = True

    def shares(self, shape: tuple[int, int], z: Any) -> list[Any]:
        """Return the interpolation weight (Y, X) of each node in every cell of a scene, one array per node.

        z: distances [m], a number or (Y, X).

        Raises:
            ValueError: z of another shape, or invalid distances.
        """
        if is_differentiable(z):
            positive("z", z, infinite=True, carried=True)
        else:
            found = _distances(z)
            if np.ndim(z) and found.shape != shape:
                raise ValueError(f"z has shape {np.shape(z)}: must be one distance or one per cell, {shape}")
            z = found
        if len(self.kernels) == 1:
            return [1]
        layers, rows, columns = (1 + max(node[axis] for node in self.kernels) for axis in range(3))
        near, far = self.inverse_distance
        depth = (2 / np.broadcast_to(plain(z), shape) - near - far) / ((near - far) or 1.0)
        down, across = ((np.arange(n) - (n - 1) / 2) / half for n, half in zip(shape, self.field, strict=True))
        by_depth, by_row, by_column = (
            linear_weights(at, nodes(n)) for at, n in ((depth, layers), (down, rows), (across, columns))
        )
        return [by_depth[i] * by_row[j][:, None] * by_column[k] for i, j, k in self.kernels]

    def check(self, shape: tuple[int, int], bands: int, *, averaged: bool) -> None:
        """Raise a ValueError unless the bank fits a retina of `shape` cells, these bands and these receptors."""
        if (shape[0] / 2, shape[1] / 2) != self.field:
            made = " x ".join(f"{2 * half:g}" for half in self.field)
            raise ValueError(f"sight is for a retina of {made} cells: must be for {shape[0]} x {shape[1]}")
        own = next(iter(self.kernels.values())).shape[0]
        if own != bands:
            raise ValueError(f"sight is for {own} bands: must be for {bands}, as the eye has")
        if averaged != self.averaged:
            made, wanted = ("with", "without") if averaged else ("without", "with")
            raise ValueError(f"sight is for an eye {made} waveguides: must be for one {wanted}")

    def __str__(self) -> str:
        return "\n".join(map(str, self.choices))


@dataclass(frozen=True)
class _Range:
    """Inverse distances of the nearest and the farthest object. A single Dr.Jit distance is used unchanged."""

    inverse_distance: tuple[float, float]
    only: Scalar

    @classmethod
    def from_distances(cls, z: Any) -> _Range:
        if is_differentiable(z):
            positive("z", z, infinite=True, carried=True)
            return cls((1 / number(z), 1 / number(z)), z)
        distances = _distances(z)
        near, far = float(distances.min()), float(distances.max())
        return cls((1 / near, 1 / far), near if near == far else None)

    def distance(self, place: float) -> Scalar:
        """Return the distance [m] at a place between -1 (farthest) and 1 (nearest)."""
        if self.only is not None:
            return self.only
        near, far = self.inverse_distance
        at = (near + far + place * (near - far)) / 2
        return 1 / at if at > 0 else math.inf


def distances_of(z: Any) -> tuple[float, float]:
    """Return 1/z [1/m] of the (nearest, farthest) distance, on which alone a bank depends."""
    return _Range.from_distances(z).inverse_distance


def prepare(
    kernel_at: Callable[[Scalar, float, float], Array],
    resolution: tuple[int, int],
    samples_per_receptor: int,
    z: Any,
    counts: tuple[int | str, int | str],
    tolerance: float,
    *,
    averaged: bool = True,
    white: Callable[[], float] = lambda: 1.0,
) -> KernelBank:
    """Choose the number of kernels and compute them.

    kernel_at: function of (z, right, down) that returns a kernel. Positions in the field run from -1 to 1, the edges of
        the retina.
    counts: number of depth layers, and of zones across the longer side of the retina; or "auto".
    averaged: True if a receptor's signal is the mean over its cells.
    white: function that returns the fraction of the signal of a white surface that the kernels transmit.
    """
    s, depths = samples_per_receptor, _Range.from_distances(z)
    layers, zones = (
        None if isinstance(count, str) and count == "auto" else whole(name, count, 1, MOST_NODES)
        for name, count in zip(("depth_layers", "field_zones"), counts, strict=True)
    )
    mean = s if averaged else 1
    by_depth = [(n,) for n in DEPTH_COUNTS]
    along = NodeChoice("depth", lambda at: kernel_at(depths.distance(at[0]), 0.0, 0.0), by_depth, mean, white)
    by_place = [_grid(n, resolution) for n in FIELD_COUNTS]
    across = NodeChoice("field", lambda at: kernel_at(depths.distance(0), at[1], at[0]), by_place, mean, white)
    if depths.only is not None:
        depth: Choice | None = Choice("depth", (1,), 0.0, "a single distance")
    else:
        depth = None if layers is None else Choice("depth", (layers,), None, "as requested")
    wide = None if zones is None else Choice("field", _grid(zones, resolution), None, "as requested")
    choices = _choices((along, across), (depth, wide), tolerance)
    deep, down, right = (nodes(n) for choice in choices for n in choice.counts)
    places = itertools.product(range(len(deep)), range(len(down)), range(len(right)))
    kernels = {(i, j, k): kernel_at(depths.distance(deep[i]), right[k], down[j]) for i, j, k in places}
    return KernelBank(
        depths.inverse_distance, (resolution[0] * s / 2, resolution[1] * s / 2), kernels, choices, averaged
    )


def _choices(
    stages: tuple[NodeChoice, NodeChoice], asked: tuple[Choice | None, Choice | None], tolerance: float
) -> tuple[Choice, Choice]:
    """Return the numbers of nodes for depth and for the field.

    If both are automatic, depth may use half of the tolerance, and the field the remainder, because the two errors add
    up. If depth needs more than half of the tolerance, the number for the field is chosen first.
    """
    along, across = stages
    if asked[0] is not None or asked[1] is not None:
        spent = None if asked[0] is None else asked[0].predicted_error
        return asked[0] or along.choose(tolerance), asked[1] or across.choose(tolerance, _rest(tolerance, spent))
    try:
        depth = along.choose(tolerance, tolerance / 2)
    except AccuracyError:
        wide = across.choose(tolerance, tolerance / 2)
        return along.choose(tolerance, _rest(tolerance, wide.predicted_error)), wide
    return depth, across.choose(tolerance, _rest(tolerance, depth.predicted_error))


def _rest(tolerance: float, spent: float | None) -> float | None:
    """Return the remainder of a tolerance, or None if no part of it was used."""
    return tolerance - spent if spent else None


def _grid(across: int, resolution: tuple[int, int]) -> tuple[int, int]:
    """Return the numbers (rows, columns) of nodes over the field, with similar spacing in both directions.

    The nodes of higher counts include the nodes of lower counts.
    """
    height, width = resolution
    finest = max(across - 1, 0)

    def along(receptors: int) -> int:
        halvings = max(0, round(math.log2(max(height, width) / receptors)))
        return 1 if receptors == 1 else 1 + (finest >> halvings)

    return along(height), along(width)


def _distances(z: Any) -> np.ndarray:
    z = full_precision("z", without_derivative("z", z))
    try:
        distances = np.atleast_1d(np.asarray(z, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"z = {shown(z)}: must be a distance [m], or an array of them") from None
    if distances.size == 0 or np.isnan(distances).any():
        raise ValueError("z is empty or holds NaN: must be distances greater than 0, in m, or infinite")
    positive("z", float(distances.min()), infinite=True)
    return distances
