"""Tasks on arrays of all worlds: each method computes its result for the whole batch at once."""

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
from sim.tasks.batch_arrays import columns, mapping, not_finite, require_worlds, rows
from sim.tasks.command import Command
from sim.tasks.eye_kinds import EyeKind, auxiliary_of, kinds_of
from sim.tasks.outcome import Outcome, RewardTerms
from sim.tasks.random_streams import RandomStreams, StreamsByWorld
from sim.tasks.task_settings import TaskSettings, compiled
from sim.worlds.ground_plan import GroundPlan

__all__ = ["Agent", "BatchTask"]


@dataclass(frozen=True, eq=False)
class Agent:
    """Description of an animal for an environment. The animal exists once in every world.

    name: name of the animal
    n_actions: number of values in an action
    kinds: kinds of its eyes
    auxiliary: names of the auxiliary entries of its observation, which have values for each receptor
    first_action: value of the observation's entry "previous_action" at the beginning of an episode
    learns: True if the caller of the environment chooses its actions; False if `policy` does
    policy: policy of an animal that does not learn; None: its actions are zeros
    """

    name: str
    n_actions: int
    kinds: tuple[EyeKind, ...]
    auxiliary: tuple[str, ...] = ()
    first_action: np.ndarray = field(default_factory=lambda: np.zeros(1, np.float32))
    learns: bool = True
    policy: Any = None


