"""Reliefs: maps of the height of the glass in a pupil, over the square around the pupil.

A relief is a function of (x, y) in units of the aperture radius. Inside the pupil, x and y lie in [-1, 1]. Rows ascend
with y, columns with x. `Pupil.path` converts heights to optical paths, and `Beam.waves` converts optical paths to
phases.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from optics.elements.fine_detail import band_of, power_beyond, reach_of
from optics.elements.spline_map import (
    is_open_grid,
    spline_basis,
    spline_cell,
    spline_coefficients,
    spline_matrix,
    spline_width,
)
from optics.elements.square_samples import map_samples, on_both_sides
from optics.numerics.arguments import finite, plain_reals, positive
from optics.numerics.array_library import gather, library, like, matrix_like, sparse_product
from optics.numerics.autodiff import Array, is_differentiable, plain
from optics.numerics.interpolation import cubic_bsplines, tensor_product

__all__ = ["BSplineRelief", "HeightMap", "Relief"]

FEWEST_FOR_JUMPS = 16  # choice: fewest samples along a side of a relief with jumps


class Relief(ABC):
    """A height map [m] over the pupil."""

    scatters = True  # True if fine detail may scatter light into directions that do not follow from the slopes

    @abstractmethod
    def height(self, x: Array, y: Array) -> Array:
        """Return heights [m] at positions in units of the aperture radius.

        x, y: arrays of NumPy or PyTorch whose shapes broadcast, or flat Float64 arrays of Dr.Jit.
        """

    @abstractmethod
    def bandwidth(self, level: float) -> float:
        """Return the frequency [cycles per aperture radius] above which height components are below `level` [m]."""

    def detail(self, level: float) -> float:
        """Return the frequency [cycles per radius] above which the detail that scatters light is below `level` [m]."""
        return self.bandwidth(level)

    @property
    @abstractmethod
    def knots(self) -> int:
        """Number of polynomial pieces across the pupil."""

    @property
    def span(self) -> float:
        """Difference [m] between the largest and the smallest of the samples or control points; 0 if there are none."""
        return 0.0

    @property
    def jump(self) -> float:
        """Largest step [m] between neighbouring samples if it is too steep for a smooth relief; otherwise 0."""
        return 0.0

    @property
    def pixels(self) -> int:
        """Number of constant-height squares across the pupil, between which the height jumps; 0 for a smooth relief."""
        return 0

    @property
    def rotationally_symmetric(self) -> bool:
        """True if the height and the derivatives that it carries depend only on the distance from the axis."""
        return False

    @property
    def mirror_symmetric(self) -> bool:
        """True if neither x → -x nor y → -y changes the height or the derivatives that it carries."""
        return self.rotationally_symmetric


@dataclass(frozen=True, eq=False)
class BSplineRelief(Relief):
    """One uniform bicubic B-spline patch, h(x, y) = Σ_ij c[i, j] B_i(v) B_j(u), u = (x/a + 1)/2, v = (y/a + 1)/2.

    control_points: c, (4, 4) heights [m], (y, x); the knots are -3 ... 4. a is the pupil's radius. The patch can
    represent every bicubic polynomial, so paraboloids are exact (`paraboloid`). Outside [-a, a]² the polynomial
    continues. Source: Piegl & Tiller, The NURBS Book, ch. 2.

    A Dr.Jit or PyTorch tensor may carry derivatives.

    Raises:
        ValueError: control_points are not 4 x 4 finite real numbers, or are of half precision.
    """

    scatters = False  # the slopes of a polynomial describe all its content
    control_points: np.ndarray | Array

    def __post_init__(self) -> None:
        given = self.control_points
        points = np.array(plain_reals("control_points", given))
        if is_differentiable(self.control_points) and points.size == 16:
            points = points.reshape(4, 4)
        if points.shape != (4, 4):
            raise ValueError(f"control_points has shape {points.shape}: must be 4 x 4 finite heights [m]")
        if not np.isfinite(points).all():
            raise ValueError("control_points holds NaN or infinity: must be 4 x 4 finite heights [m]")
        if not is_differentiable(self.control_points):
            points.setflags(write=False)
            object.__setattr__(self, "control_points", points)

    @classmethod
    def paraboloid(cls, height: float, curvature: float, radius: float) -> BSplineRelief:
        """Return h = height - curvature (x² + y²)/2 [m], curvature in 1/m, over a pupil of the given radius [m].

        If curvature = medium_n / ((n - object_n) f), the relief acts as a lens of the focal length f,
        exp(-ik medium_n r²/2f). n is the index of the relief, medium_n the index behind it, and object_n the index in
        front of it, as in `Pupil`.

        The B-spline coefficients of x² are X_i² - δ²/3. Here X_i = (2i - 3) a are the Greville abscissae, δ = 2a is the
        spacing of the uniform knots, and a is the radius.

        Raises:
            ValueError: an argument is outside its valid range, which the message states.
        """
        finite("height", height), finite("curvature", curvature), positive("radius", radius)
        greville = (2 * np.arange(4) - 3) * radius
        square = greville**2 - (2 * radius) ** 2 / 3
        return cls(height - curvature * (square[:, None] + square[None, :]) / 2)

    def height(self, x: Array, y: Array) -> Array:
        points = like(x, self.control_points)
        across, along = cubic_bsplines((x + 1) / 2), cubic_bsplines((y + 1) / 2)
        return tensor_product(lambda i, j: gather(points, 4 * i + j), across, along)

    @property
    def span(self) -> float:
        return float(np.ptp(plain(self.control_points)))

    def bandwidth(self, level: float) -> float:
        return 1.0  # a cubic polynomial has about half a cycle per half width; a factor of 2 is added

    def detail(self, level: float) -> float:
        return 0.0

    @property
    def knots(self) -> int:
        return 1

    @property
    def rotationally_symmetric(self) -> bool:
        """True for a constant height or a paraboloid on the axis; False if the control points carry derivatives.

        The control points of a constant height or of such a paraboloid are c[i, j] = c₀ + c₁ ((2i - 3)² + (2j - 3)²)
        for i and j from 0 to 3, with two constants c₀ and c₁.
        """
        if is_differentiable(self.control_points):
            return False  # a derivative depends on every control point
        points = self.control_points
        square = (2 * np.arange(4) - 3) ** 2
        corner, curvature = points[1, 1], (points[0, 1] - points[1, 1]) / 8
        paraboloid = corner + curvature * (square[:, None] + square[None, :] - 2)
        return bool(np.abs(points - paraboloid).max() <= 1e-12 * np.abs(points).max())

    @property
    def mirror_symmetric(self) -> bool:
        return not is_differentiable(self.control_points) and on_both_sides(self.control_points)


@dataclass(frozen=True, eq=False)
class HeightMap(Relief):
    """Heights [m] sampled at cell centres over the square around the pupil, joined by cubic splines.

    samples: (row, column); rows ascend with y, columns with x. The splines have not-a-knot ends. They are extrapolated
        by one cell beyond the outermost centres, and by straight lines farther out.

    A Dr.Jit or PyTorch tensor may carry derivatives.

    Raises:
        ValueError: the array is not two-dimensional, is empty, is of half precision, or contains anything other than
            finite real numbers.
    """

    samples: np.ndarray | Array
    _heights: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        samples = map_samples(self.samples)
        object.__setattr__(self, "_heights", samples)
        if not is_differentiable(self.samples):
            object.__setattr__(self, "samples", samples)

    @property
    def span(self) -> float:
        return float(np.ptp(self._heights))

    @property
    def jump(self) -> float:
        """Largest difference [m] between neighbouring samples if the map has jumps; otherwise 0.

        A map has jumps if this difference is more than half of `span`, the range from the lowest to the highest sample,
        and if there are at least 16 rows and 16 columns of samples.
        """
        many = min(self._heights.shape) >= FEWEST_FOR_JUMPS
        steepest = max(np.abs(np.diff(self._heights, axis=axis)).max() for axis in (0, 1)) if many else 0.0
        return float(steepest) if steepest > self.span / 2 else 0.0

    @cached_property
    def _coefficients(self) -> np.ndarray:
        return spline_coefficients(self._heights)

    def _values(self, x: Array) -> Array:
        """Return the spline coefficients in the array library of `x`: M h Nᵀ for samples h, see `spline_matrix`."""
        if not is_differentiable(self.samples) or library(x) is np:
            return like(x, self._coefficients)
        down, across = map(spline_matrix, self._heights.shape)
        found = matrix_like(x, down) @ matrix_like(x, self.samples) @ matrix_like(x, np.ascontiguousarray(across.T))
        return like(x, found)

    def height(self, x: Array, y: Array) -> Array:
        rows, columns = self._heights.shape
        if is_open_grid(x, y):
            return spline_basis(y[:, 0], rows) @ self._coefficients @ spline_basis(x[0], columns).T
        values = self._values(x)
        (column, across), (row, along) = spline_cell(x, columns), spline_cell(y, rows)
        stride = like(row, spline_width(columns))
        return tensor_product(lambda i, j: gather(values, (row + i) * stride + column + j), across, along)

    def weighted(self, weights: Any, like_array: Array) -> Array:
        """Return a flat array of heights [m] at fixed points, from the result of `spline_weights` for these points.

        like_array: array of NumPy or PyTorch, which determines the library of the result.
        """
        return sparse_product(weights, self._values(like_array).reshape(-1))

    def on_grid(self, at: np.ndarray) -> np.ndarray:
        """Return heights at the points of a square grid, a NumPy array (y, x) without derivatives.

        at: positions in units of the radius, which are used both as x and as y.
        """
        return np.asarray(self.height(at[None, :], at[:, None]))

    def bandwidth(self, level: float) -> float:
        return band_of(self._heights, level)

    def detail(self, level: float, part: float = 1.0) -> float:
        """Return the frequency above which the detail that scatters light is below `level` [m].

        Only a square in the middle of the map is considered. The unit is one cycle per half the side of this square.

        part: half the side of this square in units of the radius. Values above 1 count as 1.
        """
        return reach_of(_power_beyond(self, min(part, 1.0)), level)

    @property
    def knots(self) -> int:
        return max(self._heights.shape)

    @property
    def rotationally_symmetric(self) -> bool:
        return self._heights.size == 1

    @property
    def mirror_symmetric(self) -> bool:
        return not is_differentiable(self.samples) and on_both_sides(self._heights)


@lru_cache(maxsize=16)
def _power_beyond(relief: HeightMap, part: float) -> np.ndarray:
    """Return the result of `fine_detail.power_beyond` for the central square of a map; its side is 2 `part` radii."""
    at = ((np.arange(n := math.ceil(part * relief.knots)) + 0.5) * 2 / n - 1) * part
    return power_beyond(relief._heights if part == 1 else relief.on_grid(at))
