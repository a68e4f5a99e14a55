"""The reward of an action in a built-in task: four named terms, with separate weights for training and for fitness.

    reward_t = λ progress_t + w_g goal_t + w_a adversary_t + w_c contact_t

    progress   change of a distance in metres; x_t is the agent's position after action t:
               |x_(t-1) - x_goal| - |x_t - x_goal|   detection, foraging, tracking; in each of the two distances,
                                                     x_goal is the goal that is nearest at that time, t-1 or t
               |x_t - x_start| - |x_(t-1) - x_start| navigation, maze; straight-line distances
    goal       1 when the goal, or the goal region of a course or maze, is reached
    adversary  1 when an adversary is reached
    contact    1 when the agent touched a wall at any time during the action

                λ      w_g    w_a    w_c
    training    0.25   1      -1     -1     reaching a goal or an adversary ends the episode
    evaluation  1.5    10     -10    -2     objects respawn and the episode continues; only a goal region ends it
    test        1.5    10     -10    -2     the same, for final results

Terms and weights follow the text of Tiwary, Young et al. (2025), "What if Eye...? Computationally Recreating Vision
Evolution". The fitness is the mean, over all evaluation episodes, of the sum of an episode's rewards. In training, the
code published with the paper gives a metre of progress the same weight as an action during which the agent touches a
wall; rhabdom uses the weights of the text. Foraging is not in the paper and has the reward of detection. A training run
may begin with a w_c closer to 0 (setting `learning.contact_ramp` of `evolve`). At the end of training, and in the
fitness, the weights are those above. The progress, and whether a goal or an adversary is reached, are computed by
`sim.tasks.find_goal` for detection, foraging and tracking, and by `sim.tasks.find_way` for navigation and maze.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.numerics.arguments import one_of

TERMS = ("progress", "goal", "adversary", "contact")


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the four terms of the reward: progress, goal, adversary and contact.

    Progress is weighted per metre. The other terms are weighted per action in which a goal or the goal region is
    reached, an adversary is reached, or a wall is touched.
    """

    progress: float
    goal: float
    adversary: float
    contact: float

    @cached_property
    def column(self) -> np.ndarray:
        """Weights of progress, goal, adversary and contact, in this order, (term, 1)."""
        return np.array([[getattr(self, name)] for name in TERMS])


TRAINING = RewardWeights(progress=0.25, goal=1.0, adversary=-1.0, contact=-1.0)
EVALUATION = RewardWeights(progress=1.5, goal=10.0, adversary=-10.0, contact=-2.0)
MODES = {"training": TRAINING, "evaluation": EVALUATION, "test": EVALUATION}


def check_mode(mode: str) -> None:
    """Check that a mode is "training", "evaluation" or "test".

    Raises:
        ValueError: the mode is unknown.
    """
    one_of("mode", mode, MODES)


def reward_terms(
    weights: RewardWeights, progress: np.ndarray, goal: np.ndarray, adversary: np.ndarray, contact: np.ndarray
) -> np.ndarray:
    """Return the weighted terms of the reward: progress, goal, adversary and contact, in this order, (term, n).

    progress, goal, adversary, contact: amounts by which the weights are multiplied, (n,); progress in metres
    """
    terms = np.array([progress, goal, adversary, contact])
    terms *= weights.column
    terms += 0.0  # converts -0.0 to 0.0
    return terms
