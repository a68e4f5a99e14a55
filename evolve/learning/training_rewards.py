"""Rewards as a learner meets them: in units of its own, and with some terms at a share of their price."""

from __future__ import annotations

from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

__all__ = ["RewardsInUnits", "ramped_share", "terms_of"]

FIRST_SHARE = 0.1  # of what contact costs in the end; with a third, agents turned on the spot


class RewardsInUnits(VecEnvWrapper):
    """Worlds whose rewards come in units that the learner sets, and in which some terms count in part.

    shares: of reward terms, by name; others count in full
    paid: whether there was any reward but 0 since it was last set to False
    """

    def __init__(self, worlds: VecEnv) -> None:
        super().__init__(worlds)
        self.unit = 1.0
        self.shares: dict[str, float] = {}
        self.paid = False

    def reset(self) -> dict[str, np.ndarray]:
        observation: dict[str, np.ndarray] = self.venv.reset()
        return observation

    def step_wait(self) -> VecEnvStepReturn:
        observation, reward, done, infos = self.venv.step_wait()
        for name, share in self.shares.items():
            if share < 1:
                price = np.array([terms.get(name, 0.0) for terms in map(terms_of, infos)], np.float32)
                reward = reward - np.float32(1 - share) * price
        self.paid |= bool(reward.any())
        return observation, reward / np.float32(self.unit), done, infos


def ramped_share(steps: int, ramp: int) -> float:
    """The share of a term's whole price after so many steps: FIRST_SHARE for a third of the ramp, then more by the same
    factor each step.

    Agents that pay for contact before they can steer learn to stand still, which costs nothing, and never steer.
    """
    if steps >= ramp:
        return 1.0
    return float(FIRST_SHARE ** min(1.0, 1.5 * (1 - steps / ramp)))


def terms_of(info: dict[str, Any]) -> dict[str, float]:
    """What a step's reward is the sum of, by name."""
    terms: dict[str, float] = info["reward_terms"]
    return terms
