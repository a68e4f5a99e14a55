"""The loop: propose candidates, evaluate what the record lacks, write each down, tell, repeat.

A run that is continued goes through the same loop from its beginning: candidates on record are not evaluated again,
only told again, which brings the search to where it was. Generation by generation, the history follows from the seed
alone. In the steady state, fitness is told in the order in which candidates finish, so it follows from the record's
order too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol

from evolve.genome.phenotype import develop
from evolve.learning.training_stage import TrainingStage
from evolve.search.job import Job, Progress
from evolve.search.same_search import SameSearch
from evolve.search.search import Proposal, Search, training_seed
from evolve.search.successive_halving import budgets, reaching
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation, mishaps_in_all
from evolve.store.policies import digest

__all__ = ["Executor", "Watcher", "evolve"]


class Executor(Protocol):
    """Someone who evaluates candidates."""

    def run(self, jobs: deque[Job], progress: Progress | None = None) -> Iterator[tuple[Job, Evaluation]]:
        """Evaluate all jobs, handed out in their order; each comes out once, as soon as it is done. Whoever receives
        one may add to `jobs` before asking for the next."""


class Watcher(Protocol):
    """Someone who looks on."""

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        """A candidate has been trained for `steps` of `planned` steps."""

    def evaluated(self, candidate: Candidate) -> None:
        """A candidate has been evaluated and is on record."""


def evolve(run: Run, executor: Executor, watcher: Watcher) -> None:
    """Carry a run (whose lock is held) to its end.

    Raises:
        RunError: the record cannot be written, or this search does not propose what is on record.
        ConfigError: the search cannot be begun.
        ExecutorError: no candidate can be evaluated.
    """
    search = Search(run.config)
    if run.config.search.steady_state:
        _steadily(run, search, executor, watcher)
    else:
        _by_generations(run, search, executor, watcher)


def _by_generations(run: Run, search: Search, executor: Executor, watcher: Watcher) -> None:
    """Tell a generation, in the order of its candidates, once all of it is known, all stages included."""
    same = SameSearch(run)
    for generation in range(run.config.search.generations):
        proposals = {proposal.id: proposal for proposal in search.propose_generation()}
        for candidate in run.generation(generation):
            same.require(proposals[candidate.id], candidate)
        for stage in range(run.config.search.rungs):
            missing = sorted(reaching(run, generation, stage) - run.evaluated_at(stage))
            same.require_complete(generation, missing)
            jobs = deque(_job(run, proposals[candidate_id], stage) for candidate_id in missing)
            for job, outcome in executor.run(jobs, watcher.training):
                _write_down(run, proposals[job.id], job, outcome, watcher)
        run.forget_trainings(proposals)
        search.tell([(candidate.id, candidate.fitness) for candidate in run.generation(generation)])


def _steadily(run: Run, search: Search, executor: Executor, watcher: Watcher) -> None:
    """Keep one population on its way: whenever a candidate is done, tell it and propose the next one."""
    under_way: dict[int, Proposal] = {}

    def refill() -> list[Proposal]:
        room = min(run.config.search.population - len(under_way), run.config.candidates - search.proposed)
        proposals = [search.propose() for _ in range(room)]
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
        candidate = _write_down(run, under_way.pop(job.id), job, outcome, watcher)
        search.tell([(candidate.id, candidate.fitness)])
        jobs.extend(_job(run, proposal) for proposal in refill())


def _job(run: Run, proposal: Proposal, stage: int = 0) -> Job:
    phenotype = develop(proposal.vector, run.config)
    seed = training_seed(run.config.seed, proposal.id)
    training = None
    if run.config.search.rungs > 1:
        ends = budgets(run.config.search, run.config.learning)[: stage + 1]
        training = TrainingStage(ends, tuple(run.checkpoint_path(proposal.id, i) for i in range(stage + 1)))
    return Job(proposal.id, phenotype, run.config, seed, run.policy_path(proposal.id), training)


def _write_down(run: Run, proposal: Proposal, job: Job, outcome: Evaluation, watcher: Watcher) -> Candidate:
    genome, parents = proposal.genome, proposal.parents
    candidate = Candidate.of(proposal.place, genome, job.phenotype, job.seed, outcome, parents)
    if job.stage is not None:
        candidate = replace(candidate, rung=job.stage.number)
        if (before := run.on_record(candidate.id, candidate.rung - 1)) is not None:
            candidate = _after(before, candidate)
    if candidate.failure is None:
        candidate = replace(candidate, policy=digest(job.policy_path))
    run.append(candidate)
    watcher.evaluated(candidate)
    return candidate


def _after(before: Candidate, candidate: Candidate) -> Candidate:
    """A candidate after a later budget stage, all of its life counted in; where that stage fails, it has learned what
    it had learned before."""
    if candidate.failure is not None:
        candidate = replace(candidate, steps=before.steps, curve=before.curve)
    mishaps = mishaps_in_all(before.mishaps, candidate.mishaps)
    return replace(candidate, seconds=before.seconds + candidate.seconds, mishaps=mishaps)
