"""Tasks on arrays of all worlds: rules that are written once and computed for the whole batch."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import mujoco
import numpy as np

from sim.physics.array_worlds import ArrayWorlds
from sim.physics.controls import controls_of
from sim.physics.physics import Physics
from sim.scene.variation import Variation
from sim.tasks.batch_arrays import columns, mapping, not_finite, rows
from sim.tasks.command import Command
from sim.tasks.eye_kinds import EyeKind, auxiliary_of, kinds_of
from sim.tasks.outcome import Outcome, RewardTerms
from sim.tasks.random_streams import RandomStreams, StreamsByWorld
from sim.tasks.task_settings import TaskSettings, compiled
from sim.worlds.ground_plan import GroundPlan

__all__ = ["Agent", "BatchTask"]


@dataclass(frozen=True, eq=False)
class Agent:
    """One animal of every world, as an environment needs to know it.

    name: what it is called among others · n_actions: numbers in an action
    kinds: of its eyes · auxiliary: what its observation holds of each receptor beside the signal
    first_action: what it "did last" when an episode begins
    learns: whether its actions come from outside; otherwise from `policy`, which may be None (it does nothing)
    """

    name: str
    n_actions: int
    kinds: tuple[EyeKind, ...]
    auxiliary: tuple[str, ...] = ()
    first_action: np.ndarray = field(default_factory=lambda: np.zeros(1, np.float32))
    learns: bool = True
    policy: Any = None


class BatchTask(TaskSettings):
    """A task whose methods get all worlds at once; only `model`, `mounts` and `rewards` have no default.

    The settings are those of `sim.Task`. Arrays have one row for each world. `worlds` is what `physics` returns: here
    `sim.ArrayWorlds`, with MuJoCo's arrays (`worlds.qpos`, `worlds.xpos` ...) stacked over worlds; the built-in tasks
    use `sim.SlidingAgents`. `sim.check_batch_task` tests a task against this description.

    renders_early: whether rendering may begin before an action is judged, which is faster; `rewards`, `terminated`,
        `succeeded` and `feels` must then move nothing, unless `judge` names the worlds in `Outcome.changed`
    feel_ranges: (lowest, highest) of what `feels` returns, by name; without an entry there is no limit
    ramped: terms of the reward that may count less while a learner begins, if `evolve` is told so
    counted: titles of rows in tables, by reward term: the number of actions in which the term is not 0
    compared_light: light in which `evolve` compares eyes, "direct" for example; None: as `fidelity` has it
    """

    renders_early: bool = True
    feel_ranges: Mapping[str, tuple[float, float]] = {}
    ramped: Sequence[str] = ()
    counted: Mapping[str, str] = {}
    compared_light: str | None = None

    def reset(self, worlds: Any, chosen: np.ndarray, rngs: Sequence[np.random.Generator]) -> None:
        """Start episodes in the chosen worlds, (k,) int, each with its own generator; here: as mj_resetData has it."""

    def act(self, worlds: Any, actions: np.ndarray) -> Mapping[int, str] | None:
        """Take actions in [-1, 1], (n, n_actions); here: each control of the actuators over the whole of its range.

        Returns why worlds cannot go on, by world, if there are any.
        """
        mine = controls_of(worlds.model, self.actuators)
        limited = worlds.model.actuator_ctrllimited[mine].astype(bool)
        low, high = np.where(limited[:, None], worlds.model.actuator_ctrlrange[mine], [-1.0, 1.0]).T
        worlds.ctrl[:, mine] = low + (high - low) * (actions + 1) / 2
        return None

    def rewards(self, worlds: Any) -> Mapping[str, np.ndarray]:
        """Terms of the reward of the last action, by name, (n,) each; the reward is their sum."""
        raise NotImplementedError

    def terminated(self, worlds: Any) -> np.ndarray:
        """Worlds whose episode ends here, (n,) bool."""
        return np.zeros(worlds.n, bool)

    def succeeded(self, worlds: Any) -> np.ndarray:
        """Worlds in which the task is accomplished, (n,) bool: `info["is_success"]`."""
        return np.zeros(worlds.n, bool)

    def feels(self, worlds: Any) -> np.ndarray | Mapping[str, np.ndarray]:
        """What agents know beside what they see, (n, k), or several such arrays by name; here: nothing."""
        return {}

    def judge(self, worlds: Any, failed: Mapping[int, str]) -> Outcome:
        """What the last action led to; failed: why worlds could not go on, by world. Here: what the other methods say;
        a task that computes all at once overrides this one.

        Raises:
            ValueError: a method returned arrays of another shape.
        """
        n, name = worlds.n, type(self).__name__
        terms = {
            str(term): rows(f"{name}: rewards: {term!r}", array, n, float).copy()
            for term, array in mapping(f"{name}: rewards", self.rewards(worlds)).items()
        }
        terminated = rows(f"{name}: terminated", self.terminated(worlds), n, bool).copy()
        success = rows(f"{name}: succeeded", self.succeeded(worlds), n, bool)
        failure = {**not_finite("rewards", terms), **failed}
        broken = np.array(list(failure), int)
        terminated[broken] = True  # not truncated: nothing might have come after it that a learner could count with
        for term in terms.values():
            term[broken] = 0.0
        if failure and self.failure_reward:
            terms["failure"] = np.zeros(n)
            terms["failure"][broken] = self.failure_reward
        stacked = np.array(list(terms.values())).reshape(len(terms), n)
        return Outcome(RewardTerms(list(terms), stacked), terminated, success, failure)

    def first_info(self, worlds: Any, chosen: np.ndarray) -> Sequence[Mapping[str, Any]] | None:
        """More entries of `info` at the beginning of an episode, for each chosen world; None: no more."""
        return None

    def commands(self) -> tuple[Command, ...]:
        """The meaning of each number in the first agent's action; here: numbered, without units."""
        return tuple(Command(str(number)) for number in range(self.agents()[0].n_actions))

    def solved(self, before: bool | None, info: Mapping[str, Any]) -> bool | None:
        """Whether an episode counts as solved after one more action with this `info`; before: the same without this
        action; None: undecided. Here: as `succeeded` says after the last action."""
        return bool(info["is_success"])

    def azimuths(self) -> np.ndarray:
        """Directions of the first agent's first kind of eyes [rad], (eye,), in the frame of what they are on."""
        return np.radians([mount.azimuth_deg for mount in self.agents()[0].kinds[0].mounts])

    def ground_plan(self, place: np.ndarray) -> GroundPlan | None:
        """The surroundings of this place (2,) [m] from above; None: pictures show the task instead."""
        return None

    # What follows is needed only by tasks with a physics, agents or random streams of their own.

    def physics(self, n: int, threads: int, variation: Variation | None) -> Physics:
        """What moves `n` worlds."""
        return ArrayWorlds(self.model, self._compiled(), n, threads, self.substeps, variation)

    def agents(self) -> tuple[Agent, ...]:
        """Who acts in each world; those who learn come first."""
        n_actions = self.n_actions(self._compiled())
        label = type(self).__name__ if self.name is None else str(self.name)
        first = np.zeros(n_actions, np.float32)
        auxiliary = auxiliary_of(self.auxiliary, f"{type(self).__name__}: auxiliary")
        return (Agent(label, n_actions, kinds_of(self), auxiliary, first),)

    def streams(self, seed: Any, n: int) -> RandomStreams:
        """Where chance comes from."""
        return StreamsByWorld(seed, n, [len(agent.kinds) for agent in self.agents()])

    def in_mode(self, mode: str) -> Self:
        """The same task in this mode."""
        if self.mode == mode:
            return self
        found = copy.copy(self)
        found.mode = mode
        return found

    def take(self, worlds: Any, actions: np.ndarray, failed: Mapping[int, str]) -> Mapping[int, str]:
        """`act`; failed: why worlds cannot go on already, by world. Returns the same of worlds that fail now."""
        return self.act(worlds, actions) or {}

    def all_feel(self, worlds: Any, chosen: np.ndarray) -> list[Mapping[str, np.ndarray]]:
        """`feels` of every agent in the chosen worlds, by name."""
        felt, name = self.feels(worlds), f"{type(self).__name__}: feels"
        known = felt if isinstance(felt, Mapping) else {"feels": felt}
        return [{key: columns(f"{name}: {key!r}", array, worlds.n)[chosen] for key, array in known.items()}]

    def _compiled(self) -> mujoco.MjModel:
        return compiled(self)
