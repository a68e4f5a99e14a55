"""A run's task, with one animal placed in it. No other module converts a task's name to an object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evolve.config.checks import AUTO
from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.task_module import executed_task
from optics.elements.turbid_medium import AIR
from sim.eyes.eyes import Eyes
from sim.render.fidelity import Fidelity, requested_fidelity
from sim.tasks.batch_task import BatchTask
from sim.tasks.registry import task_of
from sim.tasks.user_tasks import UserTask, batched, with_evolved_eyes
from sim.worlds.world import build_world

__all__ = ["animal_task", "azimuths", "with_phenotype"]


def animal_task(
    phenotype: Phenotype, config: RunConfig, mode: str = "evaluation", eyes: Eyes | None = None
) -> BatchTask:
    """Return the run's task with this animal in it, in a form that runs in many worlds at once.

    mode: "training", "evaluation" or "test", which may have different layouts of worlds
    eyes: eyes that replace the animal's own; None: the animal's own eyes

    Raises:
        ConfigError: the run was opened without the "FILE.py:CLASS" of its user task, or its code cannot be executed.
        ValueError: the eyes cannot be placed in the user task; see `with_phenotype`.
    """
    if (code := config.choice.named_code) is not None:
        task = with_phenotype(executed_task(code, config.world.encoded_textures), phenotype, config, eyes)
        return batched(task).in_mode(mode)
    eyes, layout = eyes or phenotype.eyes(config.eye), getattr(config.world, mode)
    fidelity = requested_fidelity(config.eye.rays_per_receptor, eyes)
    built_in = task_of(build_world(config.task, **layout), mode, eyes=eyes, fidelity=fidelity or AUTO)
    built_in.vary = config.world.vary
    return built_in


def azimuths(phenotype: Phenotype, config: RunConfig) -> np.ndarray:
    """Return the azimuths of the animal's eyes [rad], (eye,), in the frame of their body, site or camera.

    For a built-in task, no world is built.

    Raises:
        ConfigError: see `animal_task`.
        ValueError: see `animal_task`.
    """
    if (code := config.choice.named_code) is not None:
        task = executed_task(code, config.world.encoded_textures)
        return batched(with_phenotype(task, phenotype, config)).azimuths()
    return phenotype.eyes(config.eye).azimuths()


def with_phenotype(task: UserTask, phenotype: Phenotype, config: RunConfig, eyes: Eyes | None = None) -> UserTask:
    """Return a copy of a user task in which the animal has the eyes of this phenotype.

    The eyes are rendered with the run's setting `eye.rays_per_receptor`. If this setting is "auto", the task's own
    attribute `fidelity` is used. If this attribute is a `Fidelity` object, its number of spectral bands is replaced by
    the run's `eye.bands`. The run's medium replaces the task's own, unless the run's medium is air.

    eyes: eyes that replace the animal's own; None: the animal's own eyes

    Raises:
        ValueError: the task's method `place`, which places the eyes on the body, fails or does not return one place
            (mount) for each eye, or the task defines neither mounts nor its own `place`, or it defines several kinds
            of eyes.
    """
    animal = with_evolved_eyes(task, eyes or phenotype.eyes(config.eye), phenotype.elevation_deg or 0.0)
    rays, bands = config.eye.rays_per_receptor, config.eye.bands
    if config.world.medium != AIR:
        animal.medium = config.world.medium
    if rays != AUTO:
        animal.fidelity = Fidelity(float(rays), bands)
    elif isinstance(task.fidelity, Fidelity):
        animal.fidelity = replace(task.fidelity, bands=bands)
    return animal
