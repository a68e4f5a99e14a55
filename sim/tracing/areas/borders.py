"""Borders of columns: what stands there is found once for all areas of an eye that share one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PARTS = 64  # of an area's width: borders that lie closer are one


@dataclass(frozen=True)
class Borders:
    """x: on the tangent plane at distance 1, (border,) · sides: number of each area's left and right one, (area, 2)"""

    x: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, middles: np.ndarray, width: float) -> Borders:
        """Of areas of one width around these x."""
        edges = np.stack([middles - width / 2, middles + width / 2], axis=-1)
        _, first, sides = np.unique(np.rint(edges * (PARTS / width)), return_index=True, return_inverse=True)
        return cls(edges.ravel()[first], sides.reshape(edges.shape))

    @property
    def shared(self) -> bool:
        """Whether it pays: where they are fewer than the areas."""
        return len(self.x) < len(self.sides)

    @property
    def directions(self) -> np.ndarray:
        """Level ones, in the eye's frame, (border, 3)."""
        return np.stack([self.x, np.zeros_like(self.x), np.ones_like(self.x)], axis=-1)
