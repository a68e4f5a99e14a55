"""Simulation of a task without rendering: movements, rewards and ends of episodes. Environments add the eyes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from optics.numerics.arguments import shown
from optics.numerics.number_types import all_finite, is_number
from optics.numerics.read_only import read_only
from sim.physics.physics import Physics
from sim.scene.poses import Poses
from sim.scene.variation import Variation
from sim.tasks.batch_arrays import require_outcome
from sim.tasks.batch_task import BatchTask
from sim.tasks.outcome import Step
from sim.tasks.reward import check_mode

__all__ = ["LEAST_RETURN", "NO_ACTION", "Simulation", "check_least_return"]

NO_ACTION = "action is not finite"
LEAST_RETURN = "least return"


class Simulation:
    """Independent worlds of one task. An exception in a method of a `sim.BatchTask` is raised unchanged.

    task: rules of the task
    n: number of worlds
    seed: seed of all random number generators; None: a random seed
    threads: number of threads that the physics uses
    least_return: in training, an episode is truncated when the sum of its rewards falls to this value; None: never
    episode_steps: number of actions after which an episode is truncated; None: the task's default

    Further attributes:
    physics: physics of the worlds
    agents: agents in each world; those that learn come first
    task_name: name of the task in messages
    rows: number of learners in all worlds together
    steps: number of actions taken in the present episode of each world, (n,)
    varied: current values, in each world, of the quantities that differ between episodes (`task.vary`), by name
    taken: the last actions, limited to [-1, 1]; `Agent.first_action` replaces actions that were not finite
    felt: for each agent, the part of its last observation that is not from eyes, as arrays (n, k) float32 by name

    Raises:
        ValueError: `n` is below 1, or `least_return` is not a number below 0, or is given in a mode besides training.
        RuntimeError: a method of a `sim.Task` fails in the first episode, which the constructor starts.
    """

    def __init__(
        self,
        task: BatchTask,
        n: int,
        seed: int | None,
        threads: int = 1,
        least_return: float | None = None,
        episode_steps: int | None = None,
    ) -> None:
        check_mode(task.mode)
        check_least_return(least_return, task.mode)
        if n < 1:
            raise ValueError(f"n_envs = {n!r}: must be at least 1")
        self.task, self.n, self.agents = task, n, task.agents()
        self.task_name = " and ".join(agent.name for agent in self.agents)
        self.least_return = -math.inf if least_return is None else least_return
        self.episode_steps = task.episode_steps if episode_steps is None else episode_steps
        self.variation = Variation(task.vary) if task.vary else None
        self.varied = {} if self.variation is None else self.variation.blank(n)
        self.learners = sum(agent.learns for agent in self.agents)
        self.rows = self.learners * n
        self.steps, self._returns = np.zeros(n, int), np.zeros(self.rows)
        self._everyone, self._nobody = np.arange(n), read_only(np.zeros(self.rows, bool))
        self.physics: Physics = task.physics(n, threads, self.variation)
        self.seed(seed)
        self._rehearse()

    def _rehearse(self) -> None:
        """Start an episode in one world to find the size of proprioception, and whether the task changes the model."""
        first = np.zeros(1, int)
        self._start(first)
        while self.physics.adopt_changed_model():
            self._start(first)
        self.felt = [
            {name: np.repeat(np.asarray(felt, np.float32), self.n, axis=0) for name, felt in known.items()}
            for known in self.task.all_proprioception(self.physics, first)
        ]
        self.seed(self.streams.entropy)

    @property
    def state(self) -> Any:
        """Current state of all worlds; the type depends on the physics.

        Raises:
            RuntimeError: there has been no reset yet.
        """
        if not self.begun:
            raise RuntimeError("the worlds have not begun: call reset first")
        return self.physics.state

    @state.setter
    def state(self, state: Any) -> None:
        self.physics.state = state  # type: ignore[misc]

    def seed(self, seed: Any) -> None:
        """Seed all random number generators again, see `BatchTask.streams`. The next call must be `reset`."""
        self.streams = self.physics.chance = self.task.streams(seed, self.n)
        self.begun = False

    def reset(self) -> Any:
        """Start new episodes in all worlds, and return the state; errors are as in `restart`."""
        self.restart(self._everyone)
        return self.state

    def restart(self, worlds: np.ndarray) -> None:
        """Start new episodes in these worlds.

        Raises:
            RuntimeError: a method of a `sim.Task` fails, or the task changes the model of all worlds.
        """
        self.physics.watch()
        self._start(worlds)
        self._feel(self.task.all_proprioception(self.physics, worlds), worlds)
        self.physics.check(self.task_name)
        self.begun = True

    def step(self, actions: np.ndarray) -> Step:
        """Take the actions of all agents, (n, value), in [-1, 1]. For errors, see `move` and `judge`."""
        return self.judge(self.move(actions))

    def move(self, actions: np.ndarray) -> dict[int, str]:
        """Move all bodies (the first half of a `step`); return the reason for each world that could not continue.

        Raises:
            RuntimeError: there has been no reset yet.
        """
        if not self.begun:
            raise RuntimeError("the worlds have not begun: call reset first")
        self.physics.watch()
        self.taken, failed = self._finite(actions)
        failed = {**self.task.take(self.physics, self.taken, failed), **failed}
        broken = self.physics.step(failed)
        self.steps += 1
        return {**broken, **failed}

    def judge(self, failed: Mapping[int, str]) -> Step:
        """Compute the second half of a step: its outcome. The task may move bodies to new positions.

        Raises:
            ValueError: the task returns an invalid outcome, for example an array of the wrong shape.
            RuntimeError: the task changes the model that worlds share.
        """
        outcome = self.task.judge(self.physics, failed)
        require_outcome(outcome, self.n, self.learners)
        self._feel(outcome.proprioception or self.task.all_proprioception(self.physics, self._everyone), slice(None))
        self.physics.check(self.task_name)
        reward = outcome.terms.total
        self._returns += reward
        terminated, given_up = outcome.terminated, self._nobody
        if self.least_return > -math.inf:
            given_up = (self._returns <= self.least_return) & ~terminated
        ends = (self.steps >= self.episode_steps) | self._any_learner(terminated | given_up)
        if outcome.over is not None:
            ends = ends | outcome.over
        truncated = (ends if self.learners == 1 else np.tile(ends, self.learners)) & ~terminated
        return Step(
            state=self.physics.state,
            terms=outcome.terms,
            reward=reward,
            terminated=terminated,
            truncated=truncated,
            success=outcome.success,
            changed=outcome.changed,
            given_up=given_up,
            failure=outcome.failure,
            info=outcome.info,
        )

    def _any_learner(self, rows: np.ndarray) -> np.ndarray:
        """Return for each world whether a condition holds for at least one of the world's learners, (n,) bool.

        rows: True where the condition holds: first learner in all worlds, then the next one, (learners · n,) bool
        """
        return rows if self.learners == 1 else np.asarray(rows.reshape(self.learners, self.n).any(axis=0))

    def poses(self) -> Poses:
        """Return the current poses of the bodies."""
        return self.physics.poses()

    def variation_info(self, world: int) -> dict[str, Any]:
        """Return the entry of `info` with the varied quantities of a world; empty if no quantities vary."""
        varied = {name: _plain(values[world]) for name, values in self.varied.items()}
        return {"varied": varied} if varied else {}

    def light(self, wavelengths: np.ndarray) -> np.ndarray | None:
        """Return the current factors by which lights are multiplied, (n, band); None if the light does not vary."""
        return None if self.variation is None else self.variation.light(self.varied, wavelengths)

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the complete state of the worlds. The first axis of each array is the world."""
        nothing = np.zeros((self.n, 0), np.float32)
        felt = {key: self.felt[k][name].copy() if name else nothing for key, k, name in self._felt_keys()}
        varied = {f"varied.{name}": array.copy() for name, array in self.varied.items()}
        returns = self._returns.reshape(self.learners, -1).T.copy()
        own = {"steps": self.steps.copy(), "returns": returns, **felt, **varied}
        return {**self.physics.get_state(), **self.streams.get_state(), **own}

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        """Restore the state of these worlds from the return value of `get_state`."""
        for world in worlds:
            for name, values in self.varied.items():
                values[world] = state[f"varied.{name}"][world]
            self.physics.start_episode(world, {name: values[world] for name, values in self.varied.items()})
        self.physics.set_state(state, worlds)
        self.streams.set_state(state, worlds)
        self.steps[worlds] = state["steps"][worlds]
        self._returns.reshape(self.learners, -1)[:, worlds] = state["returns"][worlds].T
        for key, k, name in self._felt_keys():
            if name:
                self.felt[k][name][worlds] = state[key][worlds]

    def close(self) -> None:
        """Stop all threads."""
        self.physics.close()

    def _start(self, worlds: np.ndarray) -> None:
        for world in worlds:
            drawn = {} if self.variation is None else self.variation.draw(self.streams.variation[world])
            for name, value in drawn.items():
                self.varied[name][world] = value
            self.physics.start_episode(world, drawn)
        self.task.reset(self.physics, worlds, [self.streams.episodes[world] for world in worlds])
        self.physics.settle(worlds)
        self.steps[worlds] = 0
        self._returns.reshape(self.learners, -1)[:, worlds] = 0.0

    def _finite(self, actions: np.ndarray) -> tuple[np.ndarray, dict[int, str]]:
        """Return actions limited to [-1, 1], and an error message for each world with an action that was not finite.

        The agent's `first_action` replaces such an action.
        """
        failed: dict[int, str] = {}
        if not all_finite(actions):
            actions, first = actions.copy(), 0
            for agent in self.agents:
                own = actions[:, first : first + agent.n_actions]
                idle = np.flatnonzero(~np.isfinite(own).all(axis=1))
                own[idle] = agent.first_action
                whose = f"{agent.name}: " if len(self.agents) > 1 else ""
                failed = {**dict.fromkeys(idle.tolist(), f"{whose}{NO_ACTION}"), **failed}
                first += agent.n_actions
        return np.minimum(np.maximum(actions, -1.0), 1.0), failed

    def _feel(self, felt: Sequence[Mapping[str, np.ndarray]], worlds: np.ndarray | slice) -> None:
        for known, now in zip(self.felt, felt, strict=True):
            for name, array in now.items():
                if all_finite(array):
                    known[name][worlds] = array
                else:
                    fresh = ~np.isnan(array).any(axis=1)
                    known[name][self._everyone[worlds][fresh]] = array[fresh]

    def _felt_keys(self) -> list[tuple[str, int, str]]:
        """Return for each entry of proprioception: its key in `get_state`, the agent's index, and the entry's name.

        An agent without proprioception has one entry with the name "".
        """
        found = []
        for k, (agent, known) in enumerate(zip(self.agents, self.felt, strict=True)):
            for place, name in enumerate(known or [""]):
                key = "felt" if place == 0 else f"felt.{name}"
                found.append((key if k == 0 else f"{agent.name}.{key}", k, name))
        return found


def check_least_return(least_return: float | None, mode: str) -> None:
    """Check the sum of rewards at which an episode is truncated: None or, in training only, a negative number.

    With 0 or more, an episode could end at its first action. In evaluation, truncated episodes would alter the fitness.

    Raises:
        ValueError: `least_return` is not negative, or the mode is not training.
    """
    if least_return is None:
        return
    if not (is_number(least_return) and least_return < 0):
        raise ValueError(f"least_return = {shown(least_return)}: must be below 0, or None")
    if mode != "training":
        raise ValueError(
            f"least_return = {least_return!r}: must be left out in mode {mode!r}, it applies to training only"
        )


def _plain(value: np.ndarray) -> str | float | tuple[float, ...]:
    """Return a varied quantity as text, as a number, or as a tuple of numbers."""
    if value.dtype.kind == "U":
        return str(value)
    return tuple(map(float, value)) if value.ndim else float(value)
