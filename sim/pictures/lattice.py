"""A lattice of every fifth pixel. Neighbours in the lattice are a knight's move apart.

Except at the border of the image, every pixel outside the lattice is adjacent to exactly one lattice pixel. In every
horizontal, vertical or diagonal line of pixels, each fifth pixel belongs to the lattice, so no such line can pass
between lattice pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PERIOD = 5
_CROSS = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))


@dataclass(frozen=True)
class Lattice:
    """The subset of an image's pixels that is traced first: every fifth pixel, and some pixels at the border.

    size: size of the image (height, width)
    pixels: indices of the subset's pixels in the image, (n,). First come every fifth pixel, row by row, and then the
        border pixels that are not adjacent to any pixel of this first group.
    nearest: for each pixel of the image, the index in `pixels` of the subset's nearest pixel, (height · width,)
    pairs: pairs of pixels that are neighbours in the lattice, as indices in `pixels`, (2, m)
    """

    size: tuple[int, int]
    pixels: np.ndarray
    nearest: np.ndarray
    pairs: np.ndarray

    @staticmethod
    def for_size(size: tuple[int, int]) -> Lattice:
        """Return the lattice of an image of this size."""
        y, x = np.indices(size)
        place = np.full(size, -1)
        chosen = (x + 3 * y) % PERIOD == 0
        place[chosen] = np.arange(chosen.sum())
        nearest = np.maximum.reduce([_shifted(place, dx, dy) for dx, dy in _CROSS])
        alone = nearest < 0
        nearest[alone] = chosen.sum() + np.arange(alone.sum())
        pixels = np.concatenate([np.flatnonzero(chosen), np.flatnonzero(alone)])
        # If two adjacent pixels have different nearest lattice pixels, these two are neighbours in the lattice, also at
        # the border.
        beside = [(nearest[:, 1:], nearest[:, :-1]), (nearest[1:], nearest[:-1])]
        pairs = np.concatenate([np.stack([a.ravel(), b.ravel()]) for a, b in beside], axis=1)
        pairs = np.unique(np.sort(pairs[:, pairs[0] != pairs[1]], axis=0), axis=1)
        return Lattice(size, pixels, nearest.ravel(), pairs)

    def between(self, differ: np.ndarray) -> np.ndarray:
        """Return the indices of pixels that may lie on an edge and do not belong to the lattice.

        The lattice consists of every fifth pixel, and of some pixels at the border. A lattice pixel may be near an
        edge if it differs in colour from a neighbour in the lattice. The result contains the pixels whose nearest
        lattice pixel does so.

        differ: True for the pairs of neighbouring lattice pixels (`pairs`) whose colours differ, (pair,)
        """
        rough = np.zeros(len(self.pixels), bool)
        rough[self.pairs[:, differ]] = True
        wanted = rough[self.nearest]
        wanted[self.pixels] = False
        return np.flatnonzero(wanted)


def _shifted(place: np.ndarray, dx: int, dy: int) -> np.ndarray:
    """Return the array whose entry (y, x) is place[y + dy, x + dx], or -1 beyond the border."""
    height, width = place.shape
    padded = np.pad(place, 1, constant_values=-1)
    return padded[1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]