class BatchTask(TaskSettings):
    """A task whose methods receive all worlds at once.

    A subclass must define `model`, `mounts`, and `rewards` or `judge`. It has all settings of `sim.Task` except
    `others`, and the settings listed below. Arrays have one row for each world. The argument `worlds` of the methods
    is the object that `physics` returns. The default physics is `sim.ArrayWorlds`, which stacks MuJoCo's arrays
    (`worlds.qpos`, `worlds.xpos` ...) over worlds. The built-in tasks use `sim.SlidingAgents`. `sim.check_batch_task`
    tests whether a task follows this description.

    An exception in a method ends the simulation of all worlds, and reaches the caller of the environment unchanged.
    The environment raises a ValueError if a method returns an invalid array.

    renders_early: if True, rendering may begin before an action is judged, which is faster. In this case, `rewards`,
        `terminated`, `succeeded` and `proprioception` must not move bodies in a world, unless `judge` returns an
        outcome that lists this world in `Outcome.changed`.
    proprioception_ranges: (lowest, highest) value of each entry of `proprioception`, by name; an entry that is
        not listed has no limits
    ramped: terms of the reward whose weight `evolve` reduces at the beginning of training if the setting
        `learning.contact_ramp` is above 0
    counted: terms of the reward that are counted in reports: for each term, the title of its row in a report's table.
        The row shows in how many actions of an episode the term was not 0
    compared_light: level of light (see `Fidelity`) with which `evolve` compares eyes, for example "direct"; None: the
        level in `fidelity`
    """

    renders_early: bool = True
    proprioception_ranges: Mapping[str, tuple[float, float]] = {}
    ramped: Sequence[str] = ()
    counted: Mapping[str, str] = {}
    compared_light: str | None = None

    def reset(self, worlds: Any, chosen: np.ndarray, rngs: Sequence[np.random.Generator]) -> None:
        """Start episodes in the chosen worlds.

        The default keeps the state after mj_resetData.

        chosen: indices of the worlds, (k,) int
        rngs: random number generator of each chosen world
        """

    def act(self, worlds: Any, actions: np.ndarray) -> Mapping[int, str] | None:
        """Apply actions in [-1, 1], (n, n_actions). The physics then simulates the worlds for one action.

        The default maps [-1, 1] to the full range of each control of the task's actuators; a control without limits
        gets the value itself.

        Return the worlds that cannot continue, by index, each with the reason. None means that all can continue.
        """
        mine = controls_of(worlds.model, self.actuators)
        limited = worlds.model.actuator_ctrllimited[mine].astype(bool)
        low, high = np.where(limited[:, None], worlds.model.actuator_ctrlrange[mine], [-1.0, 1.0]).T
        worlds.ctrl[:, mine] = low + (high - low) * (actions + 1) / 2
        return None

    def rewards(self, worlds: Any) -> Mapping[str, np.ndarray]:
        """Return the terms of the reward for the last action, by name, (n,) each. The reward is their sum.

        A world in which a term is not finite fails, and its episode ends.
        """
        raise NotImplementedError

    def terminated(self, worlds: Any) -> np.ndarray:
        """Return whether the episode of each world ends after this action, (n,) bool."""
        return np.zeros(worlds.n, bool)

    def succeeded(self, worlds: Any) -> np.ndarray:
        """Return whether the task is accomplished in each world, (n,) bool. This is `info["is_success"]`."""
        return np.zeros(worlds.n, bool)

    def proprioception(self, worlds: Any) -> np.ndarray | Mapping[str, np.ndarray]:
        """Return the part of the observation that does not come from eyes, (n, k), or several such arrays by name.

        All values must be finite. By default, there is no such part.
        """
        return {}

    def judge(self, worlds: Any, failed: Mapping[int, str]) -> Outcome:
        """Return the outcome of the last action.

        The default calls `rewards`, `terminated` and `succeeded`. A task that computes all three together overrides
        this method.

        failed: the worlds that could not continue, each with the reason

        Raises:
            ValueError: `rewards` did not return a mapping, or a method did not return numbers of the right shape.
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
        # Terminated, not truncated: learners must not bootstrap from the state after a failure.
        terminated[broken] = True
        for term in terms.values():
            term[broken] = 0.0
        if failure and self.failure_reward:
            terms["failure"] = np.zeros(n)
            terms["failure"][broken] = self.failure_reward
        stacked = np.array(list(terms.values())).reshape(len(terms), n)
        return Outcome(RewardTerms(list(terms), stacked), terminated, success, failure)

    def first_info(self, worlds: Any, chosen: np.ndarray) -> Sequence[Mapping[str, Any]] | None:
        """Return additional entries of `info` at the start of an episode, a mapping for each chosen world.

        None: no additions.
        """
        return None

    def commands(self) -> tuple[Command, ...]:
        """Return the meaning of each number in the first agent's action: a name, a unit and a scale.

        By default, the names are "0", "1" ...
        """
        return tuple(Command(str(number)) for number in range(self.agents()[0].n_actions))

    def solved(self, before: bool | None, info: Mapping[str, Any]) -> bool | None:
        """Return whether an episode counts as solved after one more action; None while this is undecided.

        This method is called after every action. By default, an episode is solved if `succeeded` is true after its
        last action.

        before: return value of this method after the previous action; None after the first action
        info: `info` of the last action
        """
        return bool(info["is_success"])

    def azimuths(self) -> np.ndarray:
        """Return the azimuths of the first agent's eyes of the first kind [rad], (eye,).

        They are relative to the forward direction of the object on which the eyes are mounted.
        """
        return np.radians([mount.azimuth_deg for mount in self.agents()[0].kinds[0].mounts])

    def ground_plan(self, place: np.ndarray) -> GroundPlan | None:
        """Return a plan, seen from above, of the surroundings of `place` (2,) [m]; None if the task has no plan.

        Without a plan, reports show images of the task's camera instead.
        """
        return None

    # Only tasks with their own physics, agents or random streams override the following methods.

    def physics(self, n: int, threads: int, variation: Variation | None) -> Physics:
        """Return the physics of `n` worlds.

        threads: number of threads that may compute it
        variation: ranges of the quantities that differ between episodes; None: there are none
        """
        return ArrayWorlds(self.model, self._compiled(), n, threads, self.substeps, variation)

    def agents(self) -> tuple[Agent, ...]:
        """Return the agents in each world. Agents that learn come first."""
        n_actions = self.n_actions(self._compiled())
        label = type(self).__name__ if self.name is None else str(self.name)
        first = np.zeros(n_actions, np.float32)
        auxiliary = auxiliary_of(self.auxiliary, f"{type(self).__name__}: auxiliary")
        return (Agent(label, n_actions, kinds_of(self), auxiliary, first),)

    def streams(self, seed: Any, n: int) -> RandomStreams:
        """Return the random number generators ("streams") of the worlds.

        seed: a seed for all worlds, None for a random seed, or a tuple with a seed for each world
        """
        return StreamsByWorld(seed, n, [len(agent.kinds) for agent in self.agents()])

    def in_mode(self, mode: str) -> Self:
        """Return the task in the mode "training", "evaluation" or "test": a copy, unless it already has this mode."""
        if self.mode == mode:
            return self
        found = copy.copy(self)
        found.mode = mode
        return found

    def take(self, worlds: Any, actions: np.ndarray, failed: Mapping[int, str]) -> Mapping[int, str]:
        """Call `act`, and return the worlds that fail in this call, each with the reason.

        failed: the worlds that have already failed, each with the reason

        Raises:
            ValueError: `act` returned neither None nor a mapping from indices of worlds.
        """
        broken = self.act(worlds, actions)
        if broken is None:
            return {}
        where = f"{type(self).__name__}: act"
        require_worlds(where, mapping(where, broken, "{0: 'fell over'}, or None"), worlds.n)
        return broken

    def all_proprioception(self, worlds: Any, chosen: np.ndarray) -> list[Mapping[str, np.ndarray]]:
        """Return the proprioception of every agent in the chosen worlds.

        The list has one entry for each agent: a mapping from names to arrays (chosen world, value).

        Raises:
            ValueError: `proprioception` did not return one row of finite numbers for each world.
        """
        felt, name = self.proprioception(worlds), f"{type(self).__name__}: proprioception"
        known = felt if isinstance(felt, Mapping) else {"feels": felt}
        found = {key: columns(f"{name}: {key!r}", array, worlds.n) for key, array in known.items()}
        if len(chosen) < worlds.n:
            found = {key: array[chosen] for key, array in found.items()}
        return [found]

    def _compiled(self) -> mujoco.MjModel:
        return compiled(self)
