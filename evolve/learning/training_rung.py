"""One rung of a training run under successive halving."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = ["TrainingRung"]


@dataclass(frozen=True)
class TrainingRung:
    """A training run from its start to the end of one of its rungs (the parts into which it is divided).

    ends: number of training steps at the end of each rung up to this rung, in ascending order
    checkpoints: path of the checkpoint at the end of each of these rungs; training continues from the latest checkpoint
        that exists
    """

    ends: tuple[int, ...]
    checkpoints: tuple[Path, ...]

    @property
    def number(self) -> int:
        """Number of this rung, counted from 0; it is the value `rung` in a record."""
        return len(self.ends) - 1
