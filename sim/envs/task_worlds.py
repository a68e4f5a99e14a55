"""Many worlds of a task of one's own: physics and the own methods of the tasks of all animals, world by world."""

from __future__ import annotations

import copy
import traceback
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from sim.scene.variation import Variation
from sim.scene.world_models import WorldModels
from sim.tasks import user_task as task_module
from sim.tasks.encounter import Encounter, cast, name_of, of_world, require_own_actuators
from sim.tasks.eye_kinds import kinds_of
from sim.tasks.user_task import Task, compiled, named_terms

_UNSTABLE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
_OURS = (__file__, task_module.__file__)


@dataclass
class StepOfWorld:
    """Of one action in one world, for one animal that learns. failure: what went wrong in the tasks' own methods, which
    ends the episode"""

    terms: dict[str, float] = field(default_factory=dict)
    terminated: bool = False
    truncated: bool = False
    success: bool = False
    failure: str | None = None


class TaskWorlds:
    """Their data, and what is done with it.

    task: of the animal that learns, with its others; or an Encounter, where all learn
    episode_steps: actions, then an episode is truncated; None: as many as the task has
    learners: tasks of those who learn · frozen: the others · animals: tasks of all, those who learn first
    model · bodies: models of every world, where they differ · datas: mjData of every world
    steps: actions taken in its episode, (n,) int
    variation: what differs between episodes; None: nothing
    varied: how it is now, by name: (n,) or (n, 3), numbers or names
    felt: what each animal feels now, by animal: (n, numbers) float32
    rngs: of each world's episodes · noise_keys: of receptors, by animal: (kind of eyes, n)
    entropy: what all random streams come from; seeded with it again, everything happens again
    """

    def __init__(
        self, task: Task | Encounter, n: int, seed: int | None, threads: int = 1, episode_steps: int | None = None
    ) -> None:
        self.learners, self.frozen = cast(task)
        self.animals = (*self.learners, *(other.task for other in self.frozen))
        self._whose = ["" if len(self.animals) == 1 else f"{name_of(animal)}: " for animal in self.animals]
        self._who = " and ".join(map(name_of, self.animals))
        self.model = compiled(self.animals[0])
        for animal in self.animals[1:]:
            compiled(animal, self.model)
        require_own_actuators(self.animals, self.model)
        self.spectra = of_world(self.animals, "spectra")
        self.episode_steps = self.animals[0].episode_steps if episode_steps is None else episode_steps
        vary = of_world(self.animals, "vary")
        self.variation = Variation(vary) if vary else None
        self.varied = {} if self.variation is None else self.variation.blank(n)
        self.bodies = WorldModels(self.animals[0].model, self.model, n, self.variation)
        self.datas = [mujoco.MjData(model) for model in self.bodies.models]
        self.steps, self.felt = np.zeros(n, int), [np.zeros((n, 0), np.float32) for _ in self.animals]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self.seed(seed)
        self._begin(0)  # what an animal feels may want an episode
        if self.bodies.differs():
            self.bodies.separate()
            self.datas = [mujoco.MjData(model) for model in self.bodies.models]
            self._begin(0)
        # What eyes are made for: as the first `reset` leaves it, which may paint or light what stands still. Where
        # worlds share it, it is theirs: what is changed of it outside, is changed for all of them.
        if not self.bodies.varied:
            self.model = copy.copy(self.bodies.models[0]) if self.bodies.own else self.bodies.models[0]
        self.felt = [np.repeat(felt[:1], n, axis=0) for felt in self.felt]
        self.seed(self.entropy)

    def seed(self, seed: Any) -> None:
        """Begin all random streams anew; world i's depends on the seed and i alone."""
        self.entropy = np.random.SeedSequence(seed).entropy
        children = [np.random.SeedSequence(self.entropy, spawn_key=(i,)) for i in range(len(self.datas))]
        self.rngs = [np.random.default_rng(child) for child in children]
        self.noise_keys = self._noise_keys(children)

    def _noise_keys(self, children: Sequence[np.random.SeedSequence]) -> list[np.ndarray]:
        """The first kind of everybody has the first ones: a kind more changes nobody else's noise."""
        kinds = [len(kinds_of(animal)) for animal in self.animals]
        drawn = np.array([child.generate_state(sum(kinds), np.uint64) for child in children]).T
        more, found = len(kinds), []
        for number, count in enumerate(kinds):
            found.append(np.concatenate([drawn[number : number + 1], drawn[more : more + count - 1]]))
            more += count - 1
        return found

    def reset(self, worlds: np.ndarray) -> None:
        """Begin these worlds' episodes.

        Raises:
            RuntimeError: a task's own reset fails, by its name, line and message, or changes the model of all worlds.
        """
        with self.bodies.left_alone(self._who):
            for i in worlds:
                self._begin(i)

    def _begin(self, world: int) -> None:
        """Begin a world's episode."""
        data, model = self.datas[world], self.bodies.models[world]
        drawn = {} if self.variation is None else self.variation.draw(self.rngs[world])
        for name, value in drawn.items():
            self.varied[name][world] = value
        self.bodies.begin(world, drawn)
        mujoco.mj_resetData(model, data)
        self.bodies.place(data, drawn)
        try:
            for animal in self.animals:
                animal.reset(data, self.rngs[world])
            mujoco.mj_forward(model, data)
            self._feel(world)
        except Exception as error:
            raise RuntimeError(_told(error)) from error
        self.steps[world] = 0

    def step(self, actions: Sequence[np.ndarray]) -> list[StepOfWorld]:
        """Every animal's actions (world, number) in every world; what comes of them for the first that learns in all
        worlds, then for the next.

        Raises:
            RuntimeError: a task changes the model of all worlds.
        """
        with self.bodies.left_alone(self._who):
            failures = self._acted(actions)
            moving = [data for data, failure in zip(self.datas, failures, strict=True) if failure is None]
            for _ in (self._pool.map if self._pool else map)(self._moved, moving):
                pass
            self.steps += 1
            judged = [self._judged(i, failure) for i, failure in enumerate(failures)]
        return [outcome for of_learner in zip(*judged, strict=True) for outcome in of_learner]

    def told(self, world: int) -> dict[str, Any]:
        """How a world differs from others, for its `info`; nothing where they do not differ."""
        varied = {name: _plain(values[world]) for name, values in self.varied.items()}
        return {"varied": varied} if varied else {}

    def light(self, wavelengths: np.ndarray) -> np.ndarray | None:
        """What lights are multiplied by now, (n, band); None: nothing."""
        return None if self.variation is None else self.variation.light(self.varied, wavelengths)

    def close(self) -> None:
        if self._pool:
            self._pool.shutdown()

    def _acted(self, actions: Sequence[np.ndarray]) -> list[str | None]:
        """What failed in each world, if anything did."""
        failures: list[str | None] = [None] * len(self.datas)
        for animal, whose, commanded in zip(self.animals, self._whose, actions, strict=True):
            finite, limited = np.isfinite(commanded).all(axis=1), np.clip(commanded, -1, 1)
            for i, data in enumerate(self.datas):
                if failures[i] is not None:
                    continue
                if not finite[i]:
                    failures[i] = f"{whose}action is not finite"
                    continue
                try:
                    animal.act(data, limited[i])
                except Exception as error:
                    failures[i] = _told(error)
        return failures

    def _moved(self, data: mujoco.MjData) -> None:
        mujoco.mj_step(data.model, data, self.animals[0].substeps)
        mujoco.mj_forward(data.model, data)

    def _feel(self, world: int) -> None:
        """What the world's animals feel.

        Raises:
            ValueError: these are not as many numbers as ever, or not finite.
        """
        for number, (animal, whose) in enumerate(zip(self.animals, self._whose, strict=True)):
            felt = np.asarray(animal.feels(self.datas[world]), np.float32)
            if felt.ndim != 1 or not np.isfinite(felt).all():
                raise ValueError(f"{whose}feels returned {felt!r:.100}: must be finite numbers, (k,)")
            if not self.felt[number].shape[1]:
                self.felt[number] = np.zeros((len(self.datas), len(felt)), np.float32)
            size = self.felt[number].shape[1]
            if len(felt) != size:
                raise ValueError(f"{whose}feels returned {len(felt)} numbers: must be {size}, as before")
            self.felt[number][world] = felt

    def _judged(self, world: int, failure: str | None) -> list[StepOfWorld]:
        """What the step is worth to each that learns. The episode ends for all as soon as it ends for anybody."""
        data = self.datas[world]
        if failure is None:
            failure = _broken(data)
        outcomes: list[StepOfWorld] = []
        over = self.steps[world] >= self.episode_steps
        if failure is None:
            try:
                for animal, whose in zip(self.learners, self._whose, strict=False):
                    terms = named_terms(animal, data, whose)
                    ended, done = bool(animal.terminated(data)), bool(animal.succeeded(data))
                    outcomes.append(StepOfWorld(terms, terminated=ended, success=done))
                    over |= ended
                over |= any(other.task.terminated(data) for other in self.frozen)
                self._feel(world)
            except Exception as error:
                failure = _told(error)
        if failure is not None:
            if not _has_place(data):  # else the last look at it would end all worlds
                mujoco.mj_resetData(data.model, data)
                mujoco.mj_forward(data.model, data)
            # Not truncated: nothing might have come after it that a learner could count with.
            worth = [{"failure": animal.failure_reward} if animal.failure_reward else {} for animal in self.learners]
            return [StepOfWorld(terms, terminated=True, failure=failure) for terms in worth]
        for outcome in outcomes:
            outcome.truncated = bool(over) and not outcome.terminated
        return outcomes


