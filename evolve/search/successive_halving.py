"""Budget ladders: successive halving within a generation (Jamieson and Talwalkar 2016, algorithm 1).

All of a generation is trained a little, on the first rung; the better part of each rung goes on to the next, and the
last rung is a whole training. A rung takes a training up where the one below left it, in fresh worlds whose seeds
follow from candidate and rung: what it becomes follows from seeds and the tensors left, so a run that was killed on a
rung begins that rung again, and ends as if nothing had happened.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from evolve.config.run_config import LearningConfig, RunConfig, SearchConfig

__all__ = ["Stretch", "budgets", "climbers", "evaluations", "sizes", "steps", "stretches"]


@dataclass(frozen=True)
class Stretch:
    """A training from its beginning to one of its rungs.

    budgets      steps trained at the end of this rung, and of each below it, ascending
    checkpoints  where the training is kept as it stands at each of them; those that are missing are trained again
    """

    budgets: tuple[int, ...]
    checkpoints: tuple[Path, ...]

    @property
    def rung(self) -> int:
        return len(self.budgets) - 1


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


def climbers(search: SearchConfig, rung: int, fitness: Sequence[tuple[int, float]]) -> set[int]:
    """Ids that go on from a rung, given (id, fitness) of all that reached it: the fittest, the first of equals; none
    that failed (-inf)."""
    if rung + 1 >= search.rungs:
        return set()
    able = sorted((told for told in fitness if math.isfinite(told[1])), key=lambda told: (-told[1], told[0]))
    return {identity for identity, _ in able[: sizes(search)[rung + 1]]}
