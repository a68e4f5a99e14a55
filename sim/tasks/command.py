"""The meaning of the numbers in an action, for reports and for a learner's initial actions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Command"]


@dataclass(frozen=True)
class Command:
    """One number of an action, in [-1, 1].

    name: name in reports
    unit: unit of the commanded quantity, which is scale * (number + offset)
    """

    name: str
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0

    def quantity(self, numbers: np.ndarray) -> np.ndarray:
        """Return the commanded quantity, in `unit`."""
        return self.scale * (np.clip(numbers, -1, 1) + self.offset)