def _broken(data: mujoco.MjData) -> str | None:
    """How its physics broke down, if it did. MuJoCo has begun it anew by then, unless its model forbids that."""
    if any(data.warning[kind].number for kind in _UNSTABLE):
        return (
            "physics is unstable: positions, speeds or accelerations are huge or not finite; a shorter timestep or "
            "the integrator implicitfast may help"
        )
    if data.warning[mujoco.mjtWarning.mjWARN_BADCTRL].number:  # MuJoCo has taken all controls of the world for 0
        return "controls are huge or not finite: what `act` writes must be numbers, of 1e10 at most"
    if not _has_place(data):
        return "physics is unstable: places of bodies are not finite; what `act` writes must be"
    return None


def _has_place(data: mujoco.MjData) -> bool:
    """Whether all that is seen of it is somewhere."""
    return all(np.isfinite(places).all() for places in (data.xpos, data.xmat, data.geom_xpos))


def _told(error: Exception) -> str:
    """Where in the user's file it happened, if it did there, and what."""
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename not in _OURS:
            place = f"{frame.name}, line {frame.lineno} of {Path(frame.filename).name}"
            return f"{place}: {type(error).__name__}: {error}"
    return str(error)


def _plain(value: np.ndarray) -> str | float | tuple[float, ...]:
    """A name, a number, or three."""
    if value.dtype.kind == "U":
        return str(value)
    return tuple(map(float, value)) if value.ndim else float(value)
