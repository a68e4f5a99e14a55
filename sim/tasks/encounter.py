"""Several animals in one world, each with its own task. Each animal learns or has a fixed policy."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from optics.numerics.arguments import did_you_mean, of_kind, shown
from optics.numerics.number_types import readable
from sim.physics.controls import actuator_names
from sim.tasks.batch_task import BatchTask
from sim.tasks.task import Task

# Number of axes of the eyes' signals: memory, eye, channel, height and width. No other entry of an observation has
# five axes. The signals of compound eyes have three, and their space has viewing directions (`OmmatidiaBox`).
FRAMES_AXES = 5
SAID_BY_ANY = ("spectra", "medium", "vary")  # settings of the world that the task of one animal may set for all
SHARED = ("substeps", "episode_steps")  # settings of the world that must be equal in the tasks of all animals


@dataclass(frozen=True, eq=False)
class Frozen:
    """An animal that does not learn, in the world of an animal that learns.

    The task of the learning animal has an attribute `others`, which lists all animals that do not learn.

    task: task of the animal that does not learn. It defines the animal's eyes and actions, and the condition on which
        the animal ends an episode; the rewards and the `others` of this task are not used
    policy: an object with the method `predict` of stable-baselines3 (a learner, or the return value of
        `evolve.load_policy`), or a function. The function receives the observations of all worlds, as in
        `make_vec_env`, and returns the actions (world, value). None: the actions are zeros, and the animal's eyes are
        not rendered.

    Raises:
        ValueError: `task` is not a sim.Task, or `policy` is neither a function nor an object with `predict`.
    """

    task: Task
    policy: Any = None

    def __post_init__(self) -> None:
        of_kind("Frozen: task", self.task, Task, "Predator()")
        if self.policy is not None and not callable(getattr(self.policy, "predict", self.policy)):
            raise ValueError(f"Frozen: policy = {shown(self.policy)}: must be a function, have `predict`, or be None")
        object.__setattr__(self, "task", among(self.task, ()))

    @property
    def memory(self) -> int:
        """Number of frames in the observations that the policy expects; 1 if it states no number."""
        known = getattr(getattr(self.policy, "observation_space", None), "spaces", {})
        eyes = [one for one in known.values() if len(one.shape) == FRAMES_AXES or hasattr(one, "directions")]
        return max((one.shape[0] for one in eyes), default=1)

    def actions(self, observation: Mapping[str, np.ndarray], shape: tuple[int, int]) -> np.ndarray:
        """Return the animal's actions in every world.

        observation: the animal's observations in all worlds, by name, as in `sim.make_vec_env`
        shape: shape of the actions, (world, value)

        Raises:
            RuntimeError: the policy fails, or returns actions of another shape.
        """
        try:
            predict = getattr(self.policy, "predict", None)
            found = self.policy(observation) if predict is None else predict(observation, deterministic=True)[0]
            actions = np.asarray(readable("actions", found), np.float32)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            said = " ".join(f"{type(error).__name__}: {error}".split())
            raise RuntimeError(f"policy of {name_of(self.task)!r}: {said}") from error
        if actions.shape != shape:
            raise RuntimeError(
                f"policy of {name_of(self.task)!r} returned actions of shape {actions.shape}: must be {shape}"
            )
        return actions


class Encounter:
    """Animals in one world that see each other, such as `sim.Encounter(Prey(), Predator())`.

    animals: tasks of the animals. All tasks use the same model, in which each animal has its own body, actuators and
        eyes. The `name` of a task is the name of its animal.

    Raises:
        ValueError: there are no animals, two animals have the same name, two tasks have different models or settings
            of the world, a task lists further animals in its attribute `others`, or an argument is not a sim.Task.
    """

    def __init__(self, *animals: Task) -> None:
        self.animals = together(animals, "Encounter")
        for animal, name in zip(animals, self.names, strict=True):
            if animal.others:
                raise ValueError(f"Encounter: {name} has its own `others`: must be a task without any")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the animals."""
        return tuple(map(name_of, self.animals))

    def alone(self, name: str, policies: Mapping[str, Any]) -> Task:
        """Return the task of one learning animal, for `make_vec_env` and `make_env`. The other animals do not learn.

        name: name of the learning animal
        policies: policies of other animals, by name, see `sim.Frozen`; {}: none. The actions of an animal without a
            policy are zeros

        Raises:
            ValueError: `name` or a key of `policies` is not an animal's name, `policies` contains the learning animal,
                or a policy is neither a function nor an object with `predict`.
        """
        of_kind("policies", policies, Mapping, "{'Predator': policy}, or {}")
        for asked in (name, *policies):
            if not isinstance(asked, str) or asked not in self.names:
                known = did_you_mean(asked, self.names) or f": it has {', '.join(self.names)}"
                raise ValueError(f"Encounter: no animal {shown(asked)}{known}")
        if name in policies:
            raise ValueError(f"Encounter: policies: {name!r} is the one that learns: must be left out")
        rest = [animal for animal in self.animals if name_of(animal) != name]
        frozen = [Frozen(animal, policies.get(name_of(animal))) for animal in rest]
        return among(self.animals[self.names.index(name)], frozen)


