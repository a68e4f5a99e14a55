"""Environments of an animal: for training, for selection during training, and for the test of its fitness."""

from __future__ import annotations

from dataclasses import dataclass

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from sim.envs.prepared_task import PreparedTask
from sim.envs.vec_env import EyesVecEnv

__all__ = ["TrainingEnvs", "worlds_of"]


@dataclass(frozen=True)
class TrainingEnvs:
    """Environments for training, selection and test, all with the same light.

    The first two trace only the rays that learning needs, because their noise averages out.
    """

    training: EyesVecEnv
    selection: EyesVecEnv
    test: EyesVecEnv


def worlds_of(phenotype: Phenotype, config: RunConfig, learning: int, evaluation: int) -> TrainingEnvs:
    """Return environments with one seed for training and another for evaluation.

    Raises:
        ConfigError: a user task has not been named or fails at its start.
    """
    memory, wanted, episodes = phenotype.memory_frames, config.learning, config.evaluation.episodes
    fine = PreparedTask(animal_task(phenotype, config))
    coarse = fine.at_most(wanted.rays_per_receptor)
    if config.world.training == config.world.evaluation:
        school = coarse.in_mode("training")
    else:
        school = coarse.elsewhere(animal_task(phenotype, config, "training"))
    return TrainingEnvs(
        training=school.vec_env(wanted.n_envs, learning, memory, least_return=wanted.least_return or None),
        selection=coarse.vec_env(episodes, evaluation, memory),
        test=fine.vec_env(episodes, evaluation, memory),
    )
