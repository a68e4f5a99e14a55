"""Rotationally symmetric images, which are computed along one radius and interpolated onto a grid."""

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

# Choice: entries of the matrix that maps points to the table; 128 MB in float64. If the matrix would be larger, the
# image is computed at the positions of the table.
LARGEST_MATRIX = 2**24
# Choice, limited by memory: the radii of 8 windows are cached if they have at most this number of samples, else those
# of one window.
LARGE_WINDOW = 2**18
BESIDE = TAPS // 2 - 1  # number of positions of the table beyond the axis; there is one more beyond the rim


@dataclass(frozen=True)
class RadialProfile:
    """A rotationally symmetric image up to the radius `rim` [m], as a function of the radius r. It is even in r.

    The image is computed at Chebyshev points on [0, radius], interpolated to a finer, evenly spaced table, and
    interpolated from the table onto the grid. If the matrix that interpolates from the points to the table would be too
    large, the image is computed at the positions of the table instead.

    An even function is approximated by a polynomial in r², so the Chebyshev points are radius · cos α with angles α in
    a quarter turn. `radius` exceeds the rim, because interpolation from the table reads points beyond the rim.
    """

    rim: float
    radius: float
    points: int
    table: int

    @classmethod
    def resolving(cls, rim: float, band: float, distance: float, error: float) -> RadialProfile:
        """Return a profile that resolves spatial frequencies up to `band` [1/m] with a relative error of about `error`.

        The image is expanded in Chebyshev polynomials of order m on [-R, R], where R is the profile's `radius`. The
        number of Chebyshev points follows from the decay of the coefficients with m. The coefficients of a wave of
        frequency b are 2 J_m(2πbR). Obliquity factors have poles at r = ±iz, where z is the image's `distance` [m] from
        the pupil, so their coefficients fall like e^{-m asinh(z / R)}.

        The image is interpolated onto the grid from a table at evenly spaced radii. The spacing h of these radii
        follows from the error of eight-point interpolation, LAGRANGE_8 (2πbh)⁸.
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
        """True if the image is computed at the evenly spaced radii from which it is interpolated onto the grid.

        If False, the image is computed at Chebyshev points, and interpolated from these to the evenly spaced radii.
        """
        return self.points == self.table + TAPS - 1

    def pays(self, outputs: int) -> bool:
        """Return whether the image is computed at fewer radii than the window has samples.

        outputs: number of samples of the window.

        The radii always extend from the axis to `rim`. A window far off the axis contains only a small part of this
        range, so it may have fewer samples than there are radii.
        """
        return self.points < outputs

    @property
    def entries(self) -> int:
        """Number of entries of the matrix that interpolates the image from Chebyshev points to evenly spaced radii.

        It is 0 if `is_table`, because no matrix is then needed.
        """
        return 0 if self.is_table else self.points * self.table

    @property
    def positions(self) -> np.ndarray:
        """Radii [m] at which the image is computed: Chebyshev points or, if `is_table`, evenly spaced radii.

        The first three of the evenly spaced radii lie on the other side of the axis. They are given as positive
        numbers, because the image is the same there. The last four lie beyond the rim.
        """
        if self.is_table:
            return np.abs(self.rim * _places(self.table))
        return self.radius * np.cos(np.pi * (np.arange(self.points) + 0.5) / (2 * self.points))

    def onto(self, values: Array, window: Grid, types: Precision, signed: bool = False) -> Array:
        """Return the image at the window's samples as a flat array, interpolated from its values at `positions`.

        The result is 0 beyond the radius `rim` of the image. Negative results are replaced by 0 unless `signed` is
        True.
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
        """Return the image at evenly spaced radii, interpolated from its values at Chebyshev points."""
        matrix = types.Tensor(*_refinement(self.points, self.table, self.rim / self.radius, types.dtype))
        return matmul(matrix, types.Tensor(values, (self.points, 1))).array


@dataclass(frozen=True)
class DistinctRadii:
    """The distinct radii of a window's samples, at which the image is computed without interpolation.

    They are used if interpolation along a radius (`RadialProfile`) would need as many radii as the window has samples,
    or more.

    A square of 33 x 33 or more samples about the axis has more than eight samples for each distinct radius.
    """

    window: Grid

    @property
    def points(self) -> int:
        return len(self.positions)

    @property
    def positions(self) -> np.ndarray:
        """Radii [m] in ascending order."""
        return self._distinct[0]

    @property
    def _distinct(self) -> tuple[np.ndarray, np.ndarray]:
        return (_large_distinct if math.prod(self.window.shape) > LARGE_WINDOW else _small_distinct)(self.window)

    @property
    def radius(self) -> float:
        """Largest radius [m]."""
        return float(self.positions[-1])

    @property
    def entries(self) -> int:
        """Number of matrix entries: 0, because nothing is interpolated."""
        return 0

    def onto(self, values: Array, window: Grid, types: Precision, signed: bool = False) -> Array:
        """Return the image at the window's samples as a flat array, given its values at the distinct radii."""
        import drjit as dr

        return dr.gather(types.Float, types.Float(values), types.Index(self._distinct[1]))


def _distinct(window: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct radii [m], (radius,), and for every sample the index of its radius, (sample,)."""
    squared = np.add.outer(np.square(window.y), np.square(window.x)).ravel() / window.dx**2
    # Squared radii are rounded, because rounding errors would make equal radii distinct.
    found, which = np.unique(np.round(squared, 6), return_inverse=True)
    return np.sqrt(found) * window.dx, padded_for_packets(which.ravel().astype(np.uint32))


_small_distinct, _large_distinct = (lru_cache(maxsize=count)(_distinct) for count in (8, 1))


def _places(table: int) -> np.ndarray:
    """Return evenly spaced radii for a table of an image, in units of the image's largest radius, its rim.

    The first three radii are negative, and the last four exceed 1.

    table: number of radii from the axis (0) to the rim (1), both included.
    """
    found: np.ndarray = np.arange(-BESIDE, table + BESIDE + 1) / (table - 1)
    return found


@lru_cache(maxsize=32)
def _refinement(points: int, table: int, rim: float, dtype: str) -> tuple[np.ndarray, tuple[int, ...]]:
    """Return a flat matrix that interpolates from Chebyshev points to evenly spaced radii, and the matrix's shape.

    The shape is (table + 7, points). The interpolating polynomial is even. The evenly spaced radii are numbered from -3
    to table + 3. Number 0 is the axis, and number table - 1 is the radius `rim`, in units of the profile's radius.
    """
    radius = rim * _places(table)
    nodes = np.cos(np.pi * (np.arange(points) + 0.5) / (2 * points))
    degrees = 2 * np.arange(points)
    transform = np.cos(np.arccos(nodes)[None, :] * degrees[:, None]) * (2 / points)
    transform[0] /= 2
    matrix = np.cos(np.arccos(np.minimum(np.abs(radius), 1))[:, None] * degrees[None, :]) @ transform
    return padded_for_packets(matrix.astype(dtype)), matrix.shape
