"""Local slopes of the wavefront behind a pupil.

The slopes give the directions of rays. They also give the gradient of the whole optical path from the source through a
point of the pupil to a point of the window. The window is the part of the sensor plane in which light is computed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.apertures.aperture import EDGE_REACH
from optics.numerics.grid import Grid
from optics.numerics.read_only import ReadOnlyArrays, read_only

__all__ = ["Slopes", "derivative"]


GROUPS = 400  # choice: number of groups of slopes in `spread`
AROUND = 16  # choice: number of points around the window to which paths are evaluated
# Differences of fourth order at the first two points of a row (Fornberg, Mathematics of Computation 51 (1988) 699,
# table 3).
AT_END = np.array([-25, 48, -36, 16, -3]) / 12
BESIDE_END = np.array([-3, -10, 18, -6, 1]) / 12


def derivative(values: np.ndarray, step: float) -> np.ndarray:
    """Return the derivative along axis 0 by differences of fourth order, also at both ends."""
    slope = np.empty_like(values)
    for place, weights in ((0, AT_END), (1, BESIDE_END)):
        slope[place] = weights @ values[:5] / step
        slope[-1 - place] = -(weights @ values[:-6:-1]) / step
    slope[2:-2] = (8 * (values[3:-1] - values[1:-3]) - values[4:] + values[:-4]) / (12 * step)
    return slope


def _total(points: np.ndarray, to: list[np.ndarray], bend: tuple[float, float]) -> np.ndarray:
    """Return |∇L + n (p - t) / D| for points p of the pupil and target points t of a plane behind it, (target, point).

    L is the optical path from the source to p, n the refractive index behind the pupil, and D the distance from p to t.

    points: rows x, y, ∂L/∂x and ∂L/∂y for the points p.
    to: x and y of the target points.
    bend: refractive index n, and distance [m] of the plane from the pupil.
    """
    x, y, px, py = points
    dx, dy = x - to[0], y - to[1]
    scale = np.float32(bend[0]) / np.sqrt(dx * dx + dy * dy + np.float32(bend[1] ** 2))
    dx, dy = px + dx * scale, py + dy * scale
    found: np.ndarray = np.sqrt(dx * dx + dy * dy)
    return found


@dataclass(frozen=True, eq=False)
class Slopes(ReadOnlyArrays):
    """Gradient of the optical path to points of a pupil, sampled on a grid over the pupil's disk and its soft edge.

    The soft edge is a ring around the disk, into which a smoothed aperture extends. A slope is the magnitude of the
    gradient, which has no unit.

    along_x, along_y: components of the gradient, arrays (y, x).
    radius: radius [m] of the disk.
    """

    grid: Grid
    along_x: np.ndarray
    along_y: np.ndarray
    radius: float

    @cached_property
    def distance_from_axis(self) -> np.ndarray:
        return read_only(np.hypot(self.grid.x[None, :], self.grid.y[:, None]))

    @cached_property
    def _squared(self) -> np.ndarray:
        return np.square(self.along_x) + np.square(self.along_y)

    @cached_property
    def steepest(self) -> float:
        """Largest magnitude of the optical path's gradient over the pupil's disk and its soft edge."""
        return math.sqrt(self._squared[self.distance_from_axis <= (1 + EDGE_REACH) * self.radius].max())

    @cached_property
    def steepest_inside(self) -> float:
        """Largest magnitude of the optical path's gradient over the pupil's disk, without its soft edge."""
        return math.sqrt(self._squared[self.distance_from_axis <= self.radius].max())

    def spread(self, margin: float, towards: tuple[Grid, float, float] | None = None) -> np.ndarray:
        """Return slopes, sorted in descending order, at points that are evenly spread over the pupil's disk.

        A slope is the magnitude of the gradient of an optical path across the pupil. The points extend beyond the
        disk's rim by a margin [radii], but not beyond the square around the disk. The slopes are sorted into groups of
        equal size, and the result contains the largest slope of each group.

        towards: window in the sensor plane, its distance [m] from the pupil, and the refractive index between them. The
            path is then the whole path through a point of the pupil to a point of the window, see `turning`. For each
            point of the pupil, the slope is an upper bound for all points of the window. None: the path ends at the
            pupil.
        """
        within = np.abs(self.grid.x) <= self.radius
        inside = (self.distance_from_axis <= (1 + margin) * self.radius) & within[:, None] & within
        along_x, along_y, more = self.along_x[inside], self.along_y[inside], 0.0
        if towards is not None:
            window, distance, medium_n = towards
            (cx, cy), reach = window.centre, window.own_half_diagonal
            x, y = (part[inside] - c for part, c in zip(np.meshgrid(self.grid.x, self.grid.y), (cx, cy), strict=True))
            scale = medium_n / np.sqrt(x * x + y * y + distance * distance)
            along_x, along_y, more = along_x + x * scale, along_y + y * scale, medium_n * reach / distance
        ordered = np.sort(np.hypot(along_x, along_y))[::-1]
        found: np.ndarray = ordered[:: max(1, len(ordered) // GROUPS)] + more
        return found

    def turning(self, distance: float, window: Grid, medium_n: float) -> tuple[float, float]:
        """Return the largest slope |∇L + n (ξ - x) / D| of paths through points ξ of the pupil to points x of a window.

        L is the optical path to ξ, D is the distance between ξ and x, and n is the index `medium_n` behind the pupil.
        The window lies in a plane at `distance` [m] from the pupil. The first value is the largest slope for points ξ
        in the pupil's disk or in the soft edge around it. The second value is for the disk alone.
        """
        soft = self.distance_from_axis <= (1 + EDGE_REACH) * self.radius
        x, y = np.broadcast_arrays(self.grid.x[None, :], self.grid.y[:, None])
        # Seven digits are enough, because SLOPE_MARGIN is much larger than their error.
        points = np.stack([part[soft].astype(np.float32) for part in (x, y, self.along_x, self.along_y)])
        # The disk is extended by one cell, to include its rim.
        inside = self.distance_from_axis[soft] <= self.radius + self.grid.dx
        (cx, cy), outermost = window.centre, window.own_half_diagonal
        angle = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
        around = [
            np.append(middle, middle + outermost * at).astype(np.float32)[:, None]
            for middle, at in ((cx, np.cos(angle)), (cy, np.sin(angle)))
        ]
        bend = medium_n, distance
        to_centre = _total(points, [at[0] for at in around], bend)
        # The slopes to two points of the window differ by at most n times the distance between these points, divided by
        # z.
        most = medium_n * outermost / distance
        found = []
        for some in (slice(None), inside):
            points, to_centre = points[:, some], to_centre[some]
            steepest = _total(points[:, [to_centre.argmax()]], around, bend).max()
            rest = points[:, to_centre + most >= steepest]
            found.append(max(steepest, _total(rest, around, bend).max(initial=0)))
        return float(found[0]), float(found[1])

    def rays(self, distance: float, medium_n: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates x and y [m] at which rays from the pupil's disk hit a plane at `distance` [m].

        There is one ray for each grid point within the disk. For an evanescent ray, x is infinite, or NaN if the slope
        along x is 0, and the same holds for y.

        medium_n: refractive index behind the pupil.
        """
        inside = self.distance_from_axis <= self.radius
        px, py = self.along_x[inside] / medium_n, self.along_y[inside] / medium_n
        axial = np.sqrt(np.maximum(1 - px**2 - py**2, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = (np.where(axial > 0, distance * p / axial, np.inf * np.sign(p)) for p in (px, py))
        here = np.broadcast_to(self.grid.x[None, :], inside.shape)[inside]
        there = np.broadcast_to(self.grid.y[:, None], inside.shape)[inside]
        return here + x, there + y
