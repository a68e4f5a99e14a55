"""Sample positions: n samples at pitch dx with sample n//2 at the centre."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import numpy as np

from optics.numerics.arguments import LARGEST, SMALLEST, point_2d, positive, shape_2d
from optics.numerics.autodiff import Array
from optics.numerics.precision import Precision, opaque

__all__ = ["Grid", "OnWindow", "sample_positions"]


def sample_positions(n: int, dx: float) -> np.ndarray:
    """Return the positions [m] of n samples at pitch dx, in float64; sample n//2 is at 0."""
    return (np.arange(n) - n // 2) * dx


@dataclass(frozen=True)
class Grid:
    """Samples of a plane.

    shape: number of samples (y, x).
    dx: pitch [m], or [1/m] for spatial frequencies.
    centre: position (x, y) of sample n//2, in the unit of dx.

    Raises:
        ValueError: shape is not two whole numbers of at least 1, dx is not within [1e-15, 1e15], or centre is not
            finite.
    """

    shape: tuple[int, int]
    dx: float
    centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self._is_plain:
            return  # fast path: planning creates hundreds of grids from valid plain numbers
        object.__setattr__(self, "shape", shape_2d("shape", self.shape))
        # dx becomes a Python number, because a NumPy scalar would convert a Dr.Jit array to NumPy in a product.
        object.__setattr__(self, "dx", positive("dx", self.dx))
        object.__setattr__(self, "centre", point_2d("centre", self.centre))

    @property
    def _is_plain(self) -> bool:
        """True if all numbers have Python's built-in types and are valid."""
        height, width = self.shape if type(self.shape) is tuple and len(self.shape) == 2 else (None, None)
        return (
            type(height) is int
            and type(width) is int
            and min(height, width) >= 1
            and type(self.dx) is float
            and SMALLEST <= self.dx <= LARGEST
            and type(self.centre) is tuple
            and all(type(at) is float and isfinite(at) for at in self.centre)
            and len(self.centre) == 2
        )

    @classmethod
    def square(cls, n: int, dx: float) -> Grid:
        """Return n x n samples around (0, 0)."""
        return cls((n, n), dx)

    def moved(self, centre: tuple[float, float]) -> Grid:
        """Return the same samples about another centre (x, y)."""
        return Grid(self.shape, self.dx, centre)

    @property
    def x(self) -> np.ndarray:
        """Positions of the columns, in the unit of dx."""
        return self.centre[0] + sample_positions(self.shape[1], self.dx)

    @property
    def y(self) -> np.ndarray:
        """Positions of the rows, in the unit of dx."""
        return self.centre[1] + sample_positions(self.shape[0], self.dx)

    @property
    def half_width(self) -> float:
        """Upper bound of a sample's distance from the origin along an axis; exact for a grid centred on the origin."""
        return max(abs(middle) + n // 2 * self.dx for middle, n in zip(self.centre, self.shape[::-1], strict=True))

    @property
    def half_diagonal(self) -> float:
        """Upper bound of a sample's distance from the origin; exact for a grid centred on the origin."""
        x, y = (abs(middle) + n // 2 * self.dx for middle, n in zip(self.centre, self.shape[::-1], strict=True))
        return float(np.hypot(x, y))

    @property
    def own_half_width(self) -> float:
        """Largest distance of a sample from the grid's centre along an axis."""
        return max(n // 2 for n in self.shape) * self.dx

    @property
    def own_half_diagonal(self) -> float:
        """Largest distance of a sample from the grid's centre."""
        return float(np.hypot(self.shape[0] // 2, self.shape[1] // 2) * self.dx)

    def coordinates(self, precision: Precision) -> tuple[Array, Array]:
        """Return x and y of every sample as flat Dr.Jit arrays, in float64 because phases need it."""
        import drjit as dr

        height, width = self.shape
        index = precision.Float64(dr.arange(precision.Index, height * width))
        columns, pitch = opaque(precision, width), opaque(precision, self.dx)
        row = dr.floor((index + 0.5) / columns)  # integer division would not vectorise
        column = dr.fma(-row, columns, index)
        x, y = (column - opaque(precision, width // 2)) * pitch, (row - opaque(precision, height // 2)) * pitch
        if self.centre == (0.0, 0.0):
            return x, y
        return x + opaque(precision, self.centre[0]), y + opaque(precision, self.centre[1])


class HasWindow(Protocol):
    """Interface of objects with samples on a grid."""

    @property
    def window(self) -> Grid: ...


class OnWindow:
    """Mixin that adds sample positions to objects with a `window`."""

    @property
    def x(self: HasWindow) -> np.ndarray:
        """Positions of the columns [m]."""
        return self.window.x

    @property
    def y(self: HasWindow) -> np.ndarray:
        """Positions of the rows [m]."""
        return self.window.y
