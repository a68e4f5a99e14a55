"""Every fifth pixel, a knight's move apart: each of the others lies beside, above or below just one of them.

No line of pixels, level, upright or diagonal, passes between these: each has every fifth of its own among them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PERIOD = 5
_CROSS = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))


@dataclass(frozen=True)
class Lattice:
    """size: of the picture (height, width)
    pixels: those of the lattice, counted row by row, and those at the border that none of them touches, (n,)
    nearest: which of these is nearest to each pixel, (height · width,)
    pairs: of neighbours in the lattice, as places in `pixels`, (2, m)
    """

    size: tuple[int, int]
    pixels: np.ndarray
    nearest: np.ndarray
    pairs: np.ndarray

    @staticmethod
    def of(size: tuple[int, int]) -> Lattice:
        """That of a picture of this size."""
        y, x = np.indices(size)
        place = np.full(size, -1)
        chosen = (x + 3 * y) % PERIOD == 0
        place[chosen] = np.arange(chosen.sum())
        nearest = np.maximum.reduce([_shifted(place, dx, dy) for dx, dy in _CROSS])
        alone = nearest < 0
        nearest[alone] = chosen.sum() + np.arange(alone.sum())
        pixels = np.concatenate([np.flatnonzero(chosen), np.flatnonzero(alone)])
        # Pixels side by side whose nearest ones differ: these are neighbours, also where the border cuts the lattice.
        beside = [(nearest[:, 1:], nearest[:, :-1]), (nearest[1:], nearest[:-1])]
        pairs = np.concatenate([np.stack([a.ravel(), b.ravel()]) for a, b in beside], axis=1)
        pairs = np.unique(np.sort(pairs[:, pairs[0] != pairs[1]], axis=0), axis=1)
        return Lattice(size, pixels, nearest.ravel(), pairs)

    def between(self, differ: np.ndarray) -> np.ndarray:
        """Pixels about those that differ from a neighbour, without these; differ: of pairs, (m,)."""
        rough = np.zeros(len(self.pixels), bool)
        rough[self.pairs[:, differ]] = True
        wanted = rough[self.nearest]
        wanted[self.pixels] = False
        return np.flatnonzero(wanted)


def _shifted(place: np.ndarray, dx: int, dy: int) -> np.ndarray:
    """place at (x + dx, y + dy), -1 beyond the border."""
    height, width = place.shape
    padded = np.pad(place, 1, constant_values=-1)
    return padded[1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]
