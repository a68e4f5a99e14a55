"""Main loop of a run: propose candidates, evaluate and record them, and report their fitness to the optimizer.

A resumed run executes the same loop from its start. Candidates that are already on record are not evaluated again,
but their fitness is reported to the optimizer. This restores the state of the search.

The loop has two modes. By default, the optimizer receives the fitness of a whole generation at once, so all candidates
follow from the settings and the seed. With `search.steady_state`, fitness is reported in the order in which candidates
finish. The candidates then also depend on this order, which the record stores.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol

from evolve.genome.phenotype import develop
from evolve.learning.training_rung import TrainingRung
from evolve.search.job import Job, Progress
from evolve.search.same_search import SameSearch
from evolve.search.search import Proposal, Search, training_seed
from evolve.search.successive_halving import budgets, reaching
from evolve.store.candidate import Candidate
from evolve.store.checksums import digest
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation, total_episode_failures

__all__ = ["Executor", "Watcher", "evolve"]


class Executor(Protocol):
    """Protocol of objects that evaluate candidates."""

    def run(self, jobs: deque[Job], progress: Progress | None = None) -> Iterator[tuple[Job, Evaluation]]:
        """Start the jobs in order, and yield each job with its outcome once, as soon as it is complete.

        The caller may append to `jobs` between results.

        progress: function that is called with (candidate id, steps trained, steps planned); None: no function

        Raises:
            ExecutorError: candidates cannot be evaluated.
        """


class Watcher(Protocol):
    """Protocol of objects that are informed of the progress of a run."""

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        """Receive the progress of a candidate's training: `steps` of `planned` steps."""

    def evaluated(self, candidate: Candidate) -> None:
        """Receive a candidate after it has been evaluated and recorded."""


def evolve(run: Run, executor: Executor, watcher: Watcher) -> None:
    """Evaluate all candidates that a run still lacks. The caller must hold the lock of the run.

    executor: evaluates the candidates
    watcher: receives the progress of training and each evaluated candidate

    Raises:
        RunError: the record cannot be written, or the search proposes candidates that differ from those on record.
        ConfigError: the optimizer is unknown, or cannot be used here.
        ExecutorError: candidates cannot be evaluated.
        OSError: a policy or a checkpoint cannot be read, or a checkpoint cannot be renamed or removed.
    """
    search = Search(run.config)
    if run.config.search.steady_state:
        _steadily(run, search, executor, watcher)
    else:
        _by_generations(run, search, executor, watcher)


def _by_generations(run: Run, search: Search, executor: Executor, watcher: Watcher) -> None:
    """Evaluate one generation after the other, and report a generation's fitness when its training is complete.

    Training may be divided into parts (rungs), after each of which only the better candidates continue.
    """
    same = SameSearch(run)
    for generation in range(run.config.search.generations):
        proposals = {proposal.id: proposal for proposal in search.propose_generation()}
        for candidate in run.generation(generation):
            same.require(proposals[candidate.id], candidate)
        for rung in range(run.config.search.rungs):
            missing = sorted(reaching(run, generation, rung) - run.evaluated_at(rung))
            same.require_complete(generation, missing)
            jobs = deque(_job(run, proposals[candidate_id], rung) for candidate_id in missing)
            for job, outcome in executor.run(jobs, watcher.training):
                _record(run, proposals[job.id], job, outcome, watcher)
        run.forget_trainings(proposals)
        search.tell([(candidate.id, candidate.fitness) for candidate in run.generation(generation)])


def _steadily(run: Run, search: Search, executor: Executor, watcher: Watcher) -> None:
    """Keep one population of candidates under evaluation; a new proposal replaces each finished candidate."""
    under_way: dict[int, Proposal] = {}

    def refill() -> list[Proposal]:
        missing = min(run.config.search.population - len(under_way), run.config.candidates - search.proposed)
        proposals = [search.propose() for _ in range(missing)]
        under_way.update((proposal.id, proposal) for proposal in proposals)
        return proposals

    same = SameSearch(run)
    refill()
    for candidate in run.in_order_of_finish:
        same.require(under_way.pop(candidate.id, None), candidate)
        search.tell([(candidate.id, candidate.fitness)])
        refill()
    jobs = deque(_job(run, proposal) for proposal in under_way.values())
    for job, outcome in executor.run(jobs, watcher.training):
        candidate = _record(run, under_way.pop(job.id), job, outcome, watcher)
        search.tell([(candidate.id, candidate.fitness)])
        jobs.extend(_job(run, proposal) for proposal in refill())


def _job(run: Run, proposal: Proposal, rung: int = 0) -> Job:
    phenotype = develop(proposal.vector, run.config)
    seed = training_seed(run.config.seed, proposal.id)
    training = None
    if run.config.search.rungs > 1:
        ends = budgets(run.config.search, run.config.learning)[: rung + 1]
        checkpoints = tuple(run.checkpoint_path(proposal.id, i) for i in range(rung + 1))
        training = TrainingRung(ends, checkpoints, proposal.id)
        training.set_aside_unusable(phenotype, run.config, seed)
    return Job(proposal.id, phenotype, run.config, seed, run.policy_path(proposal.id), training)


def _record(run: Run, proposal: Proposal, job: Job, outcome: Evaluation, watcher: Watcher) -> Candidate:
    """Append an evaluated candidate to the record, inform the watcher, and return the candidate."""
    genome, parents = proposal.genome, proposal.parents
    candidate = Candidate.from_evaluation(proposal.place, genome, job.phenotype, job.seed, outcome, parents)
    if job.rung is not None:
        candidate = replace(candidate, rung=job.rung.number)
        if (before := run.on_record(candidate.id, candidate.rung - 1)) is not None:
            candidate = _after(before, candidate)
    candidate = candidate.charged(run.config.costs.total(job.phenotype, run.config.eye))
    if candidate.failure is None:
        candidate = replace(candidate, policy=digest(job.policy_path))
    run.append(candidate)
    watcher.evaluated(candidate)
    return candidate


def _after(before: Candidate, candidate: Candidate) -> Candidate:
    """Return a candidate after a rung (a part of its training), with totals of its wall time and episode failures.

    The totals cover this rung and all earlier rungs. If training failed in this rung, the number of training steps and
    the learning curve are those of the previous rung.

    before: the record of the candidate after the previous rung
    candidate: the candidate after this rung
    """
    if candidate.failure is not None:
        candidate = replace(candidate, steps=before.steps, curve=before.curve)
    failures = total_episode_failures(before.episode_failures, candidate.episode_failures)
    seconds = before.seconds + candidate.seconds
    return replace(candidate, seconds=seconds, episode_failures=failures).recordable()
