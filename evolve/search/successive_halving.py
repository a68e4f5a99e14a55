"""Successive halving within a generation (Jamieson and Talwalkar 2016, algorithm 1).

A training has budget stages. All of a generation is trained through the first; after each stage the better part goes on
to the next, and the last stage ends a whole training. A stage takes a training up where the one before left it, in
fresh worlds whose seeds follow from candidate and stage. What it becomes follows from seeds and the tensors left, so a
run that was killed within a stage begins that stage again, and ends as if nothing had happened.

In settings and records a stage is called a rung: `search.rungs` says how many there are, and the `rung` of a record's
line after which one it was written.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from evolve.config.numbering import generation_ids
from evolve.config.run_config import LearningConfig, RunConfig, SearchConfig
from evolve.store.directory import Run

__all__ = [
    "budgets",
    "complete",
    "evaluations",
    "finished",
    "promoted",
    "reaching",
    "sizes",
    "steps",
    "trained_steps",
]


def budgets(search: SearchConfig, learning: LearningConfig) -> tuple[int, ...]:
    """Steps that a training has come to at the end of each stage, (stage,); the last is a whole training."""
    return tuple(math.ceil(learning.total_steps * search.promoted**after) for after in range(search.rungs - 1, -1, -1))


def sizes(search: SearchConfig) -> tuple[int, ...]:
    """Candidates of a generation that are trained through each stage, (stage,), if none fails."""
    return tuple(max(1, math.ceil(search.population * search.promoted**stage)) for stage in range(search.rungs))


def steps(config: RunConfig) -> int:
    """Agent steps of the whole run, if all trainings take what they may."""
    search, reached, total = config.search, 0, 0
    for candidates, end in zip(sizes(search), budgets(search, config.learning), strict=True):
        before, reached = reached, trained_steps(config.learning, reached, end)
        total += candidates * (reached - before)
    return search.generations * total


def trained_steps(learning: LearningConfig, begin: int, end: int) -> int:
    """Steps that a training from `begin` has come to when it stops at `end`: it goes on by whole rollouts of
    n_envs x n_steps, evaluated every `eval_interval`."""
    rollout, trained = learning.n_envs * learning.n_steps, begin
    while trained < end:
        trained += rollout * math.ceil(min(learning.eval_interval, end - trained) / rollout)
    return trained


def evaluations(search: SearchConfig) -> int:
    """Evaluations in the whole run: every candidate's, after every stage that it reaches."""
    return search.generations * sum(sizes(search))


def promoted(search: SearchConfig, stage: int, fitness: Sequence[tuple[int, float]]) -> set[int]:
    """Ids that go on after a stage, given (id, fitness) of all that reached it: the fittest, the first of equals; none
    that failed (-inf)."""
    if stage + 1 >= search.rungs:
        return set()
    able = sorted((told for told in fitness if math.isfinite(told[1])), key=lambda told: (-told[1], told[0]))
    return {candidate_id for candidate_id, _ in able[: sizes(search)[stage + 1]]}


def reaching(run: Run, generation: int, stage: int) -> set[int]:
    """Ids of a generation that reach a stage: all of it the first; {} any later one until the one before is done."""
    ids = set(generation_ids(generation, run.config.search.population))
    for earlier in range(stage):
        told = [run.on_record(candidate_id, earlier) for candidate_id in ids]
        known = [(candidate.id, candidate.fitness) for candidate in told if candidate is not None]
        if len(known) < len(ids):
            return set()
        ids = promoted(run.config.search, earlier, known)
    return ids


def complete(run: Run, generation: int) -> bool:
    """Whether all of a generation has been evaluated, after every stage that it reaches."""
    return _complete(run, generation, _evaluated(run))


def finished(run: Run) -> bool:
    """Whether all of a run has been evaluated."""
    evaluated = _evaluated(run)
    return all(_complete(run, generation, evaluated) for generation in range(run.config.search.generations))


def _evaluated(run: Run) -> list[set[int]]:
    """Ids of all candidates that have been evaluated after each stage."""
    return [run.evaluated_at(stage) for stage in range(run.config.search.rungs)]


def _complete(run: Run, generation: int, evaluated: Sequence[set[int]]) -> bool:
    return all(reaching(run, generation, stage) <= done for stage, done in enumerate(evaluated))
