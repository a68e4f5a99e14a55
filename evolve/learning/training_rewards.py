"""Scaling of rewards for the learner, with reduced costs at the start of training."""

from __future__ import annotations

from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

__all__ = ["RewardsInUnits", "ramped_share", "terms_of"]

FIRST_SHARE = 0.1  # initial fraction of the cost of contact; with a third, agents learnt to turn on the spot


class RewardsInUnits(VecEnvWrapper):
    """Environments in which rewards are divided by a unit, and some terms of the reward have reduced weights.

    The learner sets `unit` and `shares`.

    unit: unit of rewards
    shares: weights of reward terms, by name; other terms have the weight 1
    paid: True if a reward has differed from 0 since `paid` was last set to False
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
    """Return the weight of a reward term after `steps`, as a fraction of its final weight.

    It is 0.1 for the first third of the ramp, and then rises exponentially to 1. The ramp is meant for the cost
    of contact. If contact has its full cost from the start, agents learn to stand still before they can steer, because
    standing still costs nothing. They then never learn to steer.

    ramp: number of steps after which the fraction is 1; 0: it is always 1
    """
    if steps >= ramp:
        return 1.0
    return float(FIRST_SHARE ** min(1.0, 1.5 * (1 - steps / ramp)))


def terms_of(info: dict[str, Any]) -> dict[str, float]:
    """Return the terms of the reward of one step, by name, from its `info`."""
    terms: dict[str, float] = info["reward_terms"]
    return terms
