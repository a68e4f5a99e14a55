"""One stage of a training that is carried on while it is promising."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = ["TrainingStage"]


@dataclass(frozen=True)
class TrainingStage:
    """A training from its beginning to one of its rungs.

    budgets: steps trained at the end of this rung, and of each below it, ascending
    checkpoints: where the training is kept as it stands at each of them; those that are missing are trained again
    """

    budgets: tuple[int, ...]
    checkpoints: tuple[Path, ...]

    @property
    def rung(self) -> int:
        return len(self.budgets) - 1
