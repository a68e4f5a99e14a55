"""A task of one's own: a robot with eyes, how an episode begins, and what a step is worth."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from sim.eyes.eyes import Eyes
from sim.eyes.mounts import Mount, fan
from sim.physics.controls import controls_of
from sim.tasks.eye_kinds import several
from sim.tasks.task_settings import TaskSettings

if TYPE_CHECKING:
    from sim.tasks.encounter import Frozen


class Task(TaskSettings):
    """A task of one world at a time, in plain Python; only `model`, `mounts` and `rewards` have no default.

    The settings are those of `TaskSettings`, and one more:

    others: animals in the same world that do not learn, see `sim.Frozen`; each has a body, actuators and eyes of its
        own in the one model. Then an episode begins with everybody's `reset`, in turn, and ends as soon as anybody's
        `terminated` says so: it is truncated for those whose own does not

    Where the task evolves (`evolve run FILE.py:CLASS`), every animal has eyes of its own, where `place` puts them; a
    class without arguments is needed for that.

    What fails in a method ends its world's episode; in `reset`, and in `feels` there, it is a RuntimeError for all,
    since a world that cannot begin has no episode.

    Methods are called for one world at a time, with its mjData after mj_forward. One task serves all worlds: what an
    episode must remember belongs into mjData (`userdata`, say), not into the task. A `sim.BatchTask` has the same
    methods for arrays of all worlds, which is faster.
    """

    others: Sequence[Frozen] = ()

    def reset(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """Begin an episode: change what mj_resetData has left. `data.model` may be changed, too, for the episode."""

    def act(self, data: mujoco.MjData, action: np.ndarray) -> None:
        """Take an action in [-1, 1], (n_actions,); here: each control of its actuators over the whole of its range."""
        model, mine = data.model, controls_of(data.model, self.actuators)
        limited = model.actuator_ctrllimited[mine].astype(bool)
        low, high = np.where(limited[:, None], model.actuator_ctrlrange[mine], [-1.0, 1.0]).T
        data.ctrl[mine] = low + (high - low) * (action + 1) / 2

    def rewards(self, data: mujoco.MjData) -> Mapping[str, float]:
        """What the step that led here is worth, by named terms; the reward is their sum."""
        raise NotImplementedError

    def terminated(self, data: mujoco.MjData) -> bool:
        """Whether the episode ends here."""
        return False

    def succeeded(self, data: mujoco.MjData) -> bool:
        """Whether what was to be done is done: `info["is_success"]`."""
        return False

    def feels(self, data: mujoco.MjData) -> np.ndarray:
        """What the animal knows beside what it sees, (k,); here: nothing."""
        return np.zeros(0)

    def place(self, n_eyes: int, placement_range_deg: float, elevation_deg: float) -> Sequence[Mount]:
        """Where an evolving animal has its eyes; here: the first of `mounts`, fanned out, see `sim.fan`."""
        assert not isinstance(self.mounts, Mapping)
        return fan(self.mounts[0], n_eyes, placement_range_deg, elevation_deg)


def require_rewards(task: Task) -> None:
    """ValueError unless whoever learns it is paid."""
    if getattr(task.rewards, "__func__", None) is Task.rewards:
        name = type(task).__name__
        raise ValueError(f"{name}: rewards: must be defined, to return numbers by name, such as {{'progress': 0.1}}")


def grown(task: Task, eyes: Eyes, elevation_deg: float = 0.0) -> Task:
    """The same task for an animal with such eyes, where the task places them.

    Raises:
        ValueError: the task places another number of eyes, or none, since it has no mounts, or has several kinds; its
            `place` fails.
    """
    name, animal = type(task).__name__, copy.copy(task)
    if several(task):
        raise ValueError(f"{name}: eye and mounts have several kinds of eyes: must have one, where eyes evolve")
    if not task.mounts and type(task).place is Task.place:
        raise ValueError(f"{name}: mounts = {task.mounts!r}: must hold one sim.Mount at least, where the eyes are")
    animal.eye, animal.auxiliary = eyes.eye(), ()
    try:
        animal.mounts = tuple(task.place(eyes.n_eyes, eyes.placement_range_deg, elevation_deg))
    except ValueError:
        raise
    except Exception as error:
        raise ValueError(f"{name}: place: {type(error).__name__}: {error}") from error
    if len(animal.mounts) != eyes.n_eyes or not all(isinstance(mount, Mount) for mount in animal.mounts):
        raise ValueError(f"{name}: place returned {animal.mounts!r:.200}: must be {eyes.n_eyes} of sim.Mount")
    return animal


def named_terms(task: Task, data: mujoco.MjData, whose: str = "") -> dict[str, float]:
    """Its rewards; whose: what a message begins with.

    Raises:
        ValueError: they are no finite numbers by name.
    """
    terms: Any = task.rewards(data)
    if not isinstance(terms, Mapping):
        raise ValueError(f"{whose}rewards returned {terms!r}: must be numbers by name, such as {{'progress': 0.1}}")
    for name, value in terms.items():
        if not np.isscalar(value) or not np.isfinite(value):
            raise ValueError(f"{whose}rewards: {name!r} is {value!r}: must be one finite number")
    return {str(name): float(value) for name, value in terms.items()}
