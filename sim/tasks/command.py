"""The meaning of the numbers in an action, for reports and for the first actions of a learner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Command"]


@dataclass(frozen=True)
class Command:
    """One number of an action, in [-1, 1].

    name: for reports · unit: of the quantity that it commands, which is scale * (number + offset)
    """

    name: str
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0

    def quantity(self, numbers: np.ndarray) -> np.ndarray:
        """The commanded quantity, in `unit`."""
        return self.scale * (np.clip(numbers, -1, 1) + self.offset)
