"""Worlds of a task in motion, unseen: actions in, rewards and endings out. Environments add the eyes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np

from optics.numerics.arguments import shown
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
    """`n` independent worlds of one task.

    task: its rules · seed: of all random streams; None draws one · threads: of the physics
    least_return: an episode whose rewards add up to no more is truncated, in training only; None: none is
    episode_steps: actions, then an episode is truncated; None: as many as the task has

    physics: what moves the worlds · agents: who acts in each world, learners first · rows: learners of all worlds
    steps: actions taken in each world's episode (n,) · varied: how each world differs now, by name
    taken: the last actions, within [-1, 1], and `Agent.first_action` in the place of those that were not finite
    felt: what agents know beside what they see, by agent and name (n, k) float32

    Raises:
        ValueError: less than one world, or a least return that is not below 0 or not for training.
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
        self.least_return = -math.inf if least_return is None else least_return
        self.episode_steps = task.episode_steps if episode_steps is None else episode_steps
        self.variation = Variation(task.vary) if task.vary else None
        self.varied = {} if self.variation is None else self.variation.blank(n)
        self.learners = sum(agent.learns for agent in self.agents)
        self.rows = self.learners * n
        self.steps, self._returns = np.zeros(n, int), np.zeros(self.rows)
        self._everyone = np.arange(n)
        self.physics: Physics = task.physics(n, threads, self.variation)
        self.seed(seed)
        self._rehearse()

    def _rehearse(self) -> None:
        """Start one episode: it shows what agents feel, and whether a task changes the model."""
        first = np.zeros(1, int)
        self._start(first)
        while self.physics.adopt_changed_model():
            self._start(first)
        self.felt = [
            {name: np.repeat(np.asarray(felt, np.float32), self.n, axis=0) for name, felt in known.items()}
            for known in self.task.all_feel(self.physics, first)
        ]
        self.seed(self.streams.entropy)

    @property
    def state(self) -> Any:
        """All worlds as they are now, in their physics' own type.

        Raises:
            RuntimeError: before the first reset.
        """
        if not self.begun:
            raise RuntimeError("the worlds have not begun: call reset first")
        return self.physics.state

    @state.setter
    def state(self, state: Any) -> None:
        self.physics.state = state  # type: ignore[misc]

    def seed(self, seed: Any) -> None:
        """Start all random streams again, from the next reset on."""
        self.streams = self.physics.chance = self.task.streams(seed, self.n)
        self.begun = False

    def reset(self) -> Any:
        """Start all episodes."""
        self.restart(self._everyone)
        return self.state

    def restart(self, worlds: np.ndarray) -> None:
        """Start new episodes in these worlds.

        Raises:
            RuntimeError: a method of the task fails, or the task changes the model of all worlds.
        """
        self.physics.watch()
        self._start(worlds)
        self._feel(self.task.all_feel(self.physics, worlds), worlds)
        self.physics.check(self.task_name)
        self.begun = True

    @property
    def task_name(self) -> str:
        """What messages call the task."""
        return " and ".join(agent.name for agent in self.agents)

    def step(self, actions: np.ndarray) -> Step:
        """One action of all worlds; actions (n, numbers of all agents) in [-1, 1]."""
        return self.judge(self.move(actions))

    def move(self, actions: np.ndarray) -> dict[int, str]:
        """The first half of a step: everything moves. Returns why worlds could not go on, by world.

        Raises:
            RuntimeError: before the first reset.
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
        """The second half: what it led to. The task may put bodies elsewhere."""
        outcome = self.task.judge(self.physics, failed)
        require_outcome(outcome, self.n, self.learners)
        self._feel(outcome.feels or self.task.all_feel(self.physics, self._everyone), slice(None))
        self.physics.check(self.task_name)
        reward = outcome.terms.total
        self._returns += reward
        terminated = outcome.terminated
        given_up = np.zeros(self.rows, bool)
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
        """Worlds in which this holds for one of the learners."""
        return rows if self.learners == 1 else np.asarray(rows.reshape(self.learners, self.n).any(axis=0))

    def poses(self) -> Poses:
        """Where everything is now."""
        return self.physics.poses()

    def told(self, world: int) -> dict[str, Any]:
        """How a world differs from others, for its `info`; nothing if none differ."""
        varied = {name: _plain(values[world]) for name, values in self.varied.items()}
        return {"varied": varied} if varied else {}

    def light(self, wavelengths: np.ndarray) -> np.ndarray | None:
        """Factors of the lights now, (n, band); None: none."""
        return None if self.variation is None else self.variation.light(self.varied, wavelengths)

    def held(self) -> dict[str, np.ndarray]:
        """All that the future of the worlds depends on, as arrays whose first axis is the world."""
        nothing = np.zeros((self.n, 0), np.float32)
        felt = {key: self.felt[k][name].copy() if name else nothing for key, k, name in self._felt_keys()}
        varied = {f"varied.{name}": array.copy() for name, array in self.varied.items()}
        returns = self._returns.reshape(self.learners, -1).T.copy()
        own = {"steps": self.steps.copy(), "returns": returns, **felt, **varied}
        return {**self.physics.held(), **self.streams.held(), **own}

    def hold(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        """Inverse of `held`, for these worlds."""
        for world in worlds:
            for name, values in self.varied.items():
                values[world] = state[f"varied.{name}"][world]
            self.physics.begin(world, {name: values[world] for name, values in self.varied.items()})
        self.physics.hold(state, worlds)
        self.streams.hold(state, worlds)
        self.steps[worlds] = state["steps"][worlds]
        self._returns.reshape(self.learners, -1)[:, worlds] = state["returns"][worlds].T
        for key, k, name in self._felt_keys():
            if name:
                self.felt[k][name][worlds] = state[key][worlds]

    def close(self) -> None:
        """Stop threads."""
        self.physics.close()

    def _start(self, worlds: np.ndarray) -> None:
        for world in worlds:
            drawn = {} if self.variation is None else self.variation.draw(self.streams.variation[world])
            for name, value in drawn.items():
                self.varied[name][world] = value
            self.physics.begin(world, drawn)
        self.task.reset(self.physics, worlds, [self.streams.episodes[world] for world in worlds])
        self.physics.settle(worlds)
        self.steps[worlds] = 0
        self._returns.reshape(self.learners, -1)[:, worlds] = 0.0

    def _finite(self, actions: np.ndarray) -> tuple[np.ndarray, dict[int, str]]:
        """Actions within [-1, 1], and the worlds in which an agent's was not finite: it does as at first."""
        failed: dict[int, str] = {}
        if not np.isfinite(actions).all():
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
                unknown = np.isnan(array)
                if unknown.any():
                    fresh = ~unknown.any(axis=1)
                    known[name][self._everyone[worlds][fresh]] = array[fresh]
                else:
                    known[name][worlds] = array

    def _felt_keys(self) -> list[tuple[str, int, str]]:
        """Name of an entry in `held`, number of the agent, and name of what it feels: none, if that is nothing."""
        found = []
        for k, (agent, known) in enumerate(zip(self.agents, self.felt, strict=True)):
            for place, name in enumerate(known or [""]):
                key = "felt" if place == 0 else f"felt.{name}"
                found.append((key if k == 0 else f"{agent.name}.{key}", k, name))
        return found


def check_least_return(least_return: float | None, mode: str) -> None:
    """Refuse a least return that would end every episode at once, or episodes that fitness comes from.

    Raises:
        ValueError: it is.
    """
    if least_return is None:
        return
    if isinstance(least_return, bool) or not isinstance(least_return, Real) or not least_return < 0:
        raise ValueError(f"least_return = {shown(least_return)}: must be below 0, or None")
    if mode != "training":
        raise ValueError(f"least_return = {least_return!r}: must be left out in mode {mode!r}, only training ends so")


def _plain(value: np.ndarray) -> str | float | tuple[float, ...]:
    """A name, a number, or three."""
    if value.dtype.kind == "U":
        return str(value)
    return tuple(map(float, value)) if value.ndim else float(value)
