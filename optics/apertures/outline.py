"""Edge of an opening, and its crossings with lines. Integrals over the opening run along lines between crossings."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from optics.numerics.read_only import ReadOnlyArrays, read_only

__all__ = ["Outline"]

TURN = 2 * np.pi


def _none(*shape: int) -> np.ndarray:
    return np.zeros((0, *shape))


@dataclass(frozen=True, eq=False)
class Outline(ReadOnlyArrays):
    """Outline made of straight segments and arcs, with the even-odd rule.

    A point is inside if a ray from it crosses an odd number of segments and arcs.

    segments: (n, 2, 2), the two ends (x, y) of each segment.
    arcs: (n, 5), circular arcs. Each has x and y of the centre, the radius, and the first and the last angle [rad],
        with first < last <= first + 2π.
    """

    segments: np.ndarray = field(default_factory=lambda: _none(2, 2))
    arcs: np.ndarray = field(default_factory=lambda: _none(5))

    @classmethod
    def circles(cls, radii: tuple[float, ...], centre: tuple[float, float] = (0.0, 0.0)) -> Outline:
        return cls(arcs=np.array([(*centre, radius, 0.0, TURN) for radius in radii], dtype=np.float64))

    @classmethod
    def polygon(cls, vertices: np.ndarray) -> Outline:
        """Return the outline of a polygon with vertices (n, 2)."""
        return cls(np.stack([vertices, np.roll(vertices, -1, axis=0)], axis=1))

    @classmethod
    def joined(cls, outlines: list[Outline]) -> Outline:
        """Return one outline that contains the pieces of several outlines."""
        segments, arcs = ([getattr(each, name) for each in outlines] for name in ("segments", "arcs"))
        return cls(np.concatenate([_none(2, 2), *segments]), np.concatenate([_none(5), *arcs]))

    @property
    def length(self) -> float:
        _, _, radius, begin, end = self.arcs.T
        return float(np.hypot(*(self.segments[:, 1] - self.segments[:, 0]).T).sum() + (radius * (end - begin)).sum())

    @property
    def ends(self) -> np.ndarray:
        """Points (x, y) at both ends of every segment and arc, array (end, 2)."""
        cx, cy, radius, *angles = self.arcs.T
        return np.concatenate(
            [self.segments.reshape(-1, 2)]
            + [np.column_stack([cx + radius * np.cos(at), cy + radius * np.sin(at)]) for at in angles]
        )

    def clearance(self, points: np.ndarray, least: float) -> np.ndarray:
        """Return the distance (n,) of each point (n, 2) from the outline.

        Segments and arcs that are at most `least` away from a point are ignored.
        """
        x, y = points.T
        found = np.full(len(points), np.inf)
        ends = self.ends
        for start, end in self.segments:
            along = end - start
            share = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / (along @ along), 0, 1)
            off = np.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1])
            found = np.where(off > least, np.minimum(found, off), found)
        for cx, cy, radius, begin, end in self.arcs:
            within = (np.arctan2(y - cy, x - cx) - begin) % TURN < end - begin
            off = np.abs(np.hypot(x - cx, y - cy) - radius)
            found = np.where(within & (off > least), np.minimum(found, off), found)
        for end_x, end_y in ends[2 * len(self.segments) :]:
            off = np.hypot(x - end_x, y - end_y)
            found = np.where(off > least, np.minimum(found, off), found)
        return found

    def points(self, apart: float = 0.01) -> np.ndarray:
        """Return points (n, 2) along the outline at distances of about `apart`."""
        found = []
        for start, end in self.segments:
            n = max(1, round(float(np.hypot(*(end - start))) / apart))
            found.append(start + (end - start) * ((np.arange(n) + 0.5) / n)[:, None])
        for cx, cy, radius, begin, end in self.arcs:
            n = max(1, round(radius * (end - begin) / apart))
            angle = begin + (end - begin) * (np.arange(n) + 0.5) / n
            found.append(np.column_stack([cx + radius * np.cos(angle), cy + radius * np.sin(angle)]))
        return np.concatenate(found)

    def crossings(self, y: np.ndarray) -> np.ndarray:
        """Return the ascending positions x at which the edge crosses horizontal lines, array (line, crossing).

        All lines must cross the same segments and arcs. No segment or arc may therefore end, and no arc may have its
        highest or lowest point, at a height between the lines.

        y: heights of the lines, (line,)
        """
        y = np.asarray(y, dtype=np.float64)
        middle = float(y.mean())
        found = []
        reached = np.abs(y - self.arcs[:, 1, None]).max(axis=1) < self.arcs[:, 2]
        cx, cy, radius, begin, end = self.arcs[reached].T[..., None]
        half, reach = np.sqrt(radius**2 - (y - cy) ** 2), np.sqrt(radius**2 - (middle - cy) ** 2)
        for side in (-1, 1):
            angle = np.arctan2(middle - cy, side * reach)
            on_arc = ((angle - begin) % TURN < end - begin) | (end - begin >= TURN)
            found += list((cx + side * half)[on_arc[:, 0]])
        (x0, y0), (x1, y1) = (self.segments[:, k].T for k in (0, 1))
        crossed = (np.minimum(y0, y1) < middle) & (middle < np.maximum(y0, y1))
        x0, y0, x1, y1 = (end[crossed, None] for end in (x0, y0, x1, y1))
        found += list(x0 + (y - y0) * (x1 - x0) / (y1 - y0))
        return np.sort(np.array(found).reshape(-1, len(y)).T, axis=1)

    def heights(self, x: float) -> np.ndarray:
        """Return the heights y at which the edge crosses the vertical line at x. They are not sorted."""
        found = []
        for cx, cy, radius, begin, end in self.arcs:
            if abs(x - cx) < radius:
                half = np.sqrt(radius**2 - (x - cx) ** 2)
                sides = [side for side in (-1, 1) if _within(np.arctan2(side * half, x - cx), begin, end)]
                found += [cy + side * half for side in sides]
        for start, end in self.segments:
            if min(start[0], end[0]) < x < max(start[0], end[0]):
                found.append(start[1] + (x - start[0]) * (end[1] - start[1]) / (end[0] - start[0]))
        return np.array(found, dtype=np.float64)

    @cached_property
    def turning(self) -> np.ndarray:
        """Heights y of the ends of all segments and arcs, and of the highest and lowest points of arcs.

        All horizontal lines between two successive heights cross the same segments and arcs.
        """
        _, cy, radius, begin, end = self.arcs.T
        corners = [cy + radius * np.sin(begin), cy + radius * np.sin(end)]
        tops = [
            (cy + side * radius)[[_within(side * np.pi / 2, *ends) for ends in zip(begin, end, strict=True)]]
            for side in (-1, 1)
            if len(cy)
        ]
        return read_only(np.concatenate([self.segments[:, :, 1].ravel(), *corners, *tops]))

    @cached_property
    def tangent(self) -> np.ndarray:
        """Heights of the highest and the lowest points of the circles of which the outline's arcs are parts.

        They are included even if an arc does not extend to the highest or lowest point of its circle.

        Near such a height, the position x at which an arc crosses a horizontal line changes with the height of the line
        like a square root.
        """
        _, cy, radius, _, _ = self.arcs.T
        return read_only(np.unique(np.concatenate([cy - radius, cy + radius])))

    def near(self, x: np.ndarray, y: np.ndarray, half: float) -> np.ndarray:
        """Return a mask of the squares that the edge may cut. The squares have the half side `half` and centres (x, y).

        The mask contains all squares that the edge cuts, and few others.
        """
        cut = np.zeros(np.broadcast(x, y).shape, dtype=bool)
        for cx, cy, radius, _, _ in self.arcs:
            across, along = np.abs(x - cx), np.abs(y - cy)
            nearest = np.hypot(np.maximum(across - half, 0), np.maximum(along - half, 0))
            cut |= (nearest < radius) & (radius < np.hypot(across + half, along + half))
        for start, end in self.segments:
            along = end - start
            place = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / (along @ along), 0, 1)
            off = np.hypot(x - start[0] - place * along[0], y - start[1] - place * along[1])
            cut |= off < 1.5 * half  # half the diagonal is 1.42 half
        return cut


def _within(angle: float, begin: float, end: float) -> bool:
    """Return whether an angle [rad] lies on the arc from `begin` to `end`, modulo 2π."""
    return bool((angle - begin) % TURN < end - begin or end - begin >= TURN)
