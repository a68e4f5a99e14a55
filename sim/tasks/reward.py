"""The reward's named terms and their weights, in training and as fitness."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

TERMS = ("progress", "goal", "adversary", "contact")


@dataclass(frozen=True)
class RewardWeights:
    """What each event is worth: progress per metre, the others per event or per action in contact."""

    progress: float
    goal: float
    adversary: float
    contact: float

    @cached_property
    def column(self) -> np.ndarray:
        """The weights in the order of TERMS, (term, 1)."""
        return np.array([[getattr(self, name)] for name in TERMS])


TRAINING = RewardWeights(progress=0.25, goal=1.0, adversary=-1.0, contact=-1.0)
EVALUATION = RewardWeights(progress=1.5, goal=10.0, adversary=-10.0, contact=-2.0)
MODES = {"training": TRAINING, "evaluation": EVALUATION}


def check_mode(mode: str) -> None:
    """Refuse a mode that has no weights.

    Raises:
        ValueError: not one of MODES.
    """
    if mode not in MODES:
        raise ValueError(f"mode = {mode!r}: must be one of {', '.join(map(repr, MODES))}")


def reward_terms(
    weights: RewardWeights, progress: np.ndarray, goal: np.ndarray, adversary: np.ndarray, contact: np.ndarray
) -> np.ndarray:
    """The terms of the reward in the order of TERMS, (term, n), of progress [m] in the task's sense and of which events
    happened."""
    terms = np.array([progress, goal, adversary, contact])
    terms *= weights.column
    terms += 0.0  # never -0.0
    return terms
