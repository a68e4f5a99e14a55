"""Rotationally symmetric pictures: computed along one radius, shown on a grid."""

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

# Choice. Entries of the matrix from points to table: 128 MB in float64. Longer lines are computed at its places.
LARGEST_MATRIX = 2**24
BESIDE = TAPS // 2 - 1  # places of the table beyond either end, but one more beyond the rim


@dataclass(frozen=True)
class RadialProfile:
    """A picture that is even in r, wanted up to `rim` [m]: Chebyshev points on [0, radius], and a finer even spacing,
    the table, for the way to a grid. A line of very many zones is computed at the table's places themselves.

    An even function is a polynomial in r²; its Chebyshev points are radius · cos of a quarter turn's angles. The radius
    exceeds the rim by what local interpolation reaches beyond it.
    """

    rim: float
    radius: float
    points: int
    table: int

    @classmethod
    def resolving(cls, rim: float, band: float, distance: float, error: float) -> RadialProfile:
        """Points that carry intensity frequencies up to `band` [1/m] with a relative error of about `error`.

        A wave of r over [-R, R] has the Chebyshev coefficients 2 J_m(2πbR); obliquity has poles at ±i distance, whose
        coefficients fall like e^{-m asinh(distance / R)}. Eight-point interpolation errs by LAGRANGE_8 (2πbh)⁸.
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
        """Whether it is computed at the table's places."""
        return self.points == self.table + TAPS - 1

    def pays(self, outputs: int) -> bool:
        """Whether it saves anything: a window far off the axis is a short piece of a long line."""
        return self.points < outputs

    @property
    def entries(self) -> int:
        """Of the matrix from points to table."""
        return 0 if self.is_table else self.points * self.table

    @property
    def positions(self) -> np.ndarray:
        """Radii [m]: from the rim inwards; or those of the table, from beyond the axis outwards."""
        if self.is_table:
            return np.abs(self.rim * _places(self.table))
        return self.radius * np.cos(np.pi * (np.arange(self.points) + 0.5) / (2 * self.points))

    def onto(self, values: Array, window: Grid, types: Precision, signed: bool = False) -> Array:
        """Values at `positions` carried to the window's samples, flat: at least 0 unless signed, 0 beyond the rim."""
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
        """The table, of values at Chebyshev points."""
        matrix = types.Tensor(_refinement(self.points, self.table, self.rim / self.radius, types.dtype))
        return matmul(matrix, types.Tensor(values, (self.points, 1))).array


@dataclass(frozen=True)
class DistinctRadii:
    """The radii that a window's samples have, each once: for few samples of many zones. Of a square about the axis they
    are fewer than an eighth of the samples."""

    window: Grid

    @property
    def points(self) -> int:
        return len(self.positions)

    @property
    def positions(self) -> np.ndarray:
        """Radii [m], rising."""
        return _distinct(self.window)[0]

    @property
    def radius(self) -> float:
        """The largest [m]."""
        return float(self.positions[-1])

    @property
    def entries(self) -> int:
        """Nothing is interpolated."""
        return 0

    def onto(self, values: Array, window: Grid, types: Precision, signed: bool = False) -> Array:
        """Values at `positions` at the window's samples, flat."""
        import drjit as dr

        return dr.gather(types.Float, types.Float(values), types.Index(_distinct(self.window)[1]))


@lru_cache(maxsize=8)
def _distinct(window: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Distinct radii [m], and of every sample which it has, flat."""
    squared = np.add.outer(np.square(window.y), np.square(window.x)).ravel() / window.dx**2
    found, which = np.unique(np.round(squared, 6), return_inverse=True)  # rounded: one ring stays one
    return np.sqrt(found) * window.dx, padded_for_packets(which.ravel().astype(np.uint32))


def _places(table: int) -> np.ndarray:
    """Of the table, in units of the rim."""
    found: np.ndarray = np.arange(-BESIDE, table + BESIDE + 1) / (table - 1)
    return found


@lru_cache(maxsize=32)
def _refinement(points: int, table: int, rim: float, dtype: str) -> np.ndarray:
    """(table + 7, points): even Chebyshev interpolation to places -3 ... table + 3 of an even spacing, the rim (in
    units of the line's radius) at table - 1."""
    radius = rim * _places(table)
    nodes = np.cos(np.pi * (np.arange(points) + 0.5) / (2 * points))
    degrees = 2 * np.arange(points)
    transform = np.cos(np.arccos(nodes)[None, :] * degrees[:, None]) * (2 / points)
    transform[0] /= 2
    matrix = np.cos(np.arccos(np.minimum(np.abs(radius), 1))[:, None] * degrees[None, :]) @ transform
    matrix.setflags(write=False)
    return np.ascontiguousarray(matrix, dtype=dtype)
