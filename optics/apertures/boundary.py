"""Edge of a combination of shapes: the edges of all shapes, cut at their intersections, without the pieces that do not
separate open from closed areas.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from optics.apertures.outline import TURN, Outline

__all__ = ["Boundary", "boundary"]

SHORTEST = 1e-9  # choice, radii: pieces that are shorter are left out
ASIDE = 1e-7  # choice, radii: distance from an edge at which its sides are tested
PARALLEL = 1e-12
TOUCHING = 1e-9  # choice, squared shares: tangents count as intersections

Contains = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Boundary:
    """Pieces of an edge that separate open from closed areas.

    segments: (n, 2, 2), with the opening on their left.
    arcs: (m, 6), as in `Outline`, and 1 if the opening is on the side of their centre, else -1.
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
    """Return the boundary of the region that `contains` describes; its edges are these pieces or parts of them."""
    segments, arcs = _cut_segments(pieces), _cut_arcs(pieces)
    along = segments[:, 1] - segments[:, 0]
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    kept, flipped = _edges(segments.mean(axis=1), left, contains)
    segments[flipped] = segments[flipped][:, ::-1]
    cx, cy, radius, begin, end = arcs.T
    outward = np.column_stack([np.cos((begin + end) / 2), np.sin((begin + end) / 2)])
    middle = np.column_stack([cx, cy]) + radius[:, None] * outward
    bent, outside = _edges(middle, -outward, contains)
    signed = np.column_stack([arcs, np.where(outside, -1.0, 1.0)])
    return Boundary(segments[kept], signed[bent])


def _edges(middle: np.ndarray, left: np.ndarray, contains: Contains) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of the pieces between open and closed areas (one of each coinciding pair), and of those with the
    opening on their right.
    """
    here, there = (contains(*(middle + sign * ASIDE * left).T) for sign in (1, -1))
    kept = here != there
    _, first = np.unique(np.round(middle / ASIDE).astype(np.int64), axis=0, return_index=True)
    single = np.zeros(len(middle), dtype=bool)
    single[first] = True
    return kept & single, there & ~here


def _cut_segments(pieces: Outline) -> np.ndarray:
    found = []
    for start, end in pieces.segments:
        along = end - start
        size = float(np.hypot(*along))
        others = pieces.segments[:, 0], pieces.segments[:, 1] - pieces.segments[:, 0]
        places = [_on_lines(start, along, *others)]
        for cx, cy, radius, *_ in pieces.arcs:
            offset = start - (cx, cy)
            middle = -(offset @ along) / size**2
            rest = (radius**2 - np.sum((offset + middle * along) ** 2)) / size**2
            met = middle + np.sqrt(max(rest, 0.0)) * np.array([-1, 1])
            places.append(met if rest > -TOUCHING else np.zeros(0))
        at = _between(np.concatenate(places), 0.0, 1.0, SHORTEST / size)
        found += [(start + first * along, start + last * along) for first, last in itertools.pairwise(at)]
    return np.array(found, dtype=np.float64).reshape(-1, 2, 2)


def _on_lines(start: np.ndarray, along: np.ndarray, starts: np.ndarray, alongs: np.ndarray) -> np.ndarray:
    """Return the positions along one segment at which other segments intersect it, in shares of its length.

    Collinear segments contribute their ends.
    """
    gap = starts - start
    determinant = along[0] * alongs[:, 1] - along[1] * alongs[:, 0]
    size = float(along @ along)
    parallel = np.abs(determinant) <= PARALLEL * np.sqrt(size) * np.hypot(*alongs.T)
    safe = np.where(parallel, 1.0, determinant)
    met = (gap[:, 0] * alongs[:, 1] - gap[:, 1] * alongs[:, 0]) / safe
    off = np.abs(gap[:, 0] * along[1] - gap[:, 1] * along[0]) / np.sqrt(size)
    same = parallel & (off < ASIDE)
    return np.concatenate([met[~parallel], (gap[same] @ along) / size, ((gap + alongs)[same] @ along) / size])


def _cut_arcs(pieces: Outline) -> np.ndarray:
    found = []
    for cx, cy, radius, begin, end in pieces.arcs:
        angles = [np.zeros(0)]
        for start, last in pieces.segments:
            along, offset = last - start, start - (cx, cy)
            size = float(along @ along)
            middle = -(offset @ along) / size
            rest = (radius**2 - np.sum((offset + middle * along) ** 2)) / size
            if rest > -TOUCHING:
                points = offset + (middle + np.sqrt(max(rest, 0.0)) * np.array([[-1], [1]])) * along
                angles.append(np.arctan2(points[:, 1], points[:, 0]))
        for other_x, other_y, other, *ends in pieces.arcs:
            apart, towards = np.hypot(other_x - cx, other_y - cy), np.arctan2(other_y - cy, other_x - cx)
            if apart > PARALLEL:
                cosine = (radius**2 + apart**2 - other**2) / (2 * radius * apart)
                turns = np.array([-1, 1]) * np.arccos(np.clip(cosine, -1, 1))
                angles.append(towards + turns if abs(cosine) < 1 + TOUCHING else np.zeros(0))
            elif abs(other - radius) < ASIDE:
                angles.append(np.array(ends))
        at = begin + (np.concatenate(angles) - begin) % TURN
        at = _between(at, begin, end, SHORTEST / radius)
        found += [(cx, cy, radius, first, last) for first, last in itertools.pairwise(at)]
    return np.array(found, dtype=np.float64).reshape(-1, 5)


def _between(places: np.ndarray, low: float, high: float, shortest: float) -> np.ndarray:
    """Return both ends and the places between them, ascending and at least `shortest` apart."""
    inside = np.sort(places[(places > low + shortest) & (places < high - shortest)])
    kept = inside[np.diff(inside, prepend=low) > shortest]
    return np.concatenate([[low], kept, [high]])
