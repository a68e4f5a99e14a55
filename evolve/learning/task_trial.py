"""Short trial of a user task before a run starts. A failure in the task would affect every animal of the run."""

from __future__ import annotations

import warnings
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np

from evolve.config.checks import ConfigError
from evolve.config.run_config import RunConfig
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop

if TYPE_CHECKING:
    from sim.envs.vec_env import EyesVecEnv

__all__ = ["try_task"]

WORLDS, ACTIONS = 2, 4


def try_task(config: RunConfig) -> None:
    """Build the user task with the run's first animal, and take a few random actions; skip built-in tasks.

    Raises:
        ConfigError: the task's module, model, eyes or methods fail; the message is one line.
    """
    if config.choice.named_code is None:
        return
    from evolve.learning.animal_task import animal_task  # loading takes seconds, and built-in tasks do not need it
    from sim.envs.prepared_task import PreparedTask

    animal = develop(Genotype(config.genome).start, config)
    try:
        task = PreparedTask(animal_task(animal, config))
        with closing(task.vec_env(WORLDS, config.seed, animal.memory_frames)) as worlds, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the failure is reported as an error instead
            failure = _failure(worlds)
    except (ValueError, RuntimeError, OSError) as error:
        said = str(error) if isinstance(error, ConfigError) else f"{config.task}: {error}"
        raise ConfigError(" ".join(said.split()), "task") from error
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
