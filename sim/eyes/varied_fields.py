"""Receptive fields of receptors of different sizes behind a pupil: the PSF, integrated over each receptor's rectangle.

All receptors share the PSF. The integral of the PSF between two edges of a rectangle is the difference between the
cumulative sums of the PSF at these edges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import optics
from optics.eye.receptor_lattice import ReceptorLattice, overlaps
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.receptive_fields import Draw, ReceptiveFields, kernels_of

# Weights of a cell and its two neighbours in the average over cells that `_mixture` takes.
NEAR = 0.25, 0.5, 0.25


@dataclass(frozen=True)
class VariedFields(ReceptiveFields):
    """Tabulated receptive fields of an eye whose receptors differ in size (`optics.Eye(density=...)`).

    The visual field is divided into equal cells, `cells` * `cells` of them for the area of an average receptor. Fields
    are tabulated for these cells.

    field: power of the PSF, rotated by 180°, in each cell that the PSF covers, (plane, y, x), with one plane for each
        band of each depth layer
    density: probability with which a ray is drawn in each cell of the visual field, (y, x). The density is the mean of
        the fields of all receptors, so it is high where receptors are dense.
    resolution: receptors (height, width)
    cells: number of cells along the side of an average receptor
    lattice: the rectangles that the receptors cover
    """

    lattice: ReceptorLattice

    @classmethod
    def from_eye(cls, eye: optics.Eye, cells: int, depth: DepthLayers = ONE_PSF) -> VariedFields:
        """Tabulate the receptive fields of an eye.

        Raises:
            optics.AccuracyError: see `optics.Eye.kernel`.
        """
        assert eye.lattice is not None
        field = kernels_of(eye, cells, depth).astype(np.float64)
        everyone = np.arange(np.prod(eye.resolution))
        density = _mixture(field, eye.lattice, cells, everyone)
        return cls(field, density, eye.resolution, cells, eye.lattice)

    def drawn_for(self, receptors: np.ndarray) -> VariedFields:
        """Return a copy that draws rays only for these receptors: the copy's `density` is the mean of their fields."""
        return replace(self, density=_mixture(self.field, self.lattice, self.cells, receptors))

    def values(self, draw: Draw, receptors: np.ndarray) -> np.ndarray:
        """Return the weights with which light along each ray enters some receptors' signals, (plane, receptor, ray).

        A weight is the PSF, averaged over the receptor's rectangle. It applies to the light from one cell of the visual
        field. Cells are squares, much smaller than an average receptor. There is one plane for each band of each depth
        layer. A depth layer is a distance for which the eye has a PSF.

        draw: rays from the method `draw`
        receptors: indices of the receptors, counted row by row
        """
        rows, columns = np.divmod(receptors, self.resolution[1])
        found = np.zeros((len(self.field), len(receptors), len(draw)))
        for row in np.unique(rows):
            mine = np.flatnonzero(rows == row)
            found[:, mine] = self._values_in_row(draw, row, columns[mine])
        return found

    def _values_in_row(self, draw: Draw, row: int, columns: np.ndarray) -> np.ndarray:
        """Return the result of `values` for the receptors in some columns of one row."""
        planes, height, width = self.field.shape
        upper, lower = _edges(self.lattice.rows, self.resolution[0], self.cells)[row : row + 2]
        edges = _edges(self.lattice.columns[row], self.resolution[1], self.cells)
        found = np.zeros((planes, len(columns), len(draw)))
        # x and y are in cells from the corner of the mixture. The PSF of a ray at y extends from y + 1/2 - lower to y +
        # 1/2 - upper.
        x, y = (draw.points * self.cells + np.array(self.density.shape[::-1]) / 2 + 0.5).T
        near = np.flatnonzero((y > upper) & (y < lower + height))
        if not near.size:
            return found
        before = np.concatenate([np.zeros((planes, 1, width)), np.cumsum(self.field, axis=1)], axis=1)
        in_row = _at(before, y[near] - upper) - _at(before, y[near] - lower)
        before = np.concatenate([np.zeros((planes, len(near), 1)), np.cumsum(in_row, axis=2)], axis=2)
        area = (lower - upper) * np.diff(edges)[columns]
        left, right = (edges[columns + side][:, None] for side in (0, 1))
        values = _across(before, x[near] - left) - _across(before, x[near] - right)
        found[:, :, near] = np.maximum(values / area[:, None], 0)
        return found


def _edges(edges: np.ndarray, receptors: int, cells: int) -> np.ndarray:
    """Return the distances of receptors' edges from the top or the left end of the retina [cells].

    edges: positions of the edges relative to the middle of the retina [heights or widths of an average receptor]
    receptors: number of receptors along the axis
    cells: number of cells along the side of an average receptor
    """
    found: np.ndarray = (edges + receptors / 2) * cells
    return found


def _at(table: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Interpolate a table linearly along its second axis, and return the values as an array (plane, position, x).

    table: values for each plane (one band of one depth layer of the eye), (plane, n + 1, x)
    places: positions along the second axis; 2.5 is midway between the entries 2 and 3, (position,)
    """
    at = np.clip(places, 0, table.shape[1] - 1)
    k = np.minimum(at.astype(int), table.shape[1] - 2)
    share = (at - k)[:, None]
    return (1 - share) * table[:, k] + share * table[:, k + 1]


def _across(table: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Interpolate a table linearly along its third axis, and return the values as an array (plane, receptor, ray).

    table: values for each plane (one band of one depth layer of the eye) and each ray, (plane, ray, n + 1)
    places: positions along the third axis; 2.5 is midway between the entries 2 and 3, (receptor, ray)
    """
    at = np.clip(places, 0, table.shape[2] - 1)
    k = np.minimum(at.astype(int), table.shape[2] - 2)
    share, rays = at - k, np.arange(table.shape[1])
    return (1 - share) * table[:, rays, k] + share * table[:, rays, k + 1]


def _mixture(field: np.ndarray, lattice: ReceptorLattice, cells: int, receptors: np.ndarray) -> np.ndarray:
    """Return the mean of these receptors' fields in each cell of the visual field, (y, x), scaled to the sum 1.

    Rays are drawn with this probability. The mean is also taken over all bands and all depth layers; a depth layer is a
    distance for which the eye has a PSF. The mean is computed at the middles of cells, from which a ray may be up to
    half a cell away. It is therefore averaged over neighbouring cells. Otherwise a ray just beyond the rim of the
    fields, where the mean is almost 0, could get a huge weight.

    field: power of the PSF, rotated by 180°, in each cell, (plane, y, x)
    lattice: the rectangles that all receptors cover
    cells: number of cells along the side of an average receptor
    receptors: indices of the receptors, counted row by row
    """
    from scipy.ndimage import convolve1d
    from scipy.signal import fftconvolve

    height, width = lattice.areas.shape
    rows, columns = np.divmod(receptors, width)
    down = overlaps(_edges(lattice.rows, height, cells), height * cells)
    light = np.zeros((height * cells, width * cells))
    for row in np.unique(rows):
        across = overlaps(_edges(lattice.columns[row], width, cells), width * cells)[columns[rows == row]]
        light += np.outer(down[row] / down[row].sum(), (across / across.sum(axis=1, keepdims=True)).sum(axis=0))
    one = (field / field.sum(axis=(1, 2), keepdims=True)).mean(axis=0)
    total = np.maximum(fftconvolve(light, one), 0)
    for axis in (0, 1):
        total = convolve1d(total, NEAR, axis, mode="constant")
    found: np.ndarray = total / total.sum()
    return found
