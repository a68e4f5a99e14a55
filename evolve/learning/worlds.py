"""Where an animal lives: worlds to learn in, to be tried out in meanwhile, and to have its fitness measured in."""

from __future__ import annotations

from dataclasses import dataclass

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from sim.envs.prepared_task import PreparedTask
from sim.envs.vec_env import EyesVecEnv

__all__ = ["LifeWorlds", "worlds_of"]


@dataclass(frozen=True)
class LifeWorlds:
    """All have the same light; the first two trace no more rays than are good enough to learn from, as their noise
    averages out."""

    lessons: EyesVecEnv
    checkpoints: EyesVecEnv
    finals: EyesVecEnv


def worlds_of(phenotype: Phenotype, config: RunConfig, learning: int, evaluation: int) -> LifeWorlds:
    """Worlds of two seeds: to learn in, and to be evaluated in.

    Raises:
        ConfigError: the task is a user's, and has not been named, or cannot be begun.
    """
    memory, wanted, episodes = phenotype.memory_frames, config.learning, config.evaluation.episodes
    fine = PreparedTask(animal_task(phenotype, config))
    coarse = fine.at_most(wanted.rays_per_receptor)
    if config.world.training == config.world.evaluation:
        school = coarse.in_mode("training")
    else:
        school = coarse.elsewhere(animal_task(phenotype, config, "training"))
    return LifeWorlds(
        lessons=school.vec_env(wanted.n_envs, learning, memory, least_return=wanted.least_return or None),
        checkpoints=coarse.vec_env(episodes, evaluation, memory),
        finals=fine.vec_env(episodes, evaluation, memory),
    )
