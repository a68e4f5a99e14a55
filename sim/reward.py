"""The reward's named terms and their weights, in training and as fitness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

TERMS = ("progress", "goal", "adversary", "contact")


@dataclass(frozen=True)
class RewardWeights:
    """What each event is worth: progress per metre, the others per event or per action in contact."""

    progress: float
    goal: float
    adversary: float
    contact: float


TRAINING = RewardWeights(progress=0.25, goal=1.0, adversary=-1.0, contact=-1.0)
EVALUATION = RewardWeights(progress=1.5, goal=10.0, adversary=-10.0, contact=-2.0)
MODES = {"training": TRAINING, "evaluation": EVALUATION}


def reward_terms(
    weights: RewardWeights, progress: np.ndarray, goal: np.ndarray, adversary: np.ndarray, contact: np.ndarray
) -> dict[str, np.ndarray]:
    """Each term of the reward, (n,): progress [m] in the task's sense, and which events happened."""
    return {
        "progress": weights.progress * progress,
        "goal": weights.goal * goal + 0.0,  # never -0.0
        "adversary": weights.adversary * adversary + 0.0,
        "contact": weights.contact * contact + 0.0,
    }
