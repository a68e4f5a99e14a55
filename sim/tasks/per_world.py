"""A batch task that wraps tasks of one world at a time, and calls the methods of these tasks world by world."""

from __future__ import annotations

import copy
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import mujoco
import numpy as np

from optics.numerics import number_types
from optics.numerics.arguments import shown
from sim.physics.mujoco_worlds import MujocoWorlds
from sim.physics.physics import Physics
from sim.scene.variation import Variation
from sim.tasks import batch_task, simulation
from sim.tasks import task as task_module
from sim.tasks.batch_task import Agent, BatchTask
from sim.tasks.encounter import Encounter, name_of, of_world, require_own_actuators, split_agents
from sim.tasks.eye_kinds import auxiliary_of, kinds_of
from sim.tasks.outcome import Outcome, RewardTerms
from sim.tasks.task import Task, condition, named_terms
from sim.tasks.task_settings import compiled

__all__ = ["PerWorld"]

_OURS = (__file__, number_types.__file__, task_module.__file__, batch_task.__file__, simulation.__file__)


@dataclass
class _OfWorld:
    """Outcome of one action in one world, for one learner."""

    terms: dict[str, float] = field(default_factory=dict)
    terminated: bool = False
    success: bool = False


class PerWorld(BatchTask):
    """Task for many worlds at once, which calls the methods of a `sim.Task` or `sim.Encounter` world by world.

    Its animals are those of the encounter. For a `sim.Task`, they are the task's own animal and the animals in the
    task's attribute `others`, which do not learn.

    task: the task or the encounter
    learners: tasks of the learning animals
    frozen: animals that do not learn
    animals: tasks of all animals, learners first

    Raises:
        ValueError: a setting is missing or invalid, or the animals cannot share a world.
    """

    renders_early = False  # because a user's methods may move bodies

    def __init__(self, task: Task | Encounter) -> None:
        self.task = task
        self.learners, self.frozen = split_agents(task)
        self.animals = (*self.learners, *(other.task for other in self.frozen))
        self.name = " and ".join(map(name_of, self.animals))
        self._sizes: dict[int, int] = {}  # length of each animal's proprioception, stored at its first call
        self._whose = ["" if len(self.animals) == 1 else f"{name_of(animal)}: " for animal in self.animals]
        self.model = compiled(self.animals[0])
        for animal in self.animals[1:]:
            compiled(animal, self.model)
        require_own_actuators(self.animals, self.model)
        first = self.animals[0]
        self.substeps, self.episode_steps, self.mode = first.substeps, first.episode_steps, first.mode
        for name in ("spectra", "medium", "vary", "camera"):
            setattr(self, name, of_world(self.animals, name))

    def in_mode(self, mode: str) -> Self:
        found = super().in_mode(mode)
        if found is not self:
            found.learners = tuple(_in_mode(animal, mode) for animal in self.learners)
            found.frozen = tuple(replace(other, task=_in_mode(other.task, mode)) for other in self.frozen)
            found.animals = (*found.learners, *(other.task for other in found.frozen))
        return found

    def physics(self, n: int, threads: int, variation: Variation | None) -> Physics:
        return MujocoWorlds(self.animals[0].model, self.model, n, threads, self.substeps, variation)

    def agents(self) -> tuple[Agent, ...]:
        policies = [None] * len(self.learners) + [other.policy for other in self.frozen]
        found = []
        for number, (animal, policy) in enumerate(zip(self.animals, policies, strict=True)):
            size, learns = animal.n_actions(self.model), number < len(self.learners)
            first = np.zeros(size, np.float32)
            auxiliary = auxiliary_of(animal.auxiliary, f"{type(animal).__name__}: auxiliary")
            found.append(Agent(name_of(animal), size, kinds_of(animal), auxiliary, first, learns, policy))
        return tuple(found)

    def reset(self, worlds: MujocoWorlds, chosen: np.ndarray, rngs: Sequence[np.random.Generator]) -> None:
        for world, rng in zip(chosen, rngs, strict=True):
            try:
                for animal in self.animals:
                    animal.reset(worlds.datas[world], rng)
            except BaseException as error:
                raise RuntimeError(_message(error)) from error

    def take(self, worlds: MujocoWorlds, actions: np.ndarray, failed: Mapping[int, str]) -> Mapping[int, str]:
        found, first = dict[int, str](), 0
        for animal in self.animals:
            own = actions[:, first : first + animal.n_actions(self.model)]
            first += own.shape[1]
            for world, data in enumerate(worlds.datas):
                if world not in failed and world not in found:
                    try:
                        animal.act(data, own[world])
                    except BaseException as error:
                        found[world] = _message(error)
        return found

    def judge(self, worlds: MujocoWorlds, failed: Mapping[int, str]) -> Outcome:
        """Return the outcome of an action. An episode ends for all animals as soon as one of them is terminated."""
        failure, over = dict(failed), np.zeros(worlds.n, bool)
        judged: list[list[_OfWorld]] = []
        felt: list[list[np.ndarray | None]] = [[None] * worlds.n for _ in self.animals]
        for world in range(worlds.n):
            if world not in failure:
                try:
                    outcomes, over[world] = self._judged(worlds.datas[world])
                    for own, now in zip(felt, self._felt(worlds.datas[world]), strict=True):
                        own[world] = now
                    judged.append(outcomes)
                    continue
                except BaseException as error:
                    failure[world] = _message(error)
            worlds.require_places(world)
            # Terminated, not truncated: learners must not bootstrap from the state after a failure.
            worth = [{"failure": animal.failure_reward} if animal.failure_reward else {} for animal in self.learners]
            judged.append([_OfWorld(terms, terminated=True) for terms in worth])
        rows = [outcome for of_learner in zip(*judged, strict=True) for outcome in of_learner]
        return Outcome(
            terms=RewardTerms.of_rows([row.terms for row in rows]),
            terminated=np.array([row.terminated for row in rows]),
            success=np.array([row.success for row in rows]),
            failure=failure,
            over=over,
            proprioception=[_stacked(own) for own in felt],
        )

    def all_proprioception(self, worlds: MujocoWorlds, chosen: np.ndarray) -> list[Mapping[str, np.ndarray]]:
        try:
            of_worlds = [self._felt(worlds.datas[world]) for world in chosen]
            return [_stacked(list(own)) for own in zip(*of_worlds, strict=True)]
        except BaseException as error:
            raise RuntimeError(_message(error)) from error

    def _judged(self, data: mujoco.MjData) -> tuple[list[_OfWorld], bool]:
        """Return the outcome for every learner, and whether any animal ends the episode."""
        outcomes, over = [], False
        for animal, whose in zip(self.learners, self._whose, strict=False):
            terms = named_terms(animal, data, whose)
            ended = condition(f"{whose}terminated", animal.terminated(data))
            done = condition(f"{whose}succeeded", animal.succeeded(data))
            outcomes.append(_OfWorld(terms, terminated=ended, success=done))
            over |= ended
        for other in self.frozen:
            over |= condition(f"{name_of(other.task)}: terminated", other.task.terminated(data))
        return outcomes, over

    def _felt(self, data: mujoco.MjData) -> list[np.ndarray]:
        """Return the proprioception (k,) of every animal in a world.

        Raises:
            ValueError: a method did not return a row of finite numbers, or the row has another length than before.
        """
        found = []
        for number, (animal, whose) in enumerate(zip(self.animals, self._whose, strict=True)):
            felt = _row(f"{whose}proprioception", animal.proprioception(data))
            if felt.ndim != 1 or not np.isfinite(felt).all():
                raise ValueError(f"{whose}proprioception returned {felt!r:.100}: must be finite numbers, (k,)")
            size = self._sizes.get(number) or self._sizes.setdefault(number, len(felt))
            if len(felt) != (size or len(felt)):
                raise ValueError(f"{whose}proprioception returned {len(felt)} numbers: must be {size}, as before")
            self._sizes[number] = len(felt)
            found.append(felt)
        return found


