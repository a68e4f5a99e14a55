"""Rectangles of an eye's visual field, and the fraction of each receptive field in each rectangle.

A receptor's signal is a sum over rectangles. Each term is the mean light in a rectangle times the fraction of the
receptive field in that rectangle. The sum is exact if the light is constant within each rectangle. If receptive fields
are hardly wider than receptors, as behind a lens in focus, one rectangle per receptor is enough, because each field
then almost coincides with its rectangle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.eyes.receptive_fields import ReceptiveFields

# Chosen: the largest fraction of all receptors' light that may come from beyond one side of the lattice. This light is
# attributed to the rectangles inside the lattice. Consider a lens in focus that is a quarter as wide as the retina.
# Without a rim, the fraction is 0.012 for 1 x 4 receptors and 0.004 for 15 x 15, so their lattices have no rim. A rim
# would change their errors by less than a tenth.
BEYOND = 0.015


@dataclass(frozen=True)
class FieldAreas:
    """A lattice of rectangles of the visual field, numbered row by row.

    edges: two arrays of coordinates relative to the eye's axis. The first contains the edges of the rows, from top to
        bottom, in units of a receptor's height, (rows + 1,). The second contains the edges of the columns, from left to
        right, in units of a receptor's width, (columns + 1,).
    """

    edges: tuple[np.ndarray, np.ndarray]

    @classmethod
    def from_fields(cls, fields: ReceptiveFields, parts: tuple[float, float], beyond: float = BEYOND) -> FieldAreas:
        """Divide each receptor's area into rows and columns, and add a rim of rectangles around the receptors.

        On each side, at most the fraction `beyond` of the light of all receptors comes from beyond the rim.

        parts: numbers of rows and of columns per receptor, which may be smaller than 1. For example, if there is half a
            row per receptor, each row covers two receptors. The outermost rows may then extend beyond the receptors.
        """
        found = []
        for axis, (n, per_receptor) in enumerate(zip(fields.resolution, parts, strict=True)):
            field = fields.field.sum(axis=2 - axis)
            profile = np.mean(field / field.sum(axis=-1, keepdims=True), axis=0)
            ends = profile, profile[::-1]
            lower, upper = (_rim(end, (n, per_receptor), fields.cells, beyond) for end in ends)
            within = _within(n, per_receptor)
            found.append((np.arange(-lower, within + upper + 1) - within / 2) / per_receptor)
        return cls((found[0], found[1]))

    @property
    def middles(self) -> np.ndarray:
        """Centres of the rectangles, x right, y down [receptor widths and heights], (rectangle, 2)."""
        y, x = ((e[1:] + e[:-1]) / 2 for e in self.edges)
        return np.stack(np.broadcast_arrays(x[None], y[:, None]), axis=-1).reshape(-1, 2)

    @property
    def size(self) -> tuple[float, float]:
        """Width of each rectangle in units of a receptor's width, and its height in units of a receptor's height."""
        y, x = self.edges
        return float(x[1] - x[0]), float(y[1] - y[0])

    def weights(self, fields: ReceptiveFields, receptors: np.ndarray) -> np.ndarray:
        """Return the weights with which the mean light in each rectangle contributes to the signals of some receptors.

        The rectangles are those into which the visual field is divided. A receptor's weights sum to `fields.power`. The
        result is an array (plane, receptor, rectangle), with a plane for each band of each depth layer.

        receptors: indices of the receptors, counted row by row, (receptor,)
        """
        rows, columns = np.divmod(receptors, fields.resolution[1])
        lines = zip(self.edges, fields.resolution, fields.field.shape[1:], (rows, columns), strict=True)
        down, across = (
            {i: _shares(e, i + 0.5 - n / 2, size, fields.cells) for i in np.unique(places)}
            for e, n, size, places in lines
        )
        in_columns = {j: fields.field @ shares.T for j, shares in across.items()}
        found = np.stack([down[i] @ in_columns[j] for i, j in zip(rows, columns, strict=True)], axis=1)
        found = found.reshape(*found.shape[:2], -1)
        found *= fields.power[:, None, None] / found.sum(axis=2, keepdims=True)
        return found


def _within(n: int, per_receptor: float) -> int:
    """Return the smallest number of adjacent rectangles that cover a row or a column of n receptors.

    per_receptor: number of rectangles per receptor, which may be smaller than 1
    """
    return math.ceil(n * per_receptor - 1e-9)


def _rim(profile: np.ndarray, line: tuple[int, float], cells: int, beyond: float) -> int:
    """Return the width of the rim before the first receptor of a row or a column, as a number of rectangles.

    The visual field is divided into rectangles. It includes a rim around the receptors, because receptive fields extend
    beyond the outermost receptors. The result is the smallest number for which the light from outside the rim is at
    most the fraction `beyond` of all light that the receptors of the row or column receive.

    profile: fraction of a receptor's light that comes from each cell along the row or column, (cell,). Cells are the
        equal parts into which the receptor's field is divided; they are independent of the rectangles.
    line: number of receptors in the row or column, and number of rectangles per receptor
    cells: number of cells along a receptor's side
    """
    n, per_receptor = line
    # before[k] is the fraction of a field's power in its first k cells.
    before = np.concatenate([[0.0], np.cumsum(profile)])
    start = (len(profile) - cells) / 2
    overhang = (_within(n, per_receptor) / per_receptor - n) / 2
    rims = np.arange(max(per_receptor, 1) * len(profile)) / per_receptor + overhang
    ends = start - cells * (np.arange(n)[:, None] + rims)
    lost = np.interp(ends, np.arange(len(before)), before).mean(axis=0)
    return int(np.argmax(lost <= beyond))


def _shares(edges: np.ndarray, centre: float, size: int, cells: int) -> np.ndarray:
    """Return the fraction of each cell's length that lies in each rectangle, as an array (rectangle, cell).

    The rectangles divide the visual field, and the cells are the equal parts of one receptive field. Only one direction
    is considered: along a row or along a column.

    edges: positions of the rectangles' edges, in units of a receptor's side, in increasing order, (rectangles + 1,)
    centre: position of the receptive field's centre, in the same units and from the same origin as `edges`
    size: number of cells along the receptive field; the field may be longer than a receptor
    cells: number of cells along a receptor's side
    """
    places = (edges - centre) * cells + size / 2
    return np.diff(np.clip(places[:, None] - np.arange(size), 0, 1), axis=0)
