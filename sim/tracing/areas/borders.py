"""Left and right borders of areas, the rectangles of the visual field over which light is averaged.

Areas of an eye that lie next to each other or above each other have borders in common. The wall that is visible at a
border is found once for all these areas.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PARTS = 64  # borders closer to each other than an area's width / PARTS are merged


@dataclass(frozen=True)
class Borders:
    """Left and right borders of areas, the rectangles of the visual field over which light is averaged.

    Borders at almost the same horizontal position count as one border, which several areas share.

    x: horizontal positions of the borders on the eye's tangent plane at distance 1, (border,)
    sides: indices in `x` of each area's left and right border, (area, left or right)
    """

    x: np.ndarray
    sides: np.ndarray

    @classmethod
    def from_middles(cls, middles: np.ndarray, width: float) -> Borders:
        """Return the borders of areas of equal width around the positions `middles`, (area,)."""
        edges = np.stack([middles - width / 2, middles + width / 2], axis=-1)
        _, first, sides = np.unique(np.rint(edges * (PARTS / width)), return_index=True, return_inverse=True)
        return cls(edges.ravel()[first], sides.reshape(edges.shape))

    @property
    def shared(self) -> bool:
        """True if there are fewer borders than areas (rectangles of the visual field), because areas share borders.

        In this case, it saves work to find the wall at each border once, for all areas that share the border.
        """
        return len(self.x) < len(self.sides)

    @property
    def directions(self) -> np.ndarray:
        """Horizontal directions to the left and right borders of areas, in the eye's frame, (border, 3)."""
        return np.stack([self.x, np.zeros_like(self.x), np.ones_like(self.x)], axis=-1)
