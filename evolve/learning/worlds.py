"""Where an animal lives: worlds to learn in, to be tried out in meanwhile, and to have its fitness measured in."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

from evolve.config.checks import AUTO
from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.task_module import executed_task
from sim.envs.assembly import prepared_scene, vec_env_in
from sim.envs.task_fidelity import fidelity_of
from sim.envs.task_vec_env import TaskVecEnv
from sim.envs.vec_env import EyesVecEnv
from sim.render.edge_rays import FIRST
from sim.render.fidelity import EDGES, RAYS, Fidelity
from sim.render.fidelity_choice import fidelity_for
from sim.scene.variation import Variation
from sim.tasks.user_task import Task, grown

__all__ = ["LifeWorlds", "embodied", "own_task_for", "worlds_of"]


@dataclass(frozen=True)
class LifeWorlds:
    """All have the same light; the first two take no more rays than are good enough to learn from, as their noise
    averages out."""

    lessons: EyesVecEnv | TaskVecEnv
    checkpoints: EyesVecEnv | TaskVecEnv
    finals: EyesVecEnv | TaskVecEnv


def worlds_of(phenotype: Phenotype, config: RunConfig, learning: int, evaluation: int) -> LifeWorlds:
    """Worlds of two seeds: to learn in, and to be evaluated in.

    Raises:
        ConfigError: the task is somebody's own, and has not been named, or cannot be begun.
    """
    if config.own_task is not None:
        return _own_worlds(phenotype, config, learning, evaluation)
    eyes, memory, wanted = phenotype.eyes(config.eye), phenotype.memory_frames, config.learning
    scene = prepared_scene(config.task, eyes, **config.world.evaluation)
    fine = fidelity_for(scene, config.eye.rays_per_receptor)
    coarse = _at_most(fine, wanted.rays_per_receptor)
    same_place = config.world.training == config.world.evaluation
    school = scene if same_place else prepared_scene(config.task, eyes, **config.world.training)
    vary, episodes = config.world.vary, config.evaluation.episodes
    variation = None if vary is None else Variation(vary)
    checkpoints, finals = (
        vec_env_in(scene, how, episodes, evaluation, memory=memory, mode="evaluation", variation=variation)
        for how in (coarse, fine)
    )
    least = wanted.least_return or None
    lessons = vec_env_in(
        school, coarse, wanted.n_envs, learning, memory=memory, least_return=least, variation=variation
    )
    return LifeWorlds(lessons, checkpoints, finals)


def own_task_for(phenotype: Phenotype, config: RunConfig) -> Task:
    """The task of somebody's own with this animal in it.

    Raises:
        ConfigError: it has not been named, or its module cannot be executed.
        ValueError: it places other eyes than the animal has.
    """
    assert config.own_task is not None
    animal = embodied(executed_task(config.own_task), phenotype, config)
    animal.fidelity = fidelity_of(animal)
    return animal


def embodied(task: Task, phenotype: Phenotype, config: RunConfig) -> Task:
    """A task with this animal in it, which sees as finely as the run, or else the task, has it.

    Raises:
        ValueError: it places other eyes than the animal has.
    """
    animal = grown(task, phenotype.eyes(config.eye), phenotype.elevation_deg or 0.0)
    rays, bands = config.eye.rays_per_receptor, config.eye.bands
    if rays != AUTO:
        animal.fidelity = Fidelity(float(rays), bands)
    elif isinstance(task.fidelity, Fidelity):
        animal.fidelity = replace(task.fidelity, bands=bands)
    return animal


def _own_worlds(phenotype: Phenotype, config: RunConfig, learning: int, evaluation: int) -> LifeWorlds:
    task, memory, wanted = own_task_for(phenotype, config), phenotype.memory_frames, config.learning
    pupil = copy.copy(task)
    pupil.fidelity = _at_most(fidelity_of(task), wanted.rays_per_receptor)
    return LifeWorlds(
        lessons=TaskVecEnv(pupil, wanted.n_envs, learning, memory),
        checkpoints=TaskVecEnv(pupil, config.evaluation.episodes, evaluation, memory),
        finals=TaskVecEnv(task, config.evaluation.episodes, evaluation, memory),
    )


def _at_most(fidelity: Fidelity, rays_per_receptor: float) -> Fidelity:
    """Of rays; where these are fewer than those that look for edges, the same everywhere."""
    rays = min(fidelity.rays_per_receptor, rays_per_receptor)
    samples = RAYS if fidelity.samples == EDGES and rays < FIRST else fidelity.samples
    return replace(fidelity, rays_per_receptor=rays, samples=samples)
