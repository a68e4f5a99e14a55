"""Receptive fields of an eye behind a pupil, and low-discrepancy directions drawn from the mixture of all fields.

The mixture is the mean of the fields of all receptors, as a probability density. Fields are tabulated on cells of the
visual field's tangent plane, in the coordinates of `sim.eyes.sensor`. The width and the height of a
receptor are divided into the same number of cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

import optics
from sim.eyes.depth_layers import ONE_PSF, DepthLayers

# Chosen: the smallest number of cells across the eye's visual field. validation/sim/receptive_field_sampling.py reports
# the error that such cells cause.
MIN_CELLS = 32
# Chosen: smallest number of cells across a waveguide's diameter, and largest number of cells along a receptor's side.
# If the two limits conflict, the second applies.
CELLS_ACROSS, MOST_CELLS = 4, 64
# Chosen: smallest number of cells along the smallest side of receptors with a `density`, within MOST_CELLS. Fields of
# these receptors are evaluated at the rays themselves, so twice as many cells hardly reduce the error.
CELLS_OF_SMALLEST = 2


class NoRaysError(ValueError):
    """The number of rays is too small: a receptor has no ray in its receptive field."""


@dataclass(frozen=True)
class Draw:
    """Low-discrepancy directions of rays. Their probability density is the mean of the receptive fields.

    points: points on the tangent plane, x right and y down, in units of a receptor's width and height, in order of y,
        (ray, 2)
    rows, columns: row and column of the cell that contains each point, (ray,). Cells are the small rectangles of the
        visual field for which the density is tabulated.
    """

    points: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True)
class ReceptiveFields:
    """Receptive fields of an eye, tabulated for cells: small rectangles into which the visual field is divided.

    field: fraction of the power entering the pupil that one receptor receives from each cell of its field, (plane, y,
        x). It contains one plane (table) for each band of each depth layer. A plane is the PSF, rotated by 180° and
        convolved with the receptor's area. If receptors are waveguides, a plane is a waveguide's acceptance of light
        from each cell.
    density: probability of drawing a ray in each cell of the visual field: the mean of the fields of all receptors and
        planes, (Y, X)
    resolution: numbers of rows and columns of receptors
    cells: number of cells along a receptor's side
    """

    field: np.ndarray
    density: np.ndarray
    resolution: tuple[int, int]
    cells: int

    @classmethod
    def from_eye(cls, eye: optics.Eye, cells: int, depth: DepthLayers = ONE_PSF) -> ReceptiveFields:
        """Tabulate the receptive fields of an eye.

        cells: number of equal parts into which a receptor's side is divided; fields have one value for each part

        Raises:
            optics.AccuracyError: see `optics.Eye.kernel`.
        """
        kernels = kernels_of(eye, cells, depth)
        field = _averaged(kernels, cells) if eye.waveguide is None else kernels.astype(np.float64)
        everyone = np.arange(np.prod(eye.resolution))
        return cls(field, _mixture(field, eye.resolution, cells, everyone), eye.resolution, cells)

    def drawn_for(self, receptors: np.ndarray) -> ReceptiveFields:
        """Return a copy that draws rays only for these receptors: the copy's `density` is the mean of these fields."""
        return replace(self, density=_mixture(self.field, self.resolution, self.cells, receptors))

    @property
    def power(self) -> np.ndarray:
        """Fraction of the pupil's power that falls inside a receptor's field, (plane,).

        There is a plane for each band of each depth layer. If receptors are waveguides, this fraction is multiplied by
        the fraction of the power that a waveguide accepts.
        """
        power: np.ndarray = self.field.sum(axis=(1, 2))
        return power

    @property
    def widths(self) -> tuple[float, float]:
        """Smallest height and smallest width of a receptor's field, among all bands and depth layers.

        The units are a receptor's height and width. The height and width of a field are the equivalent widths
        (sum p)² / sum p² of the field's vertical and horizontal profiles p. A uniform field that covers a receptor's
        area has the width 1.
        """
        profiles = (self.field.sum(axis=axis) for axis in (2, 1))
        height, width = (((p.sum(axis=1) ** 2) / (p**2).sum(axis=1)).min() / self.cells for p in profiles)
        return float(height), float(width)

    def draw(self, n: int) -> Draw:
        """Return n low-discrepancy directions, drawn from the mean of receptive fields.

        The mean is given as `density`, a table with one probability for each cell of the visual field. The row of a
        direction's cell is found by inverting the cumulative distribution of rows. The column is found by inverting the
        cumulative distribution within this row.
        """
        density, points = self.density, low_discrepancy(n)
        rows = np.concatenate([[0.0], np.cumsum(density.sum(axis=1))])
        rows /= rows[-1]
        ys = np.clip(np.searchsorted(rows, points[:, 0], side="right") - 1, 0, density.shape[0] - 1)
        y = ys + (points[:, 0] - rows[ys]) / (rows[ys + 1] - rows[ys])
        xs, x = np.empty(n, int), np.empty(n)
        for row in np.unique(ys):
            mine = ys == row
            columns = np.concatenate([[0.0], np.cumsum(density[row])])
            columns /= columns[-1]
            at = np.clip(np.searchsorted(columns, points[mine, 1], side="right") - 1, 0, density.shape[1] - 1)
            xs[mine] = at
            x[mine] = at + (points[mine, 1] - columns[at]) / (columns[at + 1] - columns[at])
        cells = np.stack([x, y], axis=-1)
        return Draw(cells / self.cells - np.array(density.shape)[::-1] / (2 * self.cells), ys, xs)

    def weights(self, draw: Draw, receptors: np.ndarray) -> np.ndarray:
        """Return the weight of each ray in the signal of each of these receptors, (plane, receptor, ray).

        A plane contains the weights in one band of one depth layer. A receptor's weights in a plane sum to `power`.
        Receptors are numbered row by row.

        Raises:
            NoRaysError: a receptor has no ray in its field.
        """
        weights = self.values(draw, receptors) / self.density[draw.rows, draw.columns]
        total = weights.sum(axis=2, keepdims=True)
        if not (total > 0).all():
            raise NoRaysError(f"rays_per_receptor: {len(draw)} rays leave a receptor without any; use more")
        weights *= self.power[:, None, None] / total
        return weights

    def values(self, draw: Draw, receptors: np.ndarray) -> np.ndarray:
        """Return the fraction of the pupil's power that some receptors receive from the cell around each ray.

        Cells are the small rectangles of the visual field for which receptive fields are tabulated. The value is 0 if a
        ray lies outside a receptor's field. The result is an array (plane, receptor, ray), with a plane for each band
        of each depth layer.

        draw: rays that the method `draw` has returned
        receptors: indices of the receptors, counted row by row
        """
        row, column = np.divmod(receptors, self.resolution[1])
        y = draw.rows[None] - row[:, None] * self.cells
        x = draw.columns[None] - column[:, None] * self.cells
        inside = (y >= 0) & (y < self.field.shape[1]) & (x >= 0) & (x < self.field.shape[2])
        # Rays outside the field get the index after the last cell, where the padded table is 0.
        index = np.where(inside, y * self.field.shape[2] + x, self.field[0].size)
        table = np.pad(self.field.reshape(len(self.field), -1), ((0, 0), (0, 1)))
        found: np.ndarray = table[:, index]
        return found


