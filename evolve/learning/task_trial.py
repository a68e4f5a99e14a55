"""Checks before a run starts.

The checks draw the random layouts, search a user task for settings that would have no effect, and try the task for a
few steps. A fault that these checks find would affect every animal of the run.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np

from evolve.config.checks import AUTO, ConfigError
from evolve.config.run_config import RunConfig
from evolve.config.settings import FAMILY
from evolve.config.task_card import OF_LAYOUTS
from evolve.config.task_errors import error_in_task
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from rhabdom.streams import open_closed_streams

if TYPE_CHECKING:
    from sim.envs.vec_env import EyesVecEnv
    from sim.tasks.task_settings import TaskSettings

__all__ = ["UnusedSettingWarning", "check_layouts", "check_settings", "try_task"]

WORLDS, ACTIONS = 2, 4  # numbers of worlds and of actions in a trial


class UnusedSettingWarning(UserWarning):
    """A user task defines a setting that has no effect on a run."""


def check_settings(config: RunConfig) -> None:
    """Refuse a user task with mounts (places for eyes) that no animal would use. Warn about other unused settings.

    The default method `place` of a task spreads an animal's eyes around a single mount, so that other mounts would stay
    empty. Existing runs are not checked, so they can always be continued and replayed.

    Warns:
        UnusedSettingWarning: the task defines `eye` or `fidelity`, but the run's genome or settings determine them. A
            task that defines `auxiliary` (additional signals of receptors, such as depth) also causes this warning,
            because evolving eyes have no additional signals.

    Raises:
        ConfigError: the task has several mounts and does not define `place`, its module cannot be executed, or the user
            has not named its file. Code that the user has not named, for example by `--task`, is never executed.
    """
    if (code := config.choice.named_code) is None:
        return
    from evolve.learning.task_module import executed_task  # loading takes seconds, and built-in tasks do not need it
    from sim.eyes.mounts import Mount
    from sim.tasks.task_settings import TaskSettings

    task = executed_task(code)
    if type(task).place is TaskSettings.place and isinstance(task.mounts, Sequence) and len(task.mounts) > 1:
        on = ", ".join(f"{mount.on!r}" for mount in task.mounts if isinstance(mount, Mount))
        raise ConfigError(
            f"{config.task}: mounts has {len(task.mounts)} of sim.Mount (on {on}), but place spreads evolving eyes "
            "around one: define mounts with one sim.Mount, or define place(n_eyes, placement_range_deg, "
            "elevation_deg), which returns a sim.Mount for each eye",
            "task",
        )
    for unused in _unused(task, config):
        warnings.warn(f"{config.task}: {unused}", UnusedSettingWarning, stacklevel=2)


def _unused(task: TaskSettings, config: RunConfig) -> Iterator[str]:
    """Yield the settings of a task that have no effect on a run, each with the reason."""
    from sim.render.fidelity import Fidelity
    from sim.tasks.task_settings import TaskSettings

    rays, bands, fidelity = config.eye.rays_per_receptor, config.eye.bands, task.fidelity
    if task.eye is not TaskSettings.eye:
        yield "eye has no effect: the genome and the section eye of the run's settings determine the eyes"
    if task.auxiliary:
        yield f"auxiliary = {task.auxiliary!r} has no effect: evolving eyes have no auxiliary entries"
    if isinstance(fidelity, Fidelity) and rays != AUTO and fidelity != Fidelity(float(rays), bands):
        yield f"fidelity has no effect: the run has eye.rays_per_receptor = {rays}"
    elif isinstance(fidelity, Fidelity) and rays == AUTO and fidelity.bands != bands:
        yield f"fidelity.bands = {fidelity.bands} has no effect: the run has eye.bands = {bands}"


def check_layouts(config: RunConfig) -> None:
    """Check a run's random layouts by generating all of them. Runs with fixed layouts pass.

    Raises:
        ConfigError: two layouts have the same walls, or no navigation course of the configured size can be generated.
    """
    if config.world.layouts != FAMILY:
        return
    layouts = config.world.test["layouts"]
    try:
        _ = layouts.mazes if config.task == "maze" else layouts.courses
    except ValueError as error:
        raise ConfigError(f"world: {error}", *OF_LAYOUTS) from error


def try_task(config: RunConfig) -> None:
    """Build a user task with one animal, and take a few random actions in it. Built-in tasks are skipped.

    Each gene of the animal has its start value.

    Raises:
        ConfigError: the task's module, model, eyes or methods fail, or the user has not named the task's file, for
            example by `--task`. Code that the user has not named is never executed. The message is one line.
    """
    if config.choice.named_code is None:
        return
    from evolve.learning.animal_task import animal_task  # loading takes seconds, and built-in tasks do not need it
    from sim.envs.prepared_task import PreparedTask

    animal = develop(Genotype(config.genome).start, config)
    try:
        task = PreparedTask(animal_task(animal, config))
        with closing(task.vec_env(WORLDS, config.seed, animal.memory_frames)) as worlds, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the warning is superfluous, because the failure is reported as an error
            failure = _failure(worlds)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        place = error_in_task(error)
        if place is None and not isinstance(error, ValueError | RuntimeError | OSError):
            raise
        said = str(error) if isinstance(error, ConfigError) else f"{config.task}: {place or error}"
        raise ConfigError(" ".join(said.split()), "task") from error
    finally:
        open_closed_streams()  # the task may have closed a stream
    if failure is not None:
        raise ConfigError(f"{config.task}: {failure}", "task")


def _failure(worlds: EyesVecEnv) -> str | None:
    """Return the message of the first failure of the task's methods; None if there is none."""
    random = np.random.default_rng(0)
    worlds.reset()
    for _ in range(ACTIONS):
        infos = worlds.step(random.uniform(-1, 1, (WORLDS, *worlds.action_space.shape)))[3]
        for info in infos:
            if "failure" in info:
                return str(info["failure"])
    return None
