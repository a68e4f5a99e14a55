"""A world that is solved in seconds: go to a bright spot, seen by eyes with the observations of sim's environments."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from evolve.learning.policy import PolicyConfig
from sim.tasks.find_goal import FindGoal


class BrightSpot(VecEnv):
    """A task in which each world has one Gaussian spot of light on a plane.

    The reward is the progress towards the spot, and 1 for reaching it.

    blind: True if eyes have no signals, so that the task can be solved only by chance
    """

    reach, limit, spread = 0.5, 40, 0.15
    batch_task = FindGoal.__new__(FindGoal)  # its actions, ramped terms and verdicts are the same as in detection

    def __init__(self, n_envs=16, n_eyes=2, width=7, memory=1, blind=False):
        config = PolicyConfig((memory, n_eyes, 1, 1, width), neurons=1)
        super().__init__(n_envs, config.observation_space(), spaces.Box(-1.0, 1.0, (2,), np.float32))
        self.receptors = np.linspace(1.2, -1.2, n_eyes * width).reshape(n_eyes, 1, 1, width)
        self.blind = blind
        self.frames = np.zeros((n_envs, *config.eyes), np.float32)
        self.position, self.heading = np.zeros((n_envs, 2)), np.zeros(n_envs)
        self.spot, self.age, self.returns = np.zeros((n_envs, 2)), np.zeros(n_envs, int), np.zeros(n_envs)
        self.previous_action = np.zeros((n_envs, 2), np.float32)
        self.seed(0)

    def seed(self, seed=None):
        self.random = np.random.default_rng(seed)
        return [seed] * self.num_envs

    def reset(self):
        self._restart(np.ones(self.num_envs, bool))
        return self._observation()

    def _restart(self, worlds):
        n = worlds.sum()
        angle = self.random.uniform(-np.pi, np.pi, n)
        self.position[worlds] = 0
        self.heading[worlds] = self.random.uniform(-np.pi, np.pi, n)
        self.spot[worlds] = self.random.uniform(2, 4, n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
        self.age[worlds], self.returns[worlds], self.previous_action[worlds] = 0, 0, 0
        self.frames[worlds] = self._look()[worlds, None]

    def _look(self):
        dx, dy = (self.spot - self.position).T
        bearing = np.arctan2(dy, dx) - self.heading
        bearing = (bearing + np.pi) % (2 * np.pi) - np.pi
        seen = np.exp(-(((bearing[:, None, None, None, None] - self.receptors) / self.spread) ** 2))
        return 0 * seen if self.blind else seen

    def _observation(self):
        contact = np.zeros((self.num_envs, 1), np.float32)
        return {"eyes": self.frames.copy(), "contact": contact, "previous_action": self.previous_action.copy()}

    def step_async(self, actions):
        self.action = actions.astype(np.float32)

    def step_wait(self):
        before = np.linalg.norm(self.spot - self.position, axis=1)
        self.heading += self.action[:, 1] * 1.0
        forward = np.stack([np.cos(self.heading), np.sin(self.heading)], 1)
        self.position += 0.25 * (self.action[:, :1] + 1) * forward
        self.previous_action = self.action
        distance = np.linalg.norm(self.spot - self.position, axis=1)
        self.age += 1
        reached = distance < self.reach
        done = reached | (self.age >= self.limit)
        reward = (0.25 * (before - distance) + reached).astype(np.float32)
        self.returns += reward
        infos = [{"reward_terms": {"goal": float(r), "adversary": 0.0}} for r in reached]
        self.frames[:, :-1] = self.frames[:, 1:].copy()
        self.frames[:, -1] = self._look()
        last = self._observation()
        for world in np.flatnonzero(done):
            infos[world] |= {
                "terminal_observation": {name: value[world] for name, value in last.items()},
                "TimeLimit.truncated": bool(~reached[world]),
                "episode": {"r": self.returns[world], "l": int(self.age[world])},
            }
        self._restart(done)
        return self._observation(), reward, done, infos

    def close(self):
        pass

    def get_attr(self, attr_name, indices=None):
        return [getattr(self, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        setattr(self, attr_name, value)

    def env_method(self, *args, **kwargs):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * self.num_envs
