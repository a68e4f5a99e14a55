"""The edge of an opening: where lines cross it, so that quadrature can end exactly there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Outline"]


@dataclass(frozen=True, eq=False)
class Outline:
    """Circles about the axis and the sides of one polygon, by the even-odd rule: a point is inside if a ray from it
    crosses an odd number of them.

    radii: of the circles. vertices: of the polygon, (n, 2), none if empty.
    """

    radii: tuple[float, ...] = ()
    vertices: np.ndarray | None = None

    def crossings(self, y: np.ndarray) -> np.ndarray:
        """x where the edge crosses the horizontal lines at `y`, ascending: (line, crossing). As many for all lines:
        no `turning` height may lie between them."""
        y = np.asarray(y, dtype=np.float64)
        found = []
        for radius in self.radii:
            if abs(y).max() < radius:
                half = np.sqrt(radius**2 - y**2)
                found += [-half, half]
        for start, end in self._sides:
            if min(start[1], end[1]) < y.mean() < max(start[1], end[1]):
                found.append(start[0] + (y - start[1]) * (end[0] - start[0]) / (end[1] - start[1]))
        return np.sort(np.array(found).reshape(-1, len(y)).T, axis=1)

    def heights(self, x: float) -> np.ndarray:
        """y where the edge crosses the vertical line at x."""
        found = [side * np.sqrt(r**2 - x**2) for r in self.radii if abs(x) < r for side in (-1, 1)]
        for start, end in self._sides:
            if min(start[0], end[0]) < x < max(start[0], end[0]):
                found.append(start[1] + (x - start[0]) * (end[1] - start[1]) / (end[0] - start[0]))
        return np.array(found, dtype=np.float64)

    @property
    def turning(self) -> np.ndarray:
        """Heights at which crossings begin and end, or turn a corner."""
        circles = [side * radius for radius in self.radii for side in (-1, 1)]
        return np.array([*circles, *(() if self.vertices is None else self.vertices[:, 1])], dtype=np.float64)

    @property
    def tangent(self) -> np.ndarray:
        """Those of them at which crossings set off like a square root."""
        return np.array([side * radius for radius in self.radii for side in (-1, 1)], dtype=np.float64)

    def near(self, x: np.ndarray, y: np.ndarray, half: float) -> np.ndarray:
        """Whether squares of half a side `half` about points (x, y) may be cut by the edge: all that are, and few that
        are not."""
        cut = np.zeros(np.broadcast(x, y).shape, dtype=bool)
        nearest = np.hypot(np.maximum(np.abs(x) - half, 0), np.maximum(np.abs(y) - half, 0))
        farthest = np.hypot(np.abs(x) + half, np.abs(y) + half)
        for radius in self.radii:
            cut |= (nearest < radius) & (radius < farthest)
        for start, end in self._sides:
            along = end - start
            place = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / (along @ along), 0, 1)
            off = np.hypot(x - start[0] - place * along[0], y - start[1] - place * along[1])
            cut |= off < 1.5 * half  # its diagonal is 1.42 long
        return cut

    @property
    def _sides(self) -> list[tuple[np.ndarray, np.ndarray]]:
        if self.vertices is None:
            return []
        return list(zip(self.vertices, np.roll(self.vertices, -1, axis=0), strict=True))
