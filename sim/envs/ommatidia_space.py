"""Space of the signals of a compound eye, which knows the viewing directions of the ommatidia."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from optics.numerics.read_only import read_only


class OmmatidiaBox(spaces.Box):
    """A box of signals (memory, ommatidium, channel).

    directions: viewing directions of the ommatidia in the frame of their mount, unit vectors (ommatidium, 3)
    """

    def __init__(self, low: float, high: float, shape: tuple[int, ...], directions: np.ndarray) -> None:
        super().__init__(low, high, shape, np.float32)
        self.directions = read_only(directions)

    def __eq__(self, other: Any) -> bool:
        return super().__eq__(other) and np.array_equal(self.directions, getattr(other, "directions", None))
