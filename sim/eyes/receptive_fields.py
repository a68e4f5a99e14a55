"""The receptive fields of an eye behind a pupil, and how directions are drawn from all of them at once.

Fields are tabulated on square cells of the visual field's tangent plane, in the coordinates of `sim.eyes.sensor`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

import optics
from sim.eyes.depth_layers import ONE_PSF, DepthLayers

# Chosen: cells across the eye, at least, on which receptive fields are tabulated (validation/C1_receptive_fields.py
# says what of the error is this).
MIN_CELLS = 32
CELLS_ACROSS, MOST_CELLS = 4, 64  # chosen: across a waveguide, at least; along a receptor's side, at most


class NoRaysError(ValueError):
    """So few rays that a receptor has none in its receptive field."""


@dataclass(frozen=True)
class Draw:
    """points: on the tangent plane [receptor pitches], x right, y down, (ray, 2), in order of y
    rows, columns: of the cells that hold them, counted from the first cell of the mixture, (ray,)
    """

    points: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True)
class ReceptiveFields:
    """field: power per cell of one receptor's field: the turned PSF convolved with its square, or what a waveguide
        takes; (plane, y, x), a plane for every depth layer's every band
    density: probability per cell of the mean over all receptors and planes, each with the same weight, (Y, X)
    resolution: receptors (height, width) · cells: along a receptor's side
    """

    field: np.ndarray
    density: np.ndarray
    resolution: tuple[int, int]
    cells: int

    @classmethod
    def of(cls, eye: optics.Eye, cells: int, depth: DepthLayers = ONE_PSF) -> ReceptiveFields:
        """Those of an eye.

        Raises:
            optics.AccuracyError: see `optics.Eye.kernel`.
        """
        # (K ⊗ L)(r) = Σ_v K(r - v) L(v): as weights around the receptor, the convolution's kernel is turned about.
        kernels = _as_wide([eye.kernel(cells, z)[:, ::-1, ::-1] for z in depth.distances])
        field = _averaged(kernels, cells) if eye.waveguide is None else kernels.astype(np.float64)
        everyone = np.arange(np.prod(eye.resolution))
        return cls(field, _mixture(field, eye.resolution, cells, everyone), eye.resolution, cells)

    def drawn_for(self, receptors: np.ndarray) -> ReceptiveFields:
        """The same fields, and the mixture of some receptors' alone."""
        return replace(self, density=_mixture(self.field, self.resolution, self.cells, receptors))

    @property
    def power(self) -> np.ndarray:
        """Fraction of the pupil's power inside a field, and of that what waveguides take, (plane,)."""
        power: np.ndarray = self.field.sum(axis=(1, 2))
        return power

    @property
    def widths(self) -> tuple[float, float]:
        """Of the narrowest plane's field, height and width [receptor pitches]: as wide as one would be that takes the
        same from everywhere and is as concentrated, (sum p)² / sum p² of its profile; 1 for a receptor's square."""
        profiles = (self.field.sum(axis=axis) for axis in (2, 1))
        height, width = (((p.sum(axis=1) ** 2) / (p**2).sum(axis=1)).min() / self.cells for p in profiles)
        return float(height), float(width)

    def draw(self, n: int) -> Draw:
        """n low-discrepancy draws from the mixture: inverts the marginal over rows, then each row's cumulative."""
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
        """What each ray counts for some receptors (row by row), (plane, receptor, ray); a receptor's sum to `power`.

        Raises:
            NoRaysError: a receptor has no ray in its field.
        """
        row, column = np.divmod(receptors, self.resolution[1])
        y = draw.rows[None] - row[:, None] * self.cells
        x = draw.columns[None] - column[:, None] * self.cells
        inside = (y >= 0) & (y < self.field.shape[1]) & (x >= 0) & (x < self.field.shape[2])
        # Outside, the cell after the last: a field is 0 there.
        index = np.where(inside, y * self.field.shape[2] + x, self.field[0].size)
        table = np.pad(self.field.reshape(len(self.field), -1), ((0, 0), (0, 1)))
        weights = table[:, index] / self.density[draw.rows, draw.columns]
        total = weights.sum(axis=2, keepdims=True)
        if not (total > 0).all():
            raise NoRaysError(f"rays_per_receptor: {len(draw)} rays leave a receptor without any; use more")
        weights *= self.power[:, None, None] / total
        return weights


def cells_per_receptor(resolution: tuple[int, int]) -> int:
    """Cells along a receptor's side on which receptive fields are tabulated."""
    return max(4, -(-MIN_CELLS // max(resolution)))


def cells_for(eye: optics.Eye) -> int:
    """The same, and enough across a waveguide that is narrower."""
    fewest = cells_per_receptor(eye.resolution)
    if eye.waveguide is None:
        return fewest
    return min(max(fewest, math.ceil(CELLS_ACROSS * eye.receptor_pitch / eye.waveguide.diameter)), MOST_CELLS)


def receptive_fields_of(eye: optics.Eye, depth: DepthLayers = ONE_PSF) -> ReceptiveFields:
    """The fields of an eye on cells as fine as its PSF can be had on.

    Raises:
        optics.AccuracyError: a pupil whose light spreads too far for the coarsest.
    """
    cells = cells_for(eye)
    while True:
        try:
            return ReceptiveFields.of(eye, cells, depth)
        except optics.AccuracyError:
            # Light that spreads over too many cells for a PSF is smooth on the scale of coarser ones.
            if cells == 1:
                raise
            cells //= 2


def low_discrepancy(n: int) -> np.ndarray:
    """n points in the unit square, (n, 2): the Hammersley set (van der Corput in base 2 against i/n), moved to the
    strata's centres."""
    first_dyadic = 2.0 ** -np.ceil(np.log2(max(n, 2)))
    return np.stack([(np.arange(n) + 0.5) / n, van_der_corput(n, 2) + first_dyadic / 2], axis=-1)


def bounce_samples(n: int) -> np.ndarray:
    """n more points in the unit square, (n, 2), that together with `low_discrepancy` fill the hypercube evenly: the
    next bases of Halton's sequence, from 1 on."""
    return np.stack([van_der_corput(n + 1, 3), van_der_corput(n + 1, 5)], axis=-1)[1:]


def van_der_corput(n: int, base: int) -> np.ndarray:
    """0 ... n - 1 with their digits mirrored at the point, (n,)."""
    inverse, scale, rest = np.zeros(n), 1 / base, np.arange(n)
    while rest.any():
        inverse += scale * (rest % base)
        rest //= base
        scale /= base
    return inverse


def _as_wide(kernels: list[np.ndarray]) -> np.ndarray:
    """All kernels' planes, (plane, y, x), dark rims around the narrower ones."""
    side = max(kernel.shape[-1] for kernel in kernels)
    margins = [(side - kernel.shape[-1]) // 2 for kernel in kernels]
    return np.concatenate([np.pad(k, ((0, 0), (m, m), (m, m))) for k, m in zip(kernels, margins, strict=True)])


def _averaged(kernel: np.ndarray, cells: int) -> np.ndarray:
    """The kernel convolved with the receptor's square, (plane, y, x)."""
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
    """Probability per cell of the mean field over these receptors and all planes."""
    one = (field / field.sum(axis=(1, 2), keepdims=True)).mean(axis=0)
    total = np.zeros([size + cells * (n - 1) for size, n in zip(one.shape, resolution, strict=True)])
    for i, j in zip(*np.divmod(receptors, resolution[1]), strict=True):
        total[i * cells : i * cells + one.shape[0], j * cells : j * cells + one.shape[1]] += one
    return total / total.sum()
