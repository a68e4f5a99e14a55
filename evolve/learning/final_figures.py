"""Final results: the returns of a trained policy in episodes that neither its training nor its selection has used."""

from __future__ import annotations

from contextlib import closing

from evolve.config.checks import ConfigError
from evolve.config.run_config import RunConfig
from evolve.config.settings import FAMILY
from evolve.config.task_card import LAYOUTS, tasks_with
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from evolve.learning.played_episodes import Episodes, play
from evolve.learning.policy import EyePolicy
from sim.envs.prepared_task import PreparedTask
from sim.envs.vec_env import EyesVecEnv

__all__ = ["UnfitPolicy", "final_episodes", "require_fit", "require_test_set"]


class UnfitPolicy(ValueError):
    """A policy was trained for eyes whose signals have another shape than those of the animal it should control."""


def final_episodes(
    phenotype: Phenotype, config: RunConfig, policy: EyePolicy, seed: int = 0, episodes: int | None = None
) -> Episodes:
    """Play evaluation episodes in the mode "test", and return their results.

    The same arguments give the same episodes.

    A run with `world.layouts = "family"` has a set of layouts for this mode. In other runs with built-in tasks, the
    episodes take place in the worlds of the evaluation, but begin in other states than the evaluation's episodes.

    seed: seed of the episodes
    episodes: number of episodes; None: `evaluation.episodes`

    Raises:
        ConfigError: the run was opened without the "FILE.py:CLASS" of its user task, or its code cannot be executed.
        ValueError: `episodes` is below 1, `seed` is negative, or the eyes cannot be placed in the user task.
        RuntimeError: a method of the user task fails at the start of an episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        TrainingDiverged: the policy's actions, or the returns, are not finite.
        UnfitPolicy: the policy was trained with eyes whose signals have another shape than this animal's.
    """
    count = config.evaluation.episodes if episodes is None else episodes
    prepared = PreparedTask(animal_task(phenotype, config, "test"))
    with closing(prepared.vec_env(count, seed, phenotype.memory_frames)) as worlds:
        require_fit(policy, worlds)
        return play(policy, worlds, seed)


def require_fit(policy: EyePolicy, worlds: EyesVecEnv) -> None:
    """Check that the signals of the animal's eyes in `worlds` have the shape for which the policy was trained.

    Raises:
        UnfitPolicy: the shape differs.
    """
    own, here = (space["eyes"].shape for space in (policy.observation_space, worlds.observation_space))
    if own != here:
        raise UnfitPolicy(f"its eyes have the shape {own}, those of this animal {here} (memory, eye, channel, y, x)")


def require_test_set(config: RunConfig) -> None:
    """Check that the run has a test set: in the mode "test", episodes have other layouts than in the evaluation.

    All user tasks pass the check, because they may define other layouts for this mode.

    Raises:
        ConfigError: the task does not have the setting `world.layouts`, or its value is not "family", which gives each
            mode its own set of layouts.
    """
    if config.card.has_file or config.world.layouts == FAMILY:
        return
    if LAYOUTS not in config.card.settings:
        raise ConfigError(f"task = {config.task}: has no test set: must be {' or '.join(tasks_with(LAYOUTS))}", "task")
    raise ConfigError(
        f"{LAYOUTS} = {config.world.layouts}: has no test set, its evaluation may use the layouts of training: must be "
        f"{FAMILY}",
        LAYOUTS,
    )
