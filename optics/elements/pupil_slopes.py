"""Slopes of the wavefront behind a pupil, by finite differences of its optical path."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from optics.apertures.aperture import EDGE_REACH
from optics.elements.source import PointSource
from optics.elements.wavefront_slopes import Slopes, derivative
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

__all__ = ["all_slopes"]

FEW, MANY = 33, 65  # choices: least numbers of points along a side, without and with polynomial pieces
MOST = 1025  # choice, limited by memory: largest number of points along a side of `all_slopes`


class HasPath(Protocol):
    """Interface of a pupil for `all_slopes`, which computes the gradient of the optical path."""

    @property
    def radius(self) -> float: ...

    def path(self, x: Any, y: Any, wavelength: float, source: PointSource) -> Any: ...


@lru_cache(maxsize=64)
def all_slopes(pupil: HasPath, wavelength: float, distance: float, angle: tuple[float, float], pieces: int) -> Slopes:
    """Return the slopes of the optical path at the points of a square grid over the pupil and its soft edge.

    distance, angle: distance [m] of the source and direction of its light, as in `PointSource`.
    pieces: number of polynomial pieces of the relief or wavefront across the pupil. The grid has about four points for
        each piece, but at most 1025 points along a side.
    """
    n = int(min(MOST, max(MANY if pieces else FEW, 4 * pieces + 1)))
    grid = _grid(pupil, n)
    x, y = grid.coordinates(precision("float64"))
    path = pupil.path(x, y, wavelength, PointSource(distance, angle)).numpy().reshape(grid.shape)
    return _by_neighbours(path, grid, pupil.radius)


def _grid(pupil: HasPath, n: int) -> Grid:
    """Return a grid of n² points over the pupil's disk and the soft edge around it."""
    return Grid.square(n, 2 * (1 + EDGE_REACH) * pupil.radius / (n - 1))


def _by_neighbours(path: np.ndarray, grid: Grid, radius: float) -> Slopes:
    return Slopes(grid, derivative(path.T, grid.dx).T, derivative(path, grid.dx), radius)
