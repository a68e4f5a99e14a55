"""The run's task with one animal in it: the one place that resolves a task's name into an object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evolve.config.checks import AUTO
from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.task_module import executed_task
from sim.eyes.eyes import Eyes
from sim.render.fidelity import Fidelity, fidelity_asked
from sim.tasks.batch_task import BatchTask
from sim.tasks.registry import task_of
from sim.tasks.user_tasks import UserTask, batched, with_evolved_eyes
from sim.worlds.world import build_world

__all__ = ["animal_task", "azimuths", "embodied"]


def animal_task(
    phenotype: Phenotype, config: RunConfig, mode: str = "evaluation", eyes: Eyes | None = None
) -> BatchTask:
    """The task that this animal lives in, for arrays of worlds; in training, the layout may be another one.

    eyes: in the place of the animal's own

    Raises:
        ConfigError: it is a user's task and has not been named, or its module cannot be executed.
        ValueError: it places other eyes than the animal has.
    """
    if (code := config.choice.named_code) is not None:
        task = embodied(executed_task(code), phenotype, config, eyes)
        return batched(task).in_mode(mode)
    eyes, layout = eyes or phenotype.eyes(config.eye), getattr(config.world, mode)
    asked = fidelity_asked(config.eye.rays_per_receptor, eyes)
    world = build_world(config.task, seed=layout["world_seed"], mazes=layout["mazes"], course=layout["course"])
    built_in = task_of(world, mode, eyes=eyes, fidelity=asked or AUTO)
    built_in.vary = config.world.vary
    return built_in


def azimuths(phenotype: Phenotype, config: RunConfig) -> np.ndarray:
    """Directions of the animal's eyes [rad], (eye,), in the frame of what they are on. No world is built.

    Raises:
        ConfigError: as `animal_task`.
        ValueError: as `animal_task`.
    """
    if (code := config.choice.named_code) is not None:
        return batched(embodied(executed_task(code), phenotype, config)).azimuths()
    return phenotype.eyes(config.eye).azimuths()


def embodied(task: UserTask, phenotype: Phenotype, config: RunConfig, eyes: Eyes | None = None) -> UserTask:
    """A user's task with this animal in it, whose eyes have the fidelity of the run or, if that is "auto", the task's.

    eyes: in the place of the animal's own

    Raises:
        ValueError: it places other eyes than the animal has.
    """
    animal = with_evolved_eyes(task, eyes or phenotype.eyes(config.eye), phenotype.elevation_deg or 0.0)
    rays, bands = config.eye.rays_per_receptor, config.eye.bands
    if rays != AUTO:
        animal.fidelity = Fidelity(float(rays), bands)
    elif isinstance(task.fidelity, Fidelity):
        animal.fidelity = replace(task.fidelity, bands=bands)
    return animal
