"""Observation space of a compound eye's signals. It also stores the viewing directions of the ommatidia."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from optics.numerics.read_only import read_only


class OmmatidiaBox(spaces.Box):
    """Gymnasium space for the signals of a compound eye: a `Box` with the axes (frame in memory, ommatidium, channel).

    directions: viewing directions of the ommatidia, unit vectors (ommatidium, 3), see `CompoundEye.directions_on`
    """

    def __init__(self, low: float, high: float, shape: tuple[int, ...], directions: np.ndarray) -> None:
        super().__init__(low, high, shape, np.float32)
        self.directions = read_only(directions)

    def __eq__(self, other: Any) -> bool:
        same = isinstance(other, OmmatidiaBox) and super().__eq__(other)
        return same and np.array_equal(self.directions, other.directions)
