"""Many worlds of a task of one's own: physics and the task's own methods, world by world."""

from __future__ import annotations

import traceback
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from sim.robots import task as task_module
from sim.robots.task import Task, compiled, named_terms

_UNSTABLE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
_OURS = (__file__, task_module.__file__)


@dataclass
class StepOfWorld:
    """Of one action in one world. failure: what went wrong in the task's own methods, which ends the episode"""

    terms: dict[str, float] = field(default_factory=dict)
    terminated: bool = False
    truncated: bool = False
    success: bool = False
    failure: str | None = None


class TaskWorlds:
    """Their data, and what is done with it.

    task, model · datas: mjData of every world · steps: actions taken in its episode, (n,) int
    felt: what its animal feels now, (n, numbers) float32
    rngs: of each world's episodes
    entropy: what all random streams come from; seeded with it again, everything happens again
    """

    def __init__(self, task: Task, n: int, seed: int | None, threads: int = 1) -> None:
        self.task, self.model = task, compiled(task)
        self.datas = [mujoco.MjData(self.model) for _ in range(n)]
        self.steps, self.felt = np.zeros(n, int), np.zeros((n, 0), np.float32)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self.seed(seed)
        self.reset(np.arange(1))  # what an animal feels may want an episode
        self.felt = np.repeat(self.felt[:1], n, axis=0)
        self.seed(self.entropy)

    def seed(self, seed: Any) -> None:
        """Begin all random streams anew; world i's depends on the seed and i alone."""
        self.entropy = np.random.SeedSequence(seed).entropy
        children = [np.random.SeedSequence(self.entropy, spawn_key=(i,)) for i in range(len(self.datas))]
        self.rngs = [np.random.default_rng(child) for child in children]
        self.noise_keys = np.array([child.generate_state(1, np.uint64)[0] for child in children])

    def reset(self, worlds: np.ndarray) -> None:
        """Begin these worlds' episodes.

        Raises:
            RuntimeError: the task's own reset fails; by its name, line and message.
        """
        for i in worlds:
            data = self.datas[i]
            mujoco.mj_resetData(self.model, data)
            try:
                self.task.reset(data, self.rngs[i])
                mujoco.mj_forward(self.model, data)
                self._feel(i)
            except Exception as error:
                raise RuntimeError(_told(error)) from error
            self.steps[i] = 0

    def step(self, actions: np.ndarray) -> list[StepOfWorld]:
        """One action (world, n) in every world."""
        outcomes = [self._acted(data, action) for data, action in zip(self.datas, actions, strict=True)]
        moving = [data for data, outcome in zip(self.datas, outcomes, strict=True) if outcome.failure is None]
        for _ in (self._pool.map if self._pool else map)(self._moved, moving):
            pass
        self.steps += 1
        for i, (data, outcome) in enumerate(zip(self.datas, outcomes, strict=True)):
            if outcome.failure is None:
                self._judge(i, data, outcome)
            outcome.truncated = not outcome.terminated and (
                outcome.failure is not None or self.steps[i] >= self.task.episode_steps
            )
        return outcomes

    def close(self) -> None:
        if self._pool:
            self._pool.shutdown()

    def _acted(self, data: mujoco.MjData, action: np.ndarray) -> StepOfWorld:
        if not np.isfinite(action).all():
            return StepOfWorld(failure="action is not finite")
        try:
            self.task.act(data, np.clip(action, -1, 1))
        except Exception as error:
            return StepOfWorld(failure=_told(error))
        return StepOfWorld()

    def _moved(self, data: mujoco.MjData) -> None:
        mujoco.mj_step(self.model, data, self.task.substeps)
        mujoco.mj_forward(self.model, data)

    def _feel(self, world: int) -> None:
        """What the world's animal feels.

        Raises:
            ValueError: these are not as many numbers as ever, or not finite.
        """
        felt = np.asarray(self.task.feels(self.datas[world]), np.float32)
        if felt.ndim != 1 or not np.isfinite(felt).all():
            raise ValueError(f"feels returned {felt!r:.100}: must be finite numbers, (k,)")
        if not self.felt.shape[1]:
            self.felt = np.zeros((len(self.datas), len(felt)), np.float32)
        if len(felt) != self.felt.shape[1]:
            raise ValueError(f"feels returned {len(felt)} numbers: must be {self.felt.shape[1]}, as before")
        self.felt[world] = felt

    def _judge(self, world: int, data: mujoco.MjData, outcome: StepOfWorld) -> None:
        if any(data.warning[kind].number for kind in _UNSTABLE):  # MuJoCo has begun it anew
            outcome.failure = "physics is unstable: positions, speeds or accelerations are huge or not finite"
            return
        try:
            outcome.terms = named_terms(self.task, data)
            outcome.terminated, outcome.success = bool(self.task.terminated(data)), bool(self.task.succeeded(data))
            self._feel(world)
        except Exception as error:
            outcome.terms, outcome.failure = {}, _told(error)


def _told(error: Exception) -> str:
    """Where in the user's file it happened, if it did there, and what."""
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename not in _OURS:
            place = f"{frame.name}, line {frame.lineno} of {Path(frame.filename).name}"
            return f"{place}: {type(error).__name__}: {error}"
    return str(error)
