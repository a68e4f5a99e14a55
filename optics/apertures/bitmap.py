"""Openings drawn as images of zeros and ones."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.apertures.outline import Outline
from optics.numerics.arguments import reals
from optics.numerics.read_only import ReadOnlyArrays

__all__ = ["Bitmap"]

MOST = 512  # choice: largest number of pixels along a side
MOST_EDGES = 4000  # choice: an outline of this many straight edges takes about five seconds


@dataclass(frozen=True, eq=False)
class Bitmap(ReadOnlyArrays):
    """A shape made of the open pixels of a square image: `union(Bitmap(image))` is the aperture.

    The pixels fill the square [-1, 1]² in pupil radii, and their edges are exact. `union` cuts the shape off at the
    pupil's circle, so pixels are closed where they lie outside the circle.

    image: array (y, x) of n x n pixels, 1 or True in open pixels, 0 or False in closed ones. y ascends with the row.

    Raises:
        ValueError: image is not square, has more than 512 pixels along a side or more than 4,000 edges, or contains a
            value other than 0 and 1.
    """

    image: Any

    def __post_init__(self) -> None:
        image = reals("image", self.image)
        if image.ndim != 2 or image.shape[0] != image.shape[1] or not 1 <= len(image) <= MOST:
            raise ValueError(f"image has shape {image.shape}: must be square (n, n), n from 1 to {MOST}")
        if not np.isin(image, (0, 1)).all():
            other = float(image[~np.isin(image, (0, 1))][0])
            raise ValueError(f"image holds {other:g}: must be 0 or 1; use a MaskMap for amplitudes in between")
        object.__setattr__(self, "image", image == 1)
        super().__post_init__()
        edges = len(self.outline.segments)
        if edges > MOST_EDGES:
            raise ValueError(f"image has {edges} straight edges: must be at most {MOST_EDGES}; draw it more coarsely")

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a mask of the points (x, y) [pupil radii] in open pixels; ValueError if x or y is not real."""
        n = len(self.image)
        column, row = (np.floor((reals(name, at) + 1) * (n / 2)).astype(int) for name, at in (("x", x), ("y", y)))
        inside = (row >= 0) & (row < n) & (column >= 0) & (column < n)
        return np.asarray(inside & self.image[np.clip(row, 0, n - 1), np.clip(column, 0, n - 1)])

    @cached_property
    def outline(self) -> Outline:
        """Straight edges between open and closed pixels."""
        along_x = _runs(self.image)
        along_y = _runs(self.image.T)[:, :, ::-1]
        return Outline(np.concatenate([along_x, along_y]))


def _runs(image: np.ndarray) -> np.ndarray:
    """Return the edges along x between open and closed pixels, as positions (x, y) of their ends, array (edge, end, 2).

    Adjoining edges are merged.
    """
    n = len(image)
    # Between rows, (n + 1, n): 1 if only the row at larger y is open, -1 if only the other one is.
    changes = np.diff(np.pad(image, ((1, 1), (0, 0))).astype(int), axis=0)
    found = []
    for line, change in enumerate(changes):
        starts = np.flatnonzero(np.diff(change, prepend=0, append=0))
        for first, last in itertools.pairwise(starts):
            if change[first]:
                found.append([[first, line], [last, line]])
    return np.array(found, dtype=np.float64).reshape(-1, 2, 2) * (2 / n) - 1
