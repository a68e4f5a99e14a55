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

__all__ = ["all_slopes", "sampled_slopes"]

FEW, MANY = 33, 65  # choices: numbers of points along a side of `sampled_slopes`, without and with fine detail
MOST = 1025  # choice, limited by memory: largest number of points along a side of `all_slopes`


class HasPath(Protocol):
    """Interface of a pupil whose slopes are computed from its optical path."""

    @property
    def radius(self) -> float: ...

    def path(self, x: Any, y: Any, wavelength: float, source: PointSource) -> Any: ...


@lru_cache(maxsize=64)
def all_slopes(pupil: HasPath, wavelength: float, distance: float, angle: tuple[float, float], pieces: int) -> Slopes:
    """Return slopes on a grid that resolves all polynomial pieces, of which there are `pieces` across the pupil."""
    n = int(min(MOST, max(MANY if pieces else FEW, 4 * pieces + 1)))
    grid = _grid(pupil, n)
    x, y = grid.coordinates(precision("float64"))
    path = pupil.path(x, y, wavelength, PointSource(distance, angle)).numpy().reshape(grid.shape)
    return _by_neighbours(path, grid, pupil.radius)


def sampled_slopes(pupil: HasPath, wavelength: float, source: PointSource, pieces: int) -> Slopes:
    """Return slopes at a limited number of points, by differences with steps shorter than a polynomial piece."""
    place = source.plain
    if 4 * pieces < FEW:
        grid = _grid(pupil, FEW)
        path = pupil.path(grid.x[None, :], grid.y[:, None], wavelength, place)
        return _by_neighbours(path, grid, pupil.radius)
    grid, step = _grid(pupil, MANY), pupil.radius / (8 * pieces)
    x, y = grid.x[None, :], grid.y[:, None]
    ahead, behind, above, below = (
        pupil.path(x + sign * dx, y + sign * dy, wavelength, place)
        for dx, dy in ((step, 0.0), (0.0, step))
        for sign in (1, -1)
    )
    return Slopes(grid, (ahead - behind) / (2 * step), (above - below) / (2 * step), pupil.radius)


def _grid(pupil: HasPath, n: int) -> Grid:
    """Return a grid over the disk and its soft edge."""
    return Grid.square(n, 2 * (1 + EDGE_REACH) * pupil.radius / (n - 1))


def _by_neighbours(path: np.ndarray, grid: Grid, radius: float) -> Slopes:
    return Slopes(grid, derivative(path.T, grid.dx).T, derivative(path, grid.dx), radius)
