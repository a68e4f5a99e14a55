"""Successive halving within a generation (Jamieson and Talwalkar 2016, algorithm 1).

A training run is divided into parts, called rungs. All candidates of a generation are trained through the first rung.
After each rung, only the better candidates continue to the next rung. The last rung completes the training run. Each
rung starts from the checkpoint of the previous rung, in new worlds whose seeds follow from the candidate and the rung.
The result of a rung therefore depends only on its seeds and its checkpoint. If a run is killed within a rung, the rung
is repeated, with the same result.

The setting `search.rungs` is the number of rungs. After each rung that a candidate
completes, one line is added to the record. The field `rung` of this line is the number of this rung, counted from 0.
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
    """Return the total number of training steps of a candidate at the end of each rung, (rung,)."""
    return tuple(math.ceil(learning.total_steps * search.promoted**after) for after in range(search.rungs - 1, -1, -1))


def sizes(search: SearchConfig) -> tuple[int, ...]:
    """Return the number of candidates of a generation that are trained in each rung, (rung,), if no candidate fails."""
    return tuple(math.ceil(search.population * search.promoted**rung) for rung in range(search.rungs))


def steps(config: RunConfig) -> int:
    """Return the maximum number of agent steps of the whole run."""
    search, reached, total = config.search, 0, 0
    for candidates, end in zip(sizes(search), budgets(search, config.learning), strict=True):
        before, reached = reached, trained_steps(config.learning, reached, end)
        total += candidates * (reached - before)
    return search.generations * total


def trained_steps(learning: LearningConfig, begin: int, end: int) -> int:
    """Return the step at which training from step `begin` to `end` actually ends, unless it stops early.

    It is at least `end`, because training consists of whole rollouts of n_envs x n_steps steps. The steps between two
    evaluations (`eval_interval`) are rounded up to whole rollouts.
    """
    rollout, trained = learning.n_envs * learning.n_steps, begin
    while trained < end:
        trained += rollout * math.ceil(min(learning.eval_interval, end - trained) / rollout)
    return trained


def evaluations(search: SearchConfig) -> int:
    """Return the number of evaluations in the whole run, if no candidate fails.

    A candidate is evaluated after every rung (part of the training run) that it reaches.
    """
    return search.generations * sum(sizes(search))


def promoted(search: SearchConfig, rung: int, fitness: Sequence[tuple[int, float]]) -> set[int]:
    """Return the ids of the candidates that continue after a rung; none after the last rung.

    The fittest candidates continue; of candidates with equal fitness, the one with the lower id has priority. Failed
    candidates (-inf) never continue.

    fitness: (id, fitness) of all candidates that reached the rung
    """
    if rung + 1 >= search.rungs:
        return set()
    able = sorted((pair for pair in fitness if math.isfinite(pair[1])), key=lambda pair: (-pair[1], pair[0]))
    return {candidate_id for candidate_id, _ in able[: sizes(search)[rung + 1]]}


def reaching(run: Run, generation: int, rung: int) -> set[int]:
    """Return the ids of the candidates of a generation that are trained in a rung (a part of the training run).

    All candidates reach the first rung. For a later rung, the set is empty until the previous rung is complete.
    """
    ids = set(generation_ids(generation, run.config.search.population))
    for earlier in range(rung):
        lines = [run.on_record(candidate_id, earlier) for candidate_id in ids]
        known = [(candidate.id, candidate.fitness) for candidate in lines if candidate is not None]
        if len(known) < len(ids):
            return set()
        ids = promoted(run.config.search, earlier, known)
    return ids


def complete(run: Run, generation: int) -> bool:
    """Return whether the evaluation of a generation is complete.

    A candidate is evaluated after every rung (part of the training run) that it reaches.
    """
    return all(
        run.on_record(candidate_id, rung) is not None
        for rung in range(run.config.search.rungs)
        for candidate_id in reaching(run, generation, rung)
    )


def finished(run: Run) -> bool:
    """Return whether the evaluation of all generations of a run is complete."""
    return all(complete(run, generation) for generation in range(run.config.search.generations))