def _row(where: str, returned: object) -> np.ndarray:
    """Convert the return value of a method to a float32 array; ValueError unless it consists of real numbers."""
    given = number_types.real_array(where, returned)
    if given is None:
        raise ValueError(f"{where} returned {shown(returned)}: must be finite numbers, (k,)")
    return given.astype(np.float32)


def _in_mode(task: Task, mode: str) -> Task:
    found = copy.copy(task)
    found.mode = mode
    return found


def _stacked(felt: Sequence[np.ndarray | None]) -> dict[str, np.ndarray]:
    """Return an animal's proprioception as {"feels": (world, value)}.

    Rows of worlds without new values (None) are NaN. The result is empty if no world has values.
    """
    size = next((len(row) for row in felt if row is not None), 0)
    if not size:
        return {}
    return {"feels": np.array([np.full(size, np.nan, np.float32) if row is None else row for row in felt])}


def _message(error: BaseException) -> str:
    """Return the message of an error, with the function and line of the user's code in which it occurred, if any.

    The error may be a SystemExit or another exception that would end the program. Only Ctrl-C is raised again.
    """
    if isinstance(error, KeyboardInterrupt):
        raise error
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename not in _OURS:
            place = f"{frame.name}, line {frame.lineno} of {Path(frame.filename).name}"
            return f"{place}: {type(error).__name__}: {error}"
    return str(error)
