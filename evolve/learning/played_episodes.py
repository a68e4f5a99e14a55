"""Complete episodes that a policy plays without exploration, and their results."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from evolve.learning.policy import EyePolicy, TrainingDiverged
from sim.tasks.batch_task import BatchTask

__all__ = ["Episodes", "batch_task_of", "play"]

VERDICTS = {True: 1, False: -1, None: 0}


@dataclass(frozen=True)
class Episodes:
    """Results of one complete episode in each world.

    returns: sum of rewards, (world,)
    verdicts: +1 solved, -1 not solved, 0 undecided, see `BatchTask.solved`, (world,)
    """

    returns: np.ndarray
    verdicts: np.ndarray

    @property
    def successes(self) -> np.ndarray:
        """True for each world whose episode was solved, (world,)."""
        return self.verdicts > 0


def play(policy: EyePolicy, worlds: VecEnv, seed: int, watch: Callable[[np.ndarray], None] | None = None) -> Episodes:
    """Reset all worlds with this seed, and play one episode in each; the policy acts without exploration.

    watch: function that is called before each action with a mask (world,), True for worlds whose episode has not ended;
        None: no function

    Raises:
        TrainingDiverged: actions or returns are not finite.
    """
    worlds.seed(seed)
    observation = worlds.reset()
    returns = np.zeros(worlds.num_envs)
    playing = np.ones(worlds.num_envs, bool)
    task = batch_task_of(worlds)
    verdicts: list[bool | None] = [None] * worlds.num_envs
    while playing.any():
        if watch is not None:
            watch(playing)
        action, _ = policy.predict(observation, deterministic=True)
        observation, reward, done, infos = worlds.step(action)
        returns[playing] += reward[playing]
        for world in np.flatnonzero(playing):
            verdicts[world] = task.solved(verdicts[world], infos[world])
        playing &= ~done
    if not math.isfinite(returns.sum()):
        raise TrainingDiverged("returns of the evaluation episodes not finite")
    return Episodes(returns, np.array([VERDICTS[verdict] for verdict in verdicts]))


def batch_task_of(worlds: VecEnv) -> BatchTask:
    """Return the task of these worlds."""
    task: BatchTask = worlds.get_attr("batch_task")[0]
    return task
