"""Kernels of an eye for a scene with a range of distances and directions, as few kernels as the tolerance allows.

A kernel, the receptive field of a receptor, depends on the position of the light source. Kernels are computed for a few
positions, the nodes, and interpolated linearly between them (see `kernel_interpolation`). The nodes are evenly spaced
over the tangent plane. Along depth, there is either a node at each distance z that occurs in the scene, or nodes are
evenly spaced in 1/z, because defocus is linear in 1/z. The scene is divided into cells, one or more per receptor
along each axis. The signal is then

    signal = Σ_l kernel_l ⊗ (share_l · radiance),   Σ_l share_l = 1 at every cell of the scene,

where l is a node, and share_l is the weight of kernel_l in the interpolation of the kernel for each cell.

`occlusion` extends this sum to near surfaces that hide far ones.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.eye.depth_range import DISTINCT, MOST_NODES, DepthRange
from optics.eye.kernel_interpolation import Choice, NodeChoice, nodes
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import whole
from optics.numerics.autodiff import Array, Scalar, number
from optics.numerics.interpolation import linear_weights

__all__ = ["KernelBank", "prepare"]

# Choice: numbers of nodes to try. The nodes of each number include the nodes of all smaller numbers.
DEPTH_COUNTS, FIELD_COUNTS = (1, 3, 5, 9, 17, 33), (1, 3, 5, 9)


@dataclass(frozen=True)
class KernelBank:
    """The kernels of an eye for light sources at a few positions, the nodes.

    For other positions, the kernels are interpolated. Cells are the equal rectangles into which the scene and the
    retina are divided, one or more per receptor.

    inverse_distances: 1/z [1/m] of the nodes along depth, ascending.
    field: half height and half width of the retina, as numbers of cells.
    kernels: a Dr.Jit tensor (band, ky, kx) for each node (layer, row, column).
    choices: numbers of nodes along depth and over the field, with the reasons for these numbers.
    averaged: True if a receptor's signal is the mean over its cells. It is False with waveguides.
    parallax: factor p [cells m] in the shift p (1/z₁ - 1/z₂) of a near point relative to a far one, between views from
        opposite edges of the pupil. z₁ and z₂ are the distances [m] of the near and the far point. The shift determines
        where near surfaces hide far ones. 0: surfaces are hidden only as seen from the middle of the pupil, as in
        renderers whose rays all pass this point.
    """

    inverse_distances: tuple[float, ...]
    field: tuple[float, float]
    kernels: dict[tuple[int, int, int], Array]
    choices: tuple[Choice, ...]
    averaged: bool = True
    parallax: float = 0.0

    def shares(self, inverse_distance: np.ndarray) -> list[Any]:
        """Return the weights with which the kernels of the bank are interpolated for each cell of a scene.

        The list contains one array (Y, X) of weights for each kernel, in the order of `kernels`. If there is a single
        kernel, its weight is the number 1.

        inverse_distance: 1/z [1/m] of the scene's cells, array (Y, X).
        """
        if len(self.kernels) == 1:
            return [1]
        rows, columns = (1 + max(node[axis] for node in self.kernels) for axis in (1, 2))
        sides = inverse_distance.shape
        down, across = ((np.arange(n) - (n - 1) / 2) / half for n, half in zip(sides, self.field, strict=True))
        by_depth = linear_weights(inverse_distance, np.array(self.inverse_distances))
        by_row, by_column = (linear_weights(at, nodes(n)) for at, n in ((down, rows), (across, columns)))
        return [by_depth[i] * by_row[j][:, None] * by_column[k] for i, j, k in self.kernels]

    def check(self, shape: tuple[int, int], bands: int, *, averaged: bool) -> None:
        """Raise a ValueError unless the kernels were made for a retina with these properties.

        shape: numbers (height, width) of cells, the equal rectangles into which the retina is divided.
        bands: number of spectral bands.
        averaged: True if a receptor's signal is the mean over the cells into which its area is divided.
        """
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


def prepare(
    kernel_at: Callable[[Scalar, float, float], Array],
    resolution: tuple[int, int],
    samples_per_receptor: int,
    z: Any,
    counts: tuple[int | str, int | str],
    tolerance: float,
    *,
    mean: int | None = None,
    white: Callable[[], float] = lambda: 1.0,
) -> KernelBank:
    """Choose the number of kernels and compute them.

    kernel_at: function of (z, right, down) that returns a kernel. Positions in the field run from -1 to 1, the edges of
        the retina.
    resolution: number of receptors (height, width).
    samples_per_receptor: number of cells along a receptor's side.
    z: distances [m] in the scene, a number or an array.
    counts: number of depth layers, and number of zones across the longer side of the retina. "auto": the first of
        DEPTH_COUNTS or FIELD_COUNTS that meets the tolerance, or its part of the tolerance if both are "auto".
        "distinct", for depth layers only: one layer at each distance.
    tolerance: largest error of a receptor's signal, relative to the signal of a white surface.
    mean: number of cells along a side of the area over which a receptor averages light (None: samples_per_receptor).
        Errors are averaged over the same area.
    white: function that returns the signal of a white surface, as a fraction of its signal if kernels lost no light.
        This fraction is less than 1 behind masks and with waveguides.

    Raises:
        ValueError: a number or a distance is invalid, or there are too many distances for "distinct" layers.
        AccuracyError: the tolerance requires more kernels than the limit.
    """
    s, depths = samples_per_receptor, DepthRange.from_distances(z)
    exactly = isinstance(counts[0], str) and counts[0] == DISTINCT
    layers, zones = (
        None if isinstance(count, str) and count in ("auto", *known) else whole(name, count, 1, MOST_NODES)
        for name, count, known in zip(("depth_layers", "field_zones"), counts, ((DISTINCT,), ()), strict=True)
    )
    mean = s if mean is None else mean
    by_depth = [(n,) for n in DEPTH_COUNTS]
    along = NodeChoice("depth", lambda at: kernel_at(depths.distance(at[0]), 0.0, 0.0), by_depth, mean, white)
    by_place = [_grid(n, resolution) for n in FIELD_COUNTS]
    across = NodeChoice("field", lambda at: kernel_at(depths.distance(0), at[1], at[0]), by_place, mean, white)
    if depths.only is not None:
        depth: Choice | None = Choice("depth", (1,), 0.0, "a single distance")
    elif exactly:
        depth = Choice("depth", (len(depths.each()),), 0.0, "one for each distance")
    else:
        depth = None if layers is None else Choice("depth", (layers,), None, "as requested")
    wide = None if zones is None else Choice("field", _grid(zones, resolution), None, "as requested")
    choices = _choices((along, across), (depth, wide), tolerance)
    (deep,), (down, right) = choices[0].counts, (nodes(n) for n in choices[1].counts)
    distances = depths.each() if exactly and depths.only is None else depths.layers(deep)
    places = itertools.product(range(deep), range(len(down)), range(len(right)))
    kernels = {(i, j, k): kernel_at(distances[i], right[k], down[j]) for i, j, k in places}
    half_sides = resolution[0] * s / 2, resolution[1] * s / 2
    inverse = tuple(1 / number(distance) for distance in distances)
    return KernelBank(inverse, half_sides, kernels, choices)


def _choices(
    stages: tuple[NodeChoice, NodeChoice], asked: tuple[Choice | None, Choice | None], tolerance: float
) -> tuple[Choice, Choice]:
    """Return the numbers of nodes along depth and over the field of view.

    If both numbers are "auto", the error of depth may be half of the tolerance, and the error of the field the
    remainder, because the two errors add up. If no number for depth meets half of the tolerance, the field gets half of
    it instead, and depth the remainder.
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
    """Return the tolerance minus the error `spent`, which uses a part of it; None if `spent` is None or 0."""
    return tolerance - spent if spent else None


def _grid(across: int, resolution: tuple[int, int]) -> tuple[int, int]:
    """Return the numbers (rows, columns) of nodes over the field, with similar spacing in both directions.

    Nodes are the positions for which kernels are computed.

    across: number of nodes along the longer side of the retina. If it is one of FIELD_COUNTS, the nodes include those
        of every smaller number in FIELD_COUNTS, so their kernels are reused.
    resolution: number of receptors (height, width).
    """
    height, width = resolution
    finest = max(across - 1, 0)

    def along(receptors: int) -> int:
        halvings = max(0, round(math.log2(max(height, width) / receptors)))
        return 1 if receptors == 1 else 1 + (finest >> halvings)

    return along(height), along(width)
