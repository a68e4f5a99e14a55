"""One stage of a training that is carried on while it is promising."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = ["TrainingStage"]


@dataclass(frozen=True)
class TrainingStage:
    """A training from its beginning to the end of one of its stages.

    ends: steps trained at the end of each stage up to this one, ascending
    checkpoints: where the training is kept as it stands at each of these ends; those that are missing are trained again
    """

    ends: tuple[int, ...]
    checkpoints: tuple[Path, ...]

    @property
    def number(self) -> int:
        """Of this stage, 0 the first: the `rung` of a record."""
        return len(self.ends) - 1
