"""The meaning of the numbers in an action, for reports and for a learner's initial actions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Command"]


@dataclass(frozen=True)
class Command:
    """Meaning of one number of an action. The number lies in [-1, 1].

    The commanded quantity is scale * (number + offset).

    name: name of the quantity in reports
    unit: unit of the quantity
    """

    name: str
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0

    def quantity(self, numbers: np.ndarray) -> np.ndarray:
        """Return the commanded quantity in `unit` for these numbers, which are first limited to [-1, 1]."""
        return self.scale * (np.clip(numbers, -1, 1) + self.offset)
