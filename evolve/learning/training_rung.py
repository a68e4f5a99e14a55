"""One rung of a training run under successive halving."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = ["TrainingRung"]


@dataclass(frozen=True)
class TrainingRung:
    """A training run from its start to the end of one of its rungs.

    ends: number of steps at the end of each rung up to this one, ascending
    checkpoints: path of the checkpoint at each of these ends; training is repeated from the latest existing one
    """

    ends: tuple[int, ...]
    checkpoints: tuple[Path, ...]

    @property
    def number(self) -> int:
        """Number of this rung, counted from 0; `rung` in a record."""
        return len(self.ends) - 1
