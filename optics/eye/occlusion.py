"""Layers of a scene with a depth map: near surfaces hide far ones, in part where a near edge covers part of the pupil.

Seen from a far point, a near edge hides a part of the pupil. To compute the hidden fraction, the coverage of the near
surface, an image that is 1 on the surface and 0 elsewhere, is blurred by the eye's kernel for its distance. Layers are
numbered from the farthest to the nearest. They are composited over one another:

    image = Σ_l T_l · (kernel_l ⊗ radiance_l),   T_(l-1) = T_l (1 - kernel_l ⊗ coverage_l),

where T_l is the fraction of light that passes all layers nearer than the layer l. Different layers are blurred
independently, so the formula is exact if the far surface is locally uniform, or if either surface is in focus.

A depth map contains no radiance behind a near surface. Each hidden cell of a far surface is therefore given the
radiance and distance of the nearest visible cell of this surface. Cells are the equal rectangles into which the scene
is divided. If the depth of a surface changes gradually, no part of the surface hides another part. Only jumps of depth
hide light.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

__all__ = ["Layer", "visible_layers"]

# Choice: a jump of depth hides light if the far surface shifts behind its edge by at least this number of cells, seen
# from all over the pupil. All surfaces within a layer differ by less.
LEAST_SHIFT = 0.5
MOST_LAYERS = 64  # choice, limited by time: largest number of layers


@dataclass(frozen=True)
class Layer:
    """Cells of a scene in one range of distances.

    Cells are the equal rectangles into which the scene is divided.

    source: (Y, X) int, for each cell the flat index of the cell whose radiance and distance are used: the cell itself
        or, behind a near surface, a visible cell of the far surface.
    cells: (Y, X) bool, the cells of the layer, including cells behind nearer layers.
    hiding: (Y, X) bool, those cells that hide farther layers.
    """

    source: np.ndarray
    cells: np.ndarray
    hiding: np.ndarray


def visible_layers(inverse_distance: np.ndarray, parallax: float) -> Iterator[Layer]:
    """Yield the layers of a depth map from the nearest to the farthest.

    The scene is divided into equal rectangles, called cells.

    inverse_distance: inverse 1/z [1/m] of the distance of each cell, array (Y, X).
    parallax: factor p [cells m] in the shift p (1/z₁ - 1/z₂) of a near point relative to a far one, between views from
        opposite edges of the pupil. z₁ and z₂ are the distances [m] of the near and the far point. With 0, no surface
        hides another one.
    """
    from scipy.ndimage import distance_transform_edt

    least = _least_jump(inverse_distance, parallax)
    level = ((inverse_distance - inverse_distance.min()) / least).astype(int)  # 0 is the farthest layer
    itself = np.arange(level.size).reshape(level.shape)
    source = itself
    remaining = np.ones(level.shape, bool)
    for number in np.unique(level)[::-1]:
        near = inverse_distance.ravel()[source]
        cells = remaining & (level.ravel()[source] == number)
        behind = remaining & ~cells
        # Cells that continue a surface behind another one have an edge only where the visible surface has one.
        visible = source == itself
        edge = behind & visible & (_highest_neighbour(near, cells & visible) - near >= least)
        edge = edge.ravel()[source] & behind & (_highest_neighbour(near, cells) - near >= least)
        if not edge.any():
            yield Layer(source, cells, np.zeros_like(cells))
            remaining = behind
            continue
        places = distance_transform_edt(~behind, return_distances=False, return_indices=True)
        nearest = np.ravel_multi_index(tuple(places), level.shape)  # nearest of the cells behind
        hiding = cells & edge.ravel()[nearest]
        yield Layer(source, cells, hiding)
        source = np.where(hiding, source.ravel()[nearest], source)
        remaining = behind | hiding


def _least_jump(inverse_distance: np.ndarray, parallax: float) -> float:
    """Return the smallest difference of 1/z [1/m] between two surfaces of which one hides the other."""
    if parallax == 0:
        return math.inf
    return max(LEAST_SHIFT / parallax, float(np.ptp(inverse_distance)) / MOST_LAYERS)


def _highest_neighbour(values: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return, for each cell, the highest value of the selected cells in a square of 3 x 3 cells around it.

    The square contains the cell itself and its eight neighbours. Cells that are not selected are ignored. The result,
    an array (Y, X), is -inf where none of these nine cells is selected.

    values: value of each cell, array (Y, X).
    cells: True for selected cells, array (Y, X).
    """
    from scipy.ndimage import maximum_filter

    selected = np.where(cells, values, -math.inf)
    return np.asarray(maximum_filter(selected, size=3, mode="nearest"))
