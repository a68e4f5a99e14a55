"""Budget ladders: successive halving within a generation (Jamieson and Talwalkar 2016, algorithm 1).

All of a generation is trained a little, on the first rung; the better part of each rung goes on to the next, and the
last rung is a whole training. A rung takes a training up where the one below left it, in fresh worlds whose seeds
follow from candidate and rung: what it becomes follows from seeds and the tensors left, so a run that was killed on a
rung begins that rung again, and ends as if nothing had happened.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from evolve.config.run_config import LearningConfig, RunConfig, SearchConfig
from evolve.store.directory import Run

__all__ = ["budgets", "complete", "evaluations", "finished", "promoted", "reaching", "sizes", "steps", "stretches"]


def budgets(search: SearchConfig, learning: LearningConfig) -> tuple[int, ...]:
    """Steps that a training has come to at the end of each rung, (rungs,); the last is a whole training."""
    return tuple(math.ceil(learning.total_steps * search.promoted**above) for above in range(search.rungs - 1, -1, -1))


def stretches(search: SearchConfig, learning: LearningConfig) -> tuple[int, ...]:
    """Steps from one rung to the next, (rungs,)."""
    return tuple(after - before for before, after in pairwise((0, *budgets(search, learning))))


def sizes(search: SearchConfig) -> tuple[int, ...]:
    """Candidates of a generation that reach each rung, (rungs,), if none fails."""
    return tuple(max(1, math.ceil(search.population * search.promoted**rung)) for rung in range(search.rungs))


def steps(config: RunConfig) -> int:
    """Agent steps of the whole run, if all trainings take what they may."""
    climb = zip(sizes(config.search), stretches(config.search, config.learning), strict=True)
    return config.search.generations * sum(size * stretch for size, stretch in climb)


def evaluations(search: SearchConfig) -> int:
    """Evaluations in the whole run: every candidate's, on every rung that it reaches."""
    return search.generations * sum(sizes(search))


def promoted(search: SearchConfig, rung: int, fitness: Sequence[tuple[int, float]]) -> set[int]:
    """Ids that go on from a rung, given (id, fitness) of all that reached it: the fittest, the first of equals; none
    that failed (-inf)."""
    if rung + 1 >= search.rungs:
        return set()
    able = sorted((told for told in fitness if math.isfinite(told[1])), key=lambda told: (-told[1], told[0]))
    return {identity for identity, _ in able[: sizes(search)[rung + 1]]}


def reaching(run: Run, generation: int, rung: int) -> set[int]:
    """Ids of a generation that reach a rung; all of it the first, {} any other before the one below is done."""
    population = run.config.search.population
    ids = set(range(generation * population, (generation + 1) * population))
    for below in range(rung):
        told = [(identity, run.on_record(identity, below)) for identity in ids]
        known = [(identity, candidate.fitness) for identity, candidate in told if candidate is not None]
        if len(known) < len(ids):
            return set()
        ids = promoted(run.config.search, below, known)
    return ids


def complete(run: Run, generation: int) -> bool:
    """Whether all of a generation has been evaluated, on every rung that it reaches."""
    return all(reaching(run, generation, rung) <= run.on_rung(rung) for rung in range(run.config.search.rungs))


def finished(run: Run) -> bool:
    """Whether all of a run has been evaluated."""
    return all(complete(run, generation) for generation in range(run.config.search.generations))
