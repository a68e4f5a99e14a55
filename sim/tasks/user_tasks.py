"""Preparation of user tasks: conversion to a batch task, and replacement of the eyes by evolved ones."""

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
    """Return a user task as a `BatchTask`.

    Raises:
        ValueError: the task of a learner does not define rewards, or a setting is invalid, see `PerWorld`.
    """
    if isinstance(task, BatchTask):
        require_rewards(task)
        return task
    found = PerWorld(task)
    for learner in found.learners:
        require_rewards(learner)
    return found


def require_rewards(task: Task | BatchTask) -> None:
    """Check that the task of a learner defines `rewards` or, as a BatchTask, `judge`.

    Raises:
        ValueError: the task defines neither.
    """
    judges = isinstance(task, BatchTask) and type(task).judge is not BatchTask.judge
    if getattr(task.rewards, "__func__", None) in (Task.rewards, BatchTask.rewards) and not judges:
        name = type(task).__name__
        raise ValueError(f"{name}: rewards: must be defined, to return numbers by name, such as {{'progress': 0.1}}")


def with_evolved_eyes(task: UserTask, eyes: Eyes, elevation_deg: float = 0.0) -> UserTask:
    """Return a copy of the task for an animal with these eyes. The task's method `place` decides where they sit.

    The method returns a mount for each eye: the eye's position and direction on the body.

    Raises:
        ValueError: `place` fails or does not return one mount for each eye, the task has several kinds of eyes, or it
            has neither mounts nor its own `place`.
    """
    name, animal = type(task).__name__, copy.copy(task)
    if several(task):
        raise ValueError(f"{name}: eye and mounts have several kinds of eyes: must have one if eyes evolve")
    if not task.mounts and type(task).place is TaskSettings.place:
        raise ValueError(f"{name}: mounts = {task.mounts!r}: must contain at least one sim.Mount, an eye's place")
    animal.eye, animal.auxiliary = eyes.eye(), ()
    try:
        animal.mounts = tuple(task.place(eyes.n_eyes, eyes.placement_range_deg, elevation_deg))
    except (ValueError, KeyboardInterrupt):
        raise
    except BaseException as error:  # for example SystemExit, which would end the program
        raise ValueError(f"{name}: place: {type(error).__name__}: {error}") from error
    if len(animal.mounts) != eyes.n_eyes or not all(isinstance(mount, Mount) for mount in animal.mounts):
        raise ValueError(f"{name}: place returned {animal.mounts!r:.200}: must be {eyes.n_eyes} of sim.Mount")
    return animal
