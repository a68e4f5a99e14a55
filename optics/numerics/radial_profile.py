"""Rotationally symmetric images: computed along one radius and interpolated onto a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.numerics.autodiff import Array
from optics.numerics.grid import Grid
from optics.numerics.interpolation import LAGRANGE_8, TAPS, lagrange_weights
from optics.numerics.matrices import matmul
from optics.numerics.precision import Precision, padded_for_packets
from optics.numerics.quadrature import harmonics

__all__ = ["DistinctRadii", "RadialProfile"]

# Choice: entries of the matrix from points to table; 128 MB in float64. Longer lines are computed directly at the
# positions of the table.
LARGEST_MATRIX = 2**24
BESIDE = TAPS // 2 - 1  # positions of the table beyond either end; one more beyond the rim


@dataclass(frozen=True)
class RadialProfile:
    """An image that is even in r, needed up to `rim` [m].

    It is computed at Chebyshev points on [0, radius] and interpolated to a finer, evenly spaced table. The table is
    interpolated onto the grid. A line of very many zones is computed at the positions of the table themselves.

    An even function is a polynomial in r²; its Chebyshev points are radius · cos of the angles in a quarter turn. The
    radius exceeds the rim by the range of local interpolation.
    """

    rim: float
    radius: float
    points: int
    table: int

    @classmethod
    def resolving(cls, rim: float, band: float, distance: float, error: float) -> RadialProfile:
        """Return points that represent intensity frequencies up to `band` [1/m] with a relative error of about `error`.

        A wave of r over [-R, R] has the Chebyshev coefficients 2 J_m(2πbR). Obliquity has poles at ±i distance, whose
        coefficients fall like e^{-m asinh(distance / R)}. The error of eight-point interpolation is LAGRANGE_8 (2πbh)⁸.
        """
        digits = -math.log10(error)
        turns = 2 * math.pi * band * rim + 2 * rim / distance
        step = min(1.0, (error / LAGRANGE_8) ** 0.125) / max(turns, 1.0)
        table = math.ceil(1 / step) + TAPS
        radius = rim * (1 + TAPS / (2 * (table - 1)))
        degree = int(harmonics(np.array(2 * math.pi * band * radius), digits))
        degree += math.ceil(digits * math.log(10) / math.asinh(distance / radius))
        points = math.ceil(degree / 2) + 2
        return cls(rim, radius, points if points * table <= LARGEST_MATRIX else table + TAPS - 1, table)

    @property
    def is_table(self) -> bool:
        """True if the image is computed at the positions of the table."""
        return self.points == self.table + TAPS - 1

    def pays(self, outputs: int) -> bool:
        """Return whether the line has fewer points than the window has samples.

        A window far off the axis covers only a short piece of a long line.
        """
        return self.points < outputs

    @property
    def entries(self) -> int:
        """Number of entries of the matrix from points to table."""
        return 0 if self.is_table else self.points * self.table

    @property
    def positions(self) -> np.ndarray:
        """Radii [m]: from the rim inwards, or the positions of the table from beyond the axis outwards."""
        if self.is_table:
            return np.abs(self.rim * _places(self.table))
        return self.radius * np.cos(np.pi * (np.arange(self.points) + 0.5) / (2 * self.points))

    def onto(self, values: Array, window: Grid, types: Precision, signed: bool = False) -> Array:
        """Return values at `positions` interpolated to the samples of the window, flat.

        They are at least 0 unless signed, and 0 beyond the rim.
        """
        import drjit as dr

        table = values if self.is_table else self._refined(values, types)
        x, y = window.coordinates(types)
        rim = dr.opaque(types.Float64, self.table - 1 + 1e-6)
        place = dr.sqrt(x * x + y * y) * dr.opaque(types.Float64, (self.table - 1) / self.rim)
        within = place <= rim
        place = dr.minimum(place, rim)
        cell = dr.floor(place)
        first = types.Index(cell)
        weights = lagrange_weights(types.Float(place - cell), TAPS)
        total = sum((w * dr.gather(types.Float, table, first + i) for i, w in enumerate(weights)), types.Float(0))
        return dr.select(within, total if signed else dr.maximum(total, 0), 0)

    def _refined(self, values: Array, types: Precision) -> Array:
        """Return the table from values at Chebyshev points."""
        matrix = types.Tensor(_refinement(self.points, self.table, self.rim / self.radius, types.dtype))
        return matmul(matrix, types.Tensor(values, (self.points, 1))).array


@dataclass(frozen=True)
class DistinctRadii:
    """The distinct radii of a window's samples, for few samples of many zones.

    A square about the axis has fewer distinct radii than an eighth of its samples.
    """

    window: Grid

    @property
    def points(self) -> int:
        return len(self.positions)

    @property
    def positions(self) -> np.ndarray:
        """Radii [m] in ascending order."""
        return _distinct(self.window)[0]

    @property
    def radius(self) -> float:
        """Largest radius [m]."""
        return float(self.positions[-1])

    @property
    def entries(self) -> int:
        """Number of matrix entries: 0, because nothing is interpolated."""
        return 0

    def onto(self, values: Array, window: Grid, types: Precision, signed: bool = False) -> Array:
        """Return values at `positions` at the samples of the window, flat."""
        import drjit as dr

        return dr.gather(types.Float, types.Float(values), types.Index(_distinct(self.window)[1]))


@lru_cache(maxsize=8)
def _distinct(window: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct radii [m] and, for every sample, the index of its radius, flat."""
    squared = np.add.outer(np.square(window.y), np.square(window.x)).ravel() / window.dx**2
    # Rounded so that equal radii are not split by rounding errors.
    found, which = np.unique(np.round(squared, 6), return_inverse=True)
    return np.sqrt(found) * window.dx, padded_for_packets(which.ravel().astype(np.uint32))


def _places(table: int) -> np.ndarray:
    """Return the positions of the table in units of the rim."""
    found: np.ndarray = np.arange(-BESIDE, table + BESIDE + 1) / (table - 1)
    return found


@lru_cache(maxsize=32)
def _refinement(points: int, table: int, rim: float, dtype: str) -> np.ndarray:
    """Return even Chebyshev interpolation to positions -3 ... table + 3 of an even spacing, (table + 7, points).

    The rim (in units of the line's radius) is at position table - 1.
    """
    radius = rim * _places(table)
    nodes = np.cos(np.pi * (np.arange(points) + 0.5) / (2 * points))
    degrees = 2 * np.arange(points)
    transform = np.cos(np.arccos(nodes)[None, :] * degrees[:, None]) * (2 / points)
    transform[0] /= 2
    matrix = np.cos(np.arccos(np.minimum(np.abs(radius), 1))[:, None] * degrees[None, :]) @ transform
    matrix.setflags(write=False)
    return np.ascontiguousarray(matrix, dtype=dtype)
