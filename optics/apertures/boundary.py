"""Edge of a combination of shapes.

The edges of all shapes are cut into pieces at their intersections. A piece belongs to the edge of the combination if it
separates an open area from a closed one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.spatial import KDTree

from optics.apertures.outline import TURN, Outline

__all__ = ["Boundary", "boundary"]

SHORTEST = 1e-9  # choice, radii: shorter pieces are ignored
COINCIDENT = 1e-11  # choice, radii: edges that are closer together count as one; rounding moves edges by 1e-15
NEIGHBOURS = 1e-10  # choice, radii: pieces coincide only if their middles are closer together than this
ASIDE = 1e-7  # choice, radii: an edge's two sides are tested at points at most this far from it
PARALLEL = 1e-12
# Choices for the final check along lines: the position on a piece at which its line crosses it, and the largest
# number of lines.
ALONG, MOST_LINES = 0.3819660, 200
NARROW = 1e-6  # choice, radii: narrower gaps are not compared with `contains`
TOUCHING = 1e-9  # choice, relative square of a gap: closer edges count as touching; a superfluous cut does no harm

Contains = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Boundary:
    """The edge of an opening, in pieces: straight segments and circular arcs.

    segments: (n, 2, 2), straight pieces, with the opening on their left.
    arcs: (m, 6), for each arc x and y of the centre, the radius, the first and the last angle [rad], and 1 if the
        opening lies on the side of the arc's centre, else -1.
    """

    segments: np.ndarray
    arcs: np.ndarray

    @property
    def outline(self) -> Outline:
        return Outline(self.segments, self.arcs[:, :5])

    @property
    def area(self) -> float:
        """Enclosed area by Green's theorem, ∮ (x dy - y dx)/2."""
        (x0, y0), (x1, y1) = (self.segments[:, k].T for k in (0, 1))
        cx, cy, radius, begin, end, side = self.arcs.T
        turns = radius * (end - begin) + cx * (np.sin(end) - np.sin(begin)) - cy * (np.cos(end) - np.cos(begin))
        return float(np.sum(x0 * y1 - x1 * y0) + np.sum(side * radius * turns)) / 2

    @property
    def half_widths(self) -> tuple[float, float]:
        found = []
        for axis, turned in ((0, 0.0), (1, pi / 2)):
            reached = np.abs(self.segments[:, :, axis]).ravel()
            centre, radius, begin, end = self.arcs[:, axis], *self.arcs[:, 2:5].T
            ends = [np.abs(centre + radius * np.cos(at - turned)) for at in (begin, end)]
            sides = [
                np.where((turned + half * pi - begin) % TURN < end - begin, np.abs(centre + sign * radius), 0.0)
                for half, sign in ((0, 1), (1, -1))
            ]
            found.append(float(np.concatenate([reached, *ends, *sides]).max(initial=0.0)))
        return found[0], found[1]


def boundary(pieces: Outline, contains: Contains) -> Boundary:
    """Return the boundary of the region that `contains` describes.

    pieces: edges of all shapes that are combined to the region. The boundary consists of parts of these edges.
    contains: function that returns a mask of the points (x, y) in the region.

    Raises:
        ValueError: two edges almost coincide, so that the boundary cannot be computed.
    """
    points = _meeting_points(pieces)
    segments, arcs = _cut_segments(pieces, points), _cut_arcs(pieces, points)
    along = segments[:, 1] - segments[:, 0]
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    kept, flipped = _edges(segments.mean(axis=1), left, pieces, contains)
    segments[flipped] = segments[flipped][:, ::-1]
    cx, cy, radius, begin, end = arcs.T
    outward = np.column_stack([np.cos((begin + end) / 2), np.sin((begin + end) / 2)])
    middle = np.column_stack([cx, cy]) + radius[:, None] * outward
    bent, outside = _edges(middle, -outward, pieces, contains)
    signed = np.column_stack([arcs, np.where(outside, -1.0, 1.0)])
    found = Boundary(segments[kept], signed[bent])
    _check(found.outline, pieces, contains)
    return found


