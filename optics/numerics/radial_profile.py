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
from optics.numerics.precision import Precision
from optics.numerics.quadrature import harmonics

__all__ = ["RadialProfile"]

# Choice. Entries of the matrix from points to table: 128 MB in float64.
LARGEST_MATRIX = 2**24


@dataclass(frozen=True)
class RadialProfile:
    """A picture that is even in r, wanted up to `rim` [m]: Chebyshev points on [0, radius], and a finer even spacing
    for the way to a grid.

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
        return cls(rim, radius, math.ceil(degree / 2) + 2, table)

    def pays(self, outputs: int) -> bool:
        """Whether it saves anything: a window far off the axis is a short piece of a long line."""
        return self.points < outputs and self.points * self.table <= LARGEST_MATRIX

    @property
    def positions(self) -> np.ndarray:
        """Radii [m], from the rim inwards."""
        return self.radius * np.cos(np.pi * (np.arange(self.points) + 0.5) / (2 * self.points))

    def onto(self, values: Array, window: Grid, types: Precision, signed: bool = False) -> Array:
        """Values at `positions` carried to the window's samples, flat: at least 0 unless signed, 0 beyond the rim."""
        import drjit as dr

        matrix = types.Tensor(_refinement(self.points, self.table, self.rim / self.radius, types.dtype))
        table = matmul(matrix, types.Tensor(values, (self.points, 1))).array
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


@lru_cache(maxsize=32)
def _refinement(points: int, table: int, rim: float, dtype: str) -> np.ndarray:
    """(table + 7, points): even Chebyshev interpolation to places -3 ... table + 3 of an even spacing, the rim (in
    units of the line's radius) at table - 1."""
    radius = rim * np.arange(-(TAPS // 2 - 1), table + TAPS // 2) / (table - 1)
    nodes = np.cos(np.pi * (np.arange(points) + 0.5) / (2 * points))
    degrees = 2 * np.arange(points)
    transform = np.cos(np.arccos(nodes)[None, :] * degrees[:, None]) * (2 / points)
    transform[0] /= 2
    matrix = np.cos(np.arccos(np.minimum(np.abs(radius), 1))[:, None] * degrees[None, :]) @ transform
    matrix.setflags(write=False)
    return np.ascontiguousarray(matrix, dtype=dtype)
