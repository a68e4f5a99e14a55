"""Rollout buffer that stores each frame once, for a learner with memory.

The observations of an agent with memory are stacks of the last frames. The buffer of stable-baselines3 (SB3) stores
these stacks, and thus `memory` copies of each frame, and PPO encodes every copy. For 64 worlds x 64 steps of 2 x 15 x
15 receptors with 3 channels and 10 frames, this takes 221 MB. In this buffer, a mini-batch consists of segments. A
segment is a sequence of consecutive steps of one world. The stacks of these steps share most of their frames. Each
frame of a segment is encoded once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import DictRolloutBufferSamples
from torch import Tensor

from evolve.learning.observed import known_beside_eyes

# Maximum number of steps in a segment. In longer segments, more frames are shared; shorter segments make mini-batches
# more varied (docs/measurements/learning.md).
SEGMENT_STEPS = 8


class FrameRolloutBuffer(RolloutBuffer):
    """Rollout buffer that passes each frame on once, although several steps of an agent with memory observe it.

    An agent with memory observes a stack of its last frames. `evolve.learning.eye_features.EyeFeatures` needs only the
    frames. At the start of an episode, there are too few frames for a stack. `EyeFeatures` then adds copies of the
    episode's first frame, as the environments do.
    """

    observation_space: spaces.Dict

    def __init__(self, *args: Any, seed: int = 0, **kwargs: Any) -> None:
        self.random = np.random.default_rng(seed)
        super().__init__(*args, **kwargs)
        self.memory, *frame = self.observation_space["eyes"].shape
        self.segment_steps = max(n for n in range(1, SEGMENT_STEPS + 1) if self.buffer_size % n == 0)
        worlds, steps = self.n_envs, self.buffer_size
        self.frames = np.zeros((worlds, self.memory - 1 + steps, *frame), np.float32)
        self.age = np.zeros((worlds, steps), np.int64)
        sizes = known_beside_eyes(self.observation_space)
        self.beside = {name: np.zeros((worlds, steps, size), np.float32) for name, size in sizes.items()}

    def compute_returns_and_advantage(self, last_values: Tensor, dones: np.ndarray) -> None:
        """Compute returns and advantages without NumPy's warnings of overflow.

        The warnings are not needed, because the learner raises an error if the loss is not finite.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            super().compute_returns_and_advantage(last_values, dones)

    def reset(self) -> None:
        shape = (self.buffer_size, self.n_envs)
        self.actions = np.zeros((*shape, self.action_dim), np.float32)
        self.rewards, self.returns, self.episode_starts, self.values, self.log_probs, self.advantages = (
            np.zeros(shape, np.float32) for _ in range(6)
        )
        self.pos, self.full = 0, False

    def add(
        self,
        obs: dict[str, np.ndarray],
        action: np.ndarray,
        reward: np.ndarray,
        episode_start: np.ndarray,
        value: Tensor,
        log_prob: Tensor,
    ) -> None:
        step, remembered = self.pos, self.memory - 1
        if step == 0:
            # The first stack is stored as it is, with its repeated frames. Its age is that of a full memory, so that
            # `EyeFeatures` does not fill missing places again.
            self.frames[:, :remembered] = obs["eyes"][:, :-1]
            self.age[:, 0] = remembered
        else:
            self.age[:, step] = np.where(episode_start, 0, self.age[:, step - 1] + 1)
        self.frames[:, remembered + step] = obs["eyes"][:, -1]
        for name, kept in self.beside.items():
            kept[:, step] = obs[name]
        self.actions[step] = action.reshape(self.n_envs, self.action_dim)
        self.rewards[step] = reward
        self.episode_starts[step] = episode_start
        self.values[step] = value.numpy().ravel()
        self.log_probs[step] = log_prob.numpy()
        self.pos += 1
        self.full = self.pos == self.buffer_size

    @property
    def new_frames(self) -> np.ndarray:
        """New frame of each step of this rollout, (world, step, eye, channel, height, width).

        For compound eyes, it is (world, step, ommatidium, channel).
        """
        return self.frames[:, self.memory - 1 :]

    def get(self, batch_size: int | None = None) -> Iterator[DictRolloutBufferSamples]:
        """Yield mini-batches in random order; every sample of the rollout occurs once.

        A mini-batch consists of whole segments (sequences of consecutive steps of one world).

        batch_size: approximate number of samples in a mini-batch; None: all
        """
        assert self.full
        starts = np.arange(0, self.buffer_size, self.segment_steps)
        worlds, starts = (a.ravel() for a in np.meshgrid(np.arange(self.n_envs), starts, indexing="ij"))
        order = self.random.permutation(len(worlds))
        per_batch = max(1, (batch_size or self.buffer_size * self.n_envs) // self.segment_steps)
        for first in range(0, len(order), per_batch):
            chosen = order[first : first + per_batch]
            yield self._segments(worlds[chosen], starts[chosen])

    def _segments(self, worlds: np.ndarray, starts: np.ndarray) -> DictRolloutBufferSamples:
        """Return the samples of some segments, with (step, segment) flattened.

        worlds, starts: world and first step of each segment, (segment,)
        """
        steps = starts + np.arange(self.segment_steps)[:, None]
        frames = starts + np.arange(self.memory - 1 + self.segment_steps)[:, None]

        def samples(array: np.ndarray) -> Tensor:
            return torch.from_numpy(array[steps, worlds].reshape(-1, *array.shape[2:]))

        return DictRolloutBufferSamples(
            observations={
                "frames": torch.from_numpy(self.frames[worlds, frames]),
                "age": torch.from_numpy(self.age[worlds, steps]),
                **{n: torch.from_numpy(a[worlds, steps].reshape(-1, a.shape[-1])) for n, a in self.beside.items()},
            },
            actions=samples(self.actions),
            old_values=samples(self.values),
            old_log_prob=samples(self.log_probs),
            advantages=samples(self.advantages),
            returns=samples(self.returns),
        )
