"""Tasks that users write, as others handle them: whether they are paid, with eyes that evolve, for arrays of worlds."""

from __future__ import annotations

import copy
from typing import TypeVar

from sim.eyes.eyes import Eyes
from sim.eyes.mounts import Mount
from sim.tasks.batch_task import BatchTask
from sim.tasks.encounter import Encounter
from sim.tasks.eye_kinds import several
from sim.tasks.per_world import PerWorld
from sim.tasks.task import Task
from sim.tasks.task_settings import TaskSettings

__all__ = ["batched", "require_rewards", "with_evolved_eyes"]

UserTask = TypeVar("UserTask", bound=TaskSettings)


def batched(task: Task | BatchTask | Encounter) -> BatchTask:
    """A user's task for arrays of worlds.

    Raises:
        ValueError: a learner has no rewards, and what `PerWorld` raises.
    """
    if isinstance(task, BatchTask):
        require_rewards(task)
        return task
    found = PerWorld(task)
    for learner in found.learners:
        require_rewards(learner)
    return found


def require_rewards(task: Task | BatchTask) -> None:
    """ValueError unless whoever learns it is paid."""
    judges = isinstance(task, BatchTask) and type(task).judge is not BatchTask.judge
    if getattr(task.rewards, "__func__", None) in (Task.rewards, BatchTask.rewards) and not judges:
        name = type(task).__name__
        raise ValueError(f"{name}: rewards: must be defined, to return numbers by name, such as {{'progress': 0.1}}")


def with_evolved_eyes(task: UserTask, eyes: Eyes, elevation_deg: float = 0.0) -> UserTask:
    """The same task for an animal with such eyes, where the task places them.

    Raises:
        ValueError: the task places another number of eyes, or none, since it has no mounts, or has several kinds; its
            `place` fails.
    """
    name, animal = type(task).__name__, copy.copy(task)
    if several(task):
        raise ValueError(f"{name}: eye and mounts have several kinds of eyes: must have one, where eyes evolve")
    if not task.mounts and type(task).place is TaskSettings.place:
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
