"""Environments of one animal: for training, for selection of its best policy, and for the evaluation of its fitness."""

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
    """Environments of one animal for training, selection and fitness.

    training: environments in which the policy is trained
    selection: environments of the evaluations during training, which select the best policy
    fitness: environments in which the fitness is measured after training, in the layouts of `selection`

    All three compute reflections of light in the same way. Training and selection use at most
    `learning.rays_per_receptor` rays for each receptor, because the noise of rendering averages out in learning.
    """

    training: EyesVecEnv
    selection: EyesVecEnv
    fitness: EyesVecEnv


def worlds_of(phenotype: Phenotype, config: RunConfig, learning: int, evaluation: int) -> TrainingEnvs:
    """Return the environments in which an animal is trained, its best policy is selected and its fitness is measured.

    learning: seed of the environments for training
    evaluation: seed of the environments for selection and fitness

    Raises:
        ConfigError: the run was opened without naming its user task (argument `task`), or the task's module cannot be
            executed.
        ValueError: the eyes cannot be placed in the user task; see `evolve.learning.animal_task.with_phenotype`.
    """
    memory, settings, episodes = phenotype.memory_frames, config.learning, config.evaluation.episodes
    fine = PreparedTask(animal_task(phenotype, config))
    coarse = fine.at_most(settings.rays_per_receptor)
    if config.world.training == config.world.evaluation:
        training = coarse.in_mode("training")
    else:
        training = coarse.elsewhere(animal_task(phenotype, config, "training"))
    return TrainingEnvs(
        training=training.vec_env(settings.n_envs, learning, memory, least_return=settings.least_return or None),
        selection=coarse.vec_env(episodes, evaluation, memory),
        fitness=fine.vec_env(episodes, evaluation, memory),
    )