def among(task: Task, others: Sequence[Frozen]) -> Task:
    """Return a copy of the task with these animals as its `others`."""
    learner = copy.copy(task)
    learner.others = tuple(others)
    return learner


def name_of(task: Task) -> str:
    """Return the name of the animal that has this task."""
    return type(task).__name__ if task.name is None else str(task.name)


def split_agents(task: Task | Encounter) -> tuple[tuple[Task, ...], tuple[Frozen, ...]]:
    """Return the tasks of the learning animals, and the animals that do not learn.

    Raises:
        ValueError: the animals cannot share a world, or an entry of the task's `others` is not a sim.Frozen.
    """
    if isinstance(task, Encounter):
        return task.animals, ()
    where = f"{type(task).__name__}: others"
    for other in task.others:
        of_kind(where, other, Frozen, "sim.Frozen(Predator(), policy)")
    together((task, *(other.task for other in task.others)), where)
    return (task,), tuple(task.others)


def of_world(animals: Sequence[Task], what: str) -> Any:
    """Return the world's setting with the name `what` from the first task that sets it; None if no task does."""
    return next((said for animal in animals if (said := getattr(animal, what))), None)


def require_own_actuators(animals: Sequence[Task], model: mujoco.MjModel) -> None:
    """Check that animals with the default `act` have separate actuators.

    Raises:
        ValueError: two animals drive the same actuator, so that one would overwrite the other's control.
    """
    owner: dict[str, str] = {}
    for animal in animals:
        if type(animal).act is not Task.act:
            continue
        name, driven = name_of(animal), animal.actuators
        for one in actuator_names(model) if driven is None else driven:
            if owner.setdefault(one, name) != name:
                raise ValueError(f"{owner[one]} and {name}: actuators: both drive {one!r}: must name their own")


def together(animals: Sequence[Task], where: str) -> tuple[Task, ...]:
    """Return the animals' tasks after checking that the animals can share a world.

    where: beginning of the error message

    Raises:
        ValueError: the animals cannot share a world; the message states the reason.
    """
    if not animals:
        raise ValueError(f"{where}: no animals: must be one sim.Task at least")
    for animal in animals:
        given: object = animal
        if isinstance(given, str | BatchTask):
            label = given if isinstance(given, str) else type(given).__name__
            raise ValueError(
                f"{where}: {label!r} has the body of one agent: must be a sim.Task, whose model has several"
            )
        of_kind(where, animal, Task, "Prey()")
    names = [name_of(animal) for animal in animals]
    first, first_name = animals[0], names[0]
    for number, (name, animal) in enumerate(zip(names, animals, strict=True)):
        if name in names[:number]:
            raise ValueError(f"{where}: two animals are called {name!r}: must differ, give one of them another `name`")
        if number and not _same_model(first, animal):
            raise ValueError(f"{where}: {first_name} and {name} have different models: must be one model for all")
        for what in SHARED:
            values = getattr(first, what), getattr(animal, what)
            if values[0] != values[1]:
                raise ValueError(f"{where}: {what} = {values[0]} of {first_name}, {values[1]} of {name}: must be equal")
    for what in SAID_BY_ANY:
        said = [(name, value) for name, animal in zip(names, animals, strict=True) if (value := getattr(animal, what))]
        for name, value in said[1:]:
            if value != said[0][1]:
                raise ValueError(f"{where}: {what} of {said[0][0]} and of {name} differ: must be equal, or set once")
    return tuple(animals)


def _same_model(one: Task, other: Task) -> bool:
    models = [getattr(task, "model", None) for task in (one, other)]
    if models[0] is models[1]:
        return True
    return all(isinstance(model, str | Path) for model in models) and str(models[0]) == str(models[1])
