"""The loop: ask for a generation, evaluate what the record lacks, write each candidate down, tell, repeat.

A run that is continued goes through the same loop from its first generation: candidates on record are not evaluated
again, only told again, which brings the search to where it was.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evolve.candidate import Candidate
from evolve.development import develop
from evolve.executors import Job, LocalExecutor
from evolve.search import Search, training_seed
from evolve.store import Run, RunError
from evolve.versions import present, recorded

__all__ = ["Watcher", "evolve"]


class Watcher(Protocol):
    """Someone who looks on."""

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        """A candidate has been trained for `steps` of `planned` steps."""

    def evaluated(self, candidate: Candidate) -> None:
        """A candidate has been evaluated and is on record."""


def evolve(run: Run, executor: LocalExecutor, watcher: Watcher) -> None:
    """Carry a run (whose lock is held) to its end.

    Raises:
        RunError: the record cannot be written, or this search does not propose what is on record.
        ExecutorError: no candidate can be evaluated on this machine.
    """
    search = Search(run.config)
    for generation in range(run.config.search.generations):
        genomes = search.ask()
        _require_same(run, generation, genomes)
        _evaluate_missing(run, generation, genomes, executor, watcher)
        search.tell([candidate.fitness for candidate in run.generation(generation)])


def _evaluate_missing(
    run: Run, generation: int, genomes: NDArray[np.float64], executor: LocalExecutor, watcher: Watcher
) -> None:
    """Evaluate and write down those candidates of a generation that are not on record."""
    first = generation * len(genomes)
    known = {candidate.index for candidate in run.generation(generation)}
    jobs = []
    for index in sorted(set(range(len(genomes))) - known):
        identity = first + index
        seed = training_seed(run.config.seed, identity)
        policy = run.policy_path(identity)
        jobs.append(Job(identity, develop(genomes[index], run.config), run.config, seed, policy))
    for job, outcome in executor.run(jobs, watcher.training):
        index = job.id - first
        genome = tuple(genomes[index].tolist())
        candidate = Candidate.of((job.id, generation, index), genome, job.phenotype, job.seed, outcome)
        run.append(candidate)
        watcher.evaluated(candidate)


def _require_same(run: Run, generation: int, genomes: NDArray[np.float64]) -> None:
    """The search must propose, bit for bit, what is on record; else it is another search than the one that began."""
    for candidate in run.generation(generation):
        if candidate.genome == tuple(genomes[candidate.index].tolist()):
            continue
        then, now = recorded(run.path), present()
        names = ("nevergrad", "cma", "numpy")
        before = ", ".join(f"{name} {then.get(name, '?')}" for name in names)
        after = ", ".join(f"{name} {now[name]}" for name in names)
        raise RunError(
            f"{run.path} cannot be continued: candidate {candidate.id} is not what the search proposes here "
            f"(started with {before}; here {after}). Continue it with the versions that began it, and an unchanged "
            f"config.toml"
        )
