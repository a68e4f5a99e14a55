"""Receptors of different sizes on a retina: rectangles that are arranged in rows.

The integral of the receptors' density is the same over every rectangle. Coordinates are x to the right and y down in
the visual field, from the middle of the retina. Their units are the width and the height of an average receptor: the
retina of h x w receptors is [-w/2, w/2] x [-h/2, h/2]. Each row extends over the whole width and has w receptors, whose
widths differ from row to row. The heights of rows follow from the density's mean along x. The widths in a row follow
from the density's mean along y over the height of this row (the conditional distribution, Rosenblatt, Ann. Math. Stat.
23, 470, 1952). The rectangles leave no gaps, and an array of signals remains an image (row, column).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.eye.receptor_density import Density, DensityMap, density_on
from optics.numerics.read_only import ReadOnlyArrays

__all__ = ["ReceptorLattice", "even_lattice", "overlaps", "receptor_lattice"]

NARROWEST = 0.01  # choice: smallest side of a receptor, relative to the average


@dataclass(frozen=True, eq=False)
class ReceptorLattice(ReadOnlyArrays):
    """Rectangles of receptors: x to the right and y down, from the middle of the retina.

    The units are the width and the height of an average receptor.

    rows: edges of the rows, from the top, (h + 1,).
    columns: edges of the receptors in each row, from the left, (h, w + 1).
    """

    rows: np.ndarray
    columns: np.ndarray

    @property
    def sides(self) -> np.ndarray:
        """Height and width of each receptor, (2, h, w)."""
        widths = np.diff(self.columns, axis=1)
        return np.stack([np.broadcast_to(np.diff(self.rows)[:, None], widths.shape), widths])

    @property
    def areas(self) -> np.ndarray:
        """Area of each receptor relative to the average, (h, w)."""
        found: np.ndarray = self.sides.prod(axis=0)
        return found

    @property
    def smallest(self) -> tuple[float, float]:
        """Smallest height and smallest width of a receptor."""
        height, width = self.sides.min(axis=(1, 2))
        return float(height), float(width)

    @property
    def middles(self) -> np.ndarray:
        """Middles (x, y) of the receptors, (h, w, 2)."""
        x, y = ((edges[..., 1:] + edges[..., :-1]) / 2 for edges in (self.columns, self.rows))
        return np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1)

    def directions_deg(self, size: tuple[float, float], middle: tuple[float, float]) -> np.ndarray:
        """Return the angles (right, up) [degrees] of the receptors' middles from the axis, (2, h, w).

        size: average width and height of the receptors on the plane at distance 1 in front of the eye.
        middle: position (right, down) of the field's middle on this plane, the tangents of its angles from the axis.
        """
        right, down = np.moveaxis(self.middles * size + middle, -1, 0)
        return np.degrees(np.arctan(np.stack([right, -down])))

    def angles_deg(self, size: tuple[float, float], middle: tuple[float, float]) -> np.ndarray:
        """Return the angles [degrees] that the receptors subtend vertically and horizontally, (2, h, w).

        size: average width and height of the receptors on the plane at distance 1 in front of the eye.
        middle: position (right, down) of the field's middle on this plane. Its coordinates are the tangents of the
            angles between the axis and the direction of the middle.
        """
        at, half = self.middles * size + middle, self.sides * np.reshape(size[::-1], (2, 1, 1)) / 2
        found = []
        for axis, side in zip((1, 0), half, strict=True):
            ahead = np.concatenate([at, np.ones_like(at[..., :1])], axis=-1)
            aside = side[..., None] * np.eye(3)[axis]
            one, other = ahead - aside, ahead + aside
            sine, cosine = np.linalg.norm(np.cross(one, other), axis=-1), np.sum(one * other, axis=-1)
            found.append(np.degrees(np.arctan2(sine, cosine)))
        return np.stack(found)

    def places(self, counted: np.ndarray) -> np.ndarray:
        """Convert coordinates in units of receptors, (n, 2), to positions (x, y) on the retina, (n, 2).

        In the given coordinates, every receptor is 1 wide and 1 high. The receptor in row i and column j of a retina
        with h rows and w columns covers [j - w/2, j + 1 - w/2] x [i - h/2, i + 1 - h/2]. Coordinates outside the retina
        are converted as if it continued with receptors as large as those at its edge.
        """
        height, width = self.columns.shape[0], self.columns.shape[1] - 1
        column, row = (counted + np.array([width, height]) / 2).T
        i, j = (np.clip(np.floor(at), 0, n - 1).astype(int) for at, n in ((row, height), (column, width)))
        x = self.columns[i, j] + (column - j) * (self.columns[i, j + 1] - self.columns[i, j])
        y = self.rows[i] + (row - i) * (self.rows[i + 1] - self.rows[i])
        return np.stack([x, y], axis=-1)

    def counted(self, places: np.ndarray) -> np.ndarray:
        """Convert positions (x, y) on the retina to coordinates in which every receptor is 1 wide and 1 high.

        This conversion is the inverse of the method `ReceptorLattice.places`. In the new coordinates, the receptor in
        row i and column j of a retina with h rows and w columns covers [j - w/2, j + 1 - w/2] x [i - h/2, i + 1 - h/2].
        The result is an array (..., 2).

        places: positions (x, y), in units of the width and the height of an average receptor, array (..., 2).
        """
        height, width = self.columns.shape[0], self.columns.shape[1] - 1
        x, y = np.moveaxis(places, -1, 0)
        i = np.clip(np.searchsorted(self.rows, y, side="right") - 1, 0, height - 1)
        # One search in all rows: each row is moved to an interval of its own.
        apart = 2.0 * width * np.arange(height)
        inside = np.clip(x, -width / 2, width / 2) + apart[i]
        j = np.searchsorted((self.columns[:, :-1] + apart[:, None]).ravel(), inside, side="right") - 1 - i * width
        j = np.clip(j, 0, width - 1)
        row = i + (y - self.rows[i]) / (self.rows[i + 1] - self.rows[i])
        column = j + (x - self.columns[i, j]) / (self.columns[i, j + 1] - self.columns[i, j])
        return np.stack([column - width / 2, row - height / 2], axis=-1)

    def receptors_at(self, shape: tuple[int, int]) -> np.ndarray:
        """Return the index of the receptor at the middle of each cell of the retina, array (row, column).

        Receptors are counted row by row.

        shape: numbers of rows and columns of equal cells into which the retina is divided.
        """
        height, width = self.columns.shape[0], self.columns.shape[1] - 1
        y, x = (n * ((2 * np.arange(m) + 1) / (2 * m) - 0.5) for n, m in zip((height, width), shape, strict=True))
        column, row = np.moveaxis(self.counted(np.stack(np.meshgrid(x, y), axis=-1)), -1, 0)
        i = np.clip(np.floor(row + height / 2), 0, height - 1).astype(int)
        found: np.ndarray = i * width + np.clip(np.floor(column + width / 2), 0, width - 1).astype(int)
        return found


def even_lattice(resolution: tuple[int, int]) -> ReceptorLattice:
    """Return receptors that are all alike, for a resolution (height, width)."""
    rows, columns = (np.arange(n + 1) - n / 2 for n in resolution)
    return ReceptorLattice(rows, np.tile(columns, (resolution[0], 1)))


@lru_cache(maxsize=32)
def receptor_lattice(
    density: Density | DensityMap, resolution: tuple[int, int], halves: tuple[float, float], middle: tuple[float, float]
) -> ReceptorLattice | None:
    """Return receptors of different sizes that have a given density, or None if the density is constant.

    resolution: number of receptors (height, width).
    halves: half height and half width of the field on the plane at distance 1 in front of the eye.
    middle: position (right, down) of the field's middle on this plane, the tangents of its angles from the axis.

    Raises:
        ValueError: see `density_on`, or a receptor is far narrower than the average.
    """
    values = density_on(density, resolution, halves, middle)
    if values.min() == values.max():
        return None
    (height, width), down = resolution, len(values)
    rows = _edges(values.mean(axis=1)[None], height)[0]
    mean_of_rows = overlaps(rows * down / height + down / 2, down) @ values
    found = ReceptorLattice(rows, _edges(mean_of_rows, width))
    if min(found.smallest) < NARROWEST:
        raise ValueError(
            f"density makes the narrowest receptor {min(found.smallest):.2g} times the average: must be at least "
            f"{NARROWEST:g}, so the density must vary less, or increase over a larger part of the field"
        )
    return found


def overlaps(edges: np.ndarray, cells: int) -> np.ndarray:
    """Return the fraction of each cell that lies between each two successive edges, (edges - 1, cell).

    Cell k covers [k, k + 1].
    """
    return np.diff(np.clip(edges[:, None] - np.arange(cells), 0, 1), axis=0)


def _edges(densities: np.ndarray, count: int) -> np.ndarray:
    """Return edges that divide the range from -count/2 to count/2 into `count` intervals, array (row, count + 1).

    The integral of a row's density is the same over all of its intervals.

    densities: densities of equal cells over the same range, array (row, cell).
    """
    cells = densities.shape[1]
    sums = np.concatenate([np.zeros((len(densities), 1)), np.cumsum(densities, axis=1)], axis=1)
    at, shares = np.arange(cells + 1) / cells - 0.5, np.arange(1, count) / count
    inner = np.stack([np.interp(shares * row[-1], row, at) for row in sums])
    ends = np.full((len(densities), 1), 0.5)
    return count * np.concatenate([-ends, inner, ends], axis=1)
