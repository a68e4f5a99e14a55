"""Evaluation episodes in a run's test set: layouts that neither training nor selection has used."""

from __future__ import annotations

from evolve.episodes.recorder import damage_named, trained_policy
from evolve.learning.final_figures import final_episodes, require_test_set
from evolve.learning.played_episodes import Episodes
from evolve.store.directory import Run

__all__ = ["held_out_episodes"]


def held_out_episodes(
    run: Run, candidate_id: int | None = None, seed: int = 0, episodes: int | None = None
) -> Episodes:
    """Play evaluation episodes in the test set of a run, and return their results.

    The same arguments give the same episodes.

    candidate_id: id of the candidate; None: the best candidate
    seed: seed of the episodes
    episodes: number of episodes; None: the run's setting `evaluation.episodes`

    Raises:
        RunError: the candidate does not exist, or its policy is missing or damaged.
        ConfigError: the run has no test set, the run was opened without naming its user task, or the module of the user
            task cannot be executed.
        ValueError: `episodes` is below 1, or `seed` is negative.
        RuntimeError: a method of the user task fails at the start of an episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: the policy's file cannot be read.
    """
    require_test_set(run.config)
    candidate = run.candidate(candidate_id)
    policy = trained_policy(run, candidate)
    with damage_named(run.policy_path(candidate.id)):
        return final_episodes(candidate.phenotype, run.config, policy, seed, episodes)