def cells_per_receptor(resolution: tuple[int, int]) -> int:
    """Return the usual number of cells along a receptor's side, for eyes of this resolution (height, width).

    Cells are equal parts of a receptor's area. Receptive fields are tabulated with one value for each cell. There are
    at least 4 cells along a receptor's side, and at least 32 along the side of the eye's field that has more receptors.
    Some eyes need more cells, see `cells_for`.
    """
    return max(4, -(-MIN_CELLS // max(resolution)))


def kernels_of(eye: optics.Eye, cells: int, depth: DepthLayers) -> np.ndarray:
    """Return the kernel of each depth layer, rotated by 180°, (plane, y, x).

    There is a plane for each band of each depth layer. The axes y and x count cells. A receptor is `cells` cells wide
    and high. If K is the kernel and L(v) the light from the position v in the visual field, the signal of the receptor
    at r is the convolution Σ_v K(r - v) L(v). The weights of the light are therefore the kernel, rotated by 180° and
    centred on the receptor.
    """
    return _as_wide([eye.kernel(cells, z)[:, ::-1, ::-1] for z in depth.distances])


def cells_for(eye: optics.Eye) -> int:
    """Return the number of cells along the side of an eye's average receptor.

    Cells are equal parts of this receptor's area. Receptive fields are tabulated with one value for each cell. The
    usual number is the result of `cells_per_receptor`. Eyes with narrow waveguides, or with receptors much smaller than
    the average, need more cells, but have at most 64.
    """
    fewest = cells_per_receptor(eye.resolution)
    if eye.lattice is not None:
        return min(max(fewest, math.ceil(CELLS_OF_SMALLEST / eye.smallest_share)), MOST_CELLS)
    if eye.waveguide is None:
        return fewest
    return min(max(fewest, math.ceil(CELLS_ACROSS * max(eye.receptor_size) / eye.waveguide.diameter)), MOST_CELLS)


def receptive_fields_of(
    eye: optics.Eye, depth: DepthLayers = ONE_PSF, kind: type[ReceptiveFields] = ReceptiveFields
) -> ReceptiveFields:
    """Return tables of the receptive fields of an eye.

    The tables have one value per cell. Cells are the equal parts into which an average receptor's area is divided.
    `cells_for` defines the number of cells along a receptor's side. If the PSF covers too many cells to be computed,
    the number of cells along the side is halved until the computation succeeds.

    kind: class of the table; `sim.eyes.varied_fields.VariedFields` for receptors of different sizes

    Raises:
        optics.AccuracyError: the pupil spreads light too far even for the coarsest cells.
    """
    cells = cells_for(eye)
    while True:
        try:
            return kind.from_eye(eye, cells, depth)
        except optics.AccuracyError:
            # A PSF that extends over too many cells is smooth, so coarser cells are enough.
            if cells == 1:
                raise
            cells //= 2


def low_discrepancy(n: int) -> np.ndarray:
    """Return n low-discrepancy points in the unit square, (n, 2).

    The coordinates in the Hammersley set are i/n and van der Corput's sequence in base 2. Here, each coordinate is
    increased by half the distance between its adjacent values.
    """
    first_dyadic = 2.0 ** -np.ceil(np.log2(max(n, 2)))
    return np.stack([(np.arange(n) + 0.5) / n, van_der_corput(n, 2) + first_dyadic / 2], axis=-1)


def bounce_samples(n: int) -> np.ndarray:
    """Return n points in the unit square, (n, 2), from Halton's sequence in the bases 3 and 5.

    Together with the points of `low_discrepancy`, they fill the four-dimensional hypercube evenly.
    """
    return np.stack([van_der_corput(n + 1, 3), van_der_corput(n + 1, 5)], axis=-1)[1:]


def van_der_corput(n: int, base: int) -> np.ndarray:
    """Return the numbers 0 ... n - 1 with their digits in this base mirrored at the radix point, (n,)."""
    inverse, scale, rest = np.zeros(n), 1 / base, np.arange(n)
    while rest.any():
        inverse += scale * (rest % base)
        rest //= base
        scale /= base
    return inverse


def _as_wide(kernels: list[np.ndarray]) -> np.ndarray:
    """Return the planes of all kernels as one array (plane, y, x); zeros are added around narrower kernels."""
    sides = np.max([kernel.shape[1:] for kernel in kernels], axis=0)
    margins = [[(0, 0), *((m, m) for m in (sides - kernel.shape[1:]) // 2)] for kernel in kernels]
    return np.concatenate([np.pad(kernel, margin) for kernel, margin in zip(kernels, margins, strict=True)])


def _averaged(kernel: np.ndarray, cells: int) -> np.ndarray:
    """Return the kernel (plane, y, x) convolved with a receptor's square, which is `cells` cells wide.

    The result has `cells` - 1 more rows and columns than the kernel.
    """
    fields = kernel.astype(np.float64)
    for axis in (1, 2):
        ends = [(0, 0)] * 3
        ends[axis] = (cells, cells - 1)
        sums = np.cumsum(np.pad(fields, ends), axis=axis)
        size = fields.shape[axis] + cells - 1
        upper = np.take(sums, np.arange(cells, cells + size), axis)
        fields = (upper - np.take(sums, np.arange(size), axis)) / cells
    return np.maximum(fields, 0.0)


def _mixture(field: np.ndarray, resolution: tuple[int, int], cells: int, receptors: np.ndarray) -> np.ndarray:
    """Return the mean of these receptors' fields, scaled so that all cells of the visual field sum to 1, (y, x).

    Rays are drawn with this mean as their probability. A receptor's field is given as several planes, one for each band
    of each depth layer, and the mean is also taken over these. Every plane has the same weight in the mean, whatever
    its power.

    field: power in each cell of a single receptor's field, (plane, y, x); all receptors have the same field, each
        around its own position
    resolution: rows and columns of receptors
    cells: number of cells along a receptor's side
    receptors: indices of the receptors, counted row by row
    """
    one = (field / field.sum(axis=(1, 2), keepdims=True)).mean(axis=0)
    total = np.zeros([size + cells * (n - 1) for size, n in zip(one.shape, resolution, strict=True)])
    for i, j in zip(*np.divmod(receptors, resolution[1]), strict=True):
        total[i * cells : i * cells + one.shape[0], j * cells : j * cells + one.shape[1]] += one
    return total / total.sum()