def _check(outline: Outline, pieces: Outline, contains: Contains) -> None:
    """Compare the computed outline of an opening with `contains`, along at most 400 horizontal lines.

    The area and the quadrature follow from the outline alone. Without this comparison, a shape that is missing in the
    outline would remain unnoticed.

    pieces: edges of all shapes that are combined to the opening. The lines cross these edges.
    contains: see `boundary`.

    Raises:
        ValueError: outline and `contains` differ at a tested point. Gaps narrower than NARROW are not tested.
    """
    heights = np.concatenate(
        [pieces.segments[:, 0, 1] * ALONG + pieces.segments[:, 1, 1] * (1 - ALONG)]
        + [pieces.arcs[:, 1] + side * ALONG * pieces.arcs[:, 2] for side in (-1, 1)]
    )
    corners = np.unique(np.concatenate([pieces.turning, outline.turning, [-1.0, 1.0]]))
    nearest = np.abs(
        corners[np.clip(np.searchsorted(corners, heights) + np.array([[-1], [0]]), 0, len(corners) - 1)] - heights
    )
    heights = heights[(np.abs(heights) < 1) & (nearest.min(axis=0) > NARROW)]
    for y in heights[:: max(1, len(heights) // MOST_LINES)]:
        ends = np.concatenate([[-1.0], outline.crossings(np.array([y]))[0], [1.0]])
        middle, inside = ends[:-1] + ALONG * np.diff(ends), np.arange(len(ends) - 1) % 2 == 1
        wrong = (contains(middle, np.full(len(middle), y)) != inside) & (np.diff(ends) > NARROW)
        if wrong.any():
            raise ValueError(
                f"shapes: their common outline cannot be computed near ({middle[wrong][0]:.6g}, {y:.6g}), where edges "
                "almost coincide: move one of them by 1e-6 or more"
            )


def _edges(middle: np.ndarray, left: np.ndarray, pieces: Outline, contains: Contains) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of the pieces on the boundary of an opening, and of the pieces with the opening on their right.

    A piece is a part of an edge of a shape. Pieces of the boundary lie between open and closed areas. If several
    pieces coincide, only the first is kept.

    middle, left: midpoints of the pieces, and unit normals that point to their left, (n, 2) each.

    Both sides of a piece are tested at points that are closer to this piece than to any other edge. The test therefore
    works for gaps as narrow as COINCIDENT.
    """
    aside = np.minimum(ASIDE, pieces.clearance(middle, COINCIDENT) / 2)[:, None]
    here, there = (contains(*(middle + sign * aside * left).T) for sign in (1, -1))
    return (here != there) & _first_of_coincident(middle, left), there & ~here


def _first_of_coincident(middle: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Return a mask (n,) of the pieces of edges that do not coincide with an earlier piece.

    middle, left: midpoints of the pieces, and unit normals that point to their left, (n, 2) each.
    """
    first = np.ones(len(middle), dtype=bool)
    if len(middle):
        pairs = KDTree(middle).query_pairs(NEIGHBOURS, output_type="ndarray")
        apart = np.sum((middle[pairs[:, 0]] - middle[pairs[:, 1]]) * left[pairs[:, 0]], axis=1)
        first[pairs[np.abs(apart) <= COINCIDENT, 1]] = False
    return first


def _cut_segments(pieces: Outline, points: np.ndarray) -> np.ndarray:
    """Return the segments (n, 2, 2), cut at the points that lie on them."""
    found = []
    by_axis = [points[np.argsort(points[:, axis], kind="stable")] for axis in (0, 1)]
    for start, end in pieces.segments:
        along = end - start
        size = float(np.hypot(*along))
        near = _near_segment(by_axis, start, end)
        on_line = np.abs((near - start) @ (-along[1], along[0])) / size < COINCIDENT
        at = _between((near[on_line] - start) @ along / size**2, 0.0, 1.0, SHORTEST / size)
        found += [(start + first * along, start + last * along) for first, last in itertools.pairwise(at)]
    return np.array(found, dtype=np.float64).reshape(-1, 2, 2)


def _near_segment(by_axis: list[np.ndarray], start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the points (n, 2) that may lie on a segment.

    Only one coordinate is compared with the segment: the one along which the segment is shorter.

    by_axis: all points sorted by x, and all points sorted by y.
    """
    axis = int(abs(end[1] - start[1]) < abs(end[0] - start[0]))
    low, high = sorted((start[axis], end[axis]))
    first, last = np.searchsorted(by_axis[axis][:, axis], (low - SHORTEST, high + SHORTEST))
    return by_axis[axis][first:last]


def _cut_arcs(pieces: Outline, points: np.ndarray) -> np.ndarray:
    """Return the arcs (n, 5), cut at the points that lie on them."""
    found = []
    for cx, cy, radius, begin, end in pieces.arcs:
        x, y = (points - (cx, cy)).T
        on_circle = np.abs(np.hypot(x, y) - radius) < COINCIDENT
        at = begin + (np.arctan2(y[on_circle], x[on_circle]) - begin) % TURN
        at = _between(at, begin, end, SHORTEST / radius)
        found += [(cx, cy, radius, first, last) for first, last in itertools.pairwise(at)]
    return np.array(found, dtype=np.float64).reshape(-1, 5)


def _meeting_points(pieces: Outline) -> np.ndarray:
    """Return all points (n, 2) at which the lines and circles of the pieces intersect, and the ends of the pieces.

    Each point is computed once and cuts both pieces. If two edges almost coincide, the position of their intersection
    is ill-conditioned. If this position were computed separately for each of the two edges, the results could differ
    and leave a gap in the outline.
    """
    found = [pieces.ends]
    low, high = pieces.segments.min(axis=1) - SHORTEST * 2, pieces.segments.max(axis=1) + SHORTEST * 2
    for number, (start, end) in enumerate(pieces.segments):
        overlap = (low[number + 1 :] <= high[number]) & (high[number + 1 :] >= low[number])
        later = pieces.segments[number + 1 :][overlap.all(axis=1)]
        found.append(_of_lines(start, end - start, later[:, 0], later[:, 1] - later[:, 0]))
        found += [_of_line_and_circle(start, end - start, arc) for arc in pieces.arcs]
    for arc, other in itertools.combinations(pieces.arcs, 2):
        found.append(_of_circles(arc, other))
    return np.concatenate(found)


def _of_lines(start: np.ndarray, along: np.ndarray, starts: np.ndarray, alongs: np.ndarray) -> np.ndarray:
    """Return the points (n, 2) at which a segment intersects others.

    Each segment is given by its start and the vector from there to its end.
    """
    gap = starts - start
    determinant = along[0] * alongs[:, 1] - along[1] * alongs[:, 0]
    crossing = np.abs(determinant) > PARALLEL * np.hypot(*along) * np.hypot(*alongs.T)
    own, other = (
        (gap[:, 0] * by[:, 1] - gap[:, 1] * by[:, 0])[crossing] / determinant[crossing]
        for by in (alongs, np.broadcast_to(along, alongs.shape))
    )
    within = (np.abs(own - 0.5) < 0.5 + SHORTEST) & (np.abs(other - 0.5) < 0.5 + SHORTEST)
    return np.asarray(start + own[within, None] * along)


def _of_line_and_circle(start: np.ndarray, along: np.ndarray, arc: np.ndarray) -> np.ndarray:
    """Return the points (n, 2) at which the infinite line through a segment intersects the circle of an arc.

    The segment is given by its start and the vector `along` from there to its end.
    """
    offset, size = start - arc[:2], float(along @ along)
    middle = -(offset @ along) / size
    rest = (arc[2] ** 2 - np.sum((offset + middle * along) ** 2)) / size
    if rest <= -TOUCHING:
        return np.zeros((0, 2))
    return np.asarray(start + (middle + np.sqrt(max(rest, 0.0)) * np.array([[-1], [1]])) * along)


def _of_circles(arc: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the points (n, 2) at which the circles of two arcs intersect."""
    towards = other[:2] - arc[:2]
    apart = float(np.hypot(*towards))
    if apart <= PARALLEL:
        return np.zeros((0, 2))
    cosine = (arc[2] ** 2 + apart**2 - other[2] ** 2) / (2 * arc[2] * apart)
    if abs(cosine) >= 1 + TOUCHING:
        return np.zeros((0, 2))
    cosine = min(max(cosine, -1.0), 1.0)
    ahead, across = towards / apart, np.array([-towards[1], towards[0]]) / apart
    sine = np.sqrt(1 - cosine**2) * np.array([[-1], [1]])
    return np.asarray(arc[:2] + arc[2] * (cosine * ahead + sine * across))


def _between(places: np.ndarray, low: float, high: float, shortest: float) -> np.ndarray:
    """Return `low`, `high` and the places between them, in ascending order.

    Places at a distance of at most `shortest` from `low` or `high` are omitted. Of the others, a place is also omitted
    if its distance from the next lower one is at most `shortest`.
    """
    inside = np.sort(places[(places > low + shortest) & (places < high - shortest)])
    kept = inside[np.diff(inside, prepend=low) > shortest]
    return np.concatenate([[low], kept, [high]])
