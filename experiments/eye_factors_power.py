"""Claims of the experiment on factors of eyes: which are decided, and which need more training runs.

The training runs are evaluated after LOOKS runs of each animal. A claim that is decided needs no further runs, and an
open one waits for the next look. Each look has the level of Pocock's group-sequential design, so that a claim without a
true effect is called an effect in at most 5 % of all experiments.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from scipy.stats import nct, t

from experiments.designed import Design, Trained
from experiments.eye_factors_design import RUNS, TASKS, Control, animals, controls, factorial, has, in_task
from experiments.eye_factors_estimates import advantage, effects_in, in_units
from experiments.factorial import interaction_with_task
from experiments.means import Interval

__all__ = ["BETWEEN", "CONFIDENCE", "LOOKS", "Claim", "Verdict", "claims", "needed", "power", "runs_for", "verdict"]

LOOKS = (4, 8, RUNS)  # training runs of each animal when the claims are evaluated
CONFIDENCE = 1 - 0.0221  # of intervals in each of three looks, for 95 % over all of them (Pocock 1977)
POWER = 0.8
BETWEEN = "maze - detection"  # task of claims about the difference between the tasks
# Smallest differences that matter, in standard deviations of training runs: of an effect, of an effect between tasks,
# and of a comparison of two animals. 1.5 is about half of the difference in mazes that earlier trials suggested.
EFFECT, EFFECT_BETWEEN, COMPARISON = 0.5, 0.75, 1.5


@dataclass(frozen=True)
class Claim:
    """An effect or a comparison in one task, or an effect between the tasks.

    of: names of one factor or of two interacting ones, or a comparison under a control
    relevant: smallest difference that matters [standard deviations of training runs]
    """

    task: str
    of: tuple[str, ...] | Control
    relevant: float

    @property
    def spread(self) -> float:
        """Standard deviation of an estimate from one run of each animal [standard deviations of training runs]."""
        if isinstance(self.of, Control):
            return math.sqrt(2)
        return 2 * math.sqrt((1 + (self.task == BETWEEN)) / len(factorial()))

    def freedom(self, runs: int) -> int:
        """Return the degrees of freedom of the estimate's interval with this number of runs of each animal."""
        tasks = 1 + (self.task == BETWEEN)
        return runs - 1 if isinstance(self.of, Control) else tasks * (len(factorial()) - 1) * (runs - 1)

    @property
    def trained(self) -> list[tuple[str, Design]]:
        """Tasks and animals that the claim compares."""
        compared = (self.of.many, self.of.few) if isinstance(self.of, Control) else factorial()
        tasks = TASKS if self.task == BETWEEN else (self.task,)
        return [(task, animal) for task in tasks for animal in compared]

    def estimate(self, rows: Sequence[Trained]) -> Interval | None:
        """Return the estimate [standard deviations of training runs] from all rows, with the interval of one look."""
        if self.task == BETWEEN:
            first, second = (effects_in(rows, task, CONFIDENCE) for task in TASKS)
            return interaction_with_task(first, second)[self.of] if first and second else None
        mine = effects_in(rows, self.task, CONFIDENCE)
        if isinstance(self.of, Control):
            one = advantage(rows, self.task, self.of, CONFIDENCE)
            return in_units(one, mine.spread) if mine and one else None
        return mine.of[self.of] if mine else None


@dataclass(frozen=True)
class Verdict:
    """State of a claim after the last complete look.

    runs: training runs of each animal at this look; 0 before the first one
    state: "positive", "negative", "negligible" (not relevant in either direction) or "open"
    """

    runs: int
    state: str

    @property
    def decided(self) -> bool:
        return self.state != "open"


@cache
def claims() -> tuple[Claim, ...]:
    """Return all claims, those that matter most to the question first."""
    names = [("n_eyes",), ("width",), ("placement_range_deg",), ("vertical_fov_deg",)]
    compared = [Claim(task, one, COMPARISON) for one in controls() for task in TASKS if has(task, one.many)]
    effects = [Claim(task, one, EFFECT) for one in (*names, ("n_eyes", "placement_range_deg")) for task in TASKS]
    return (*compared, *effects, *(Claim(BETWEEN, one, EFFECT_BETWEEN) for one in names))


def verdict(claim: Claim, rows: Sequence[Trained]) -> Verdict:
    """Return the state of a claim after the last look for which all its animals have been trained."""
    stored = {row.design for row in rows}
    found = Verdict(0, "open")
    for look in LOOKS:
        if found.decided or not stored.issuperset(_runs(claim, look)):
            return found
        found = Verdict(look, _state(claim, claim.estimate([row for row in rows if row.seed < look])))
    return found


def _state(claim: Claim, estimate: Interval | None) -> str:
    if estimate is None:
        return "open"
    if estimate.low > 0 or estimate.high < 0:
        return "positive" if estimate.mean > 0 else "negative"
    return "negligible" if max(-estimate.low, estimate.high) < claim.relevant else "open"


def _runs(claim: Claim, runs: int) -> Iterator[Design]:
    """Yield the first training runs of a claim's animals."""
    for seed in range(runs):
        for task, animal in claim.trained:
            yield in_task(animal, task, seed)


def needed(rows: Sequence[Trained]) -> list[Design]:
    """Return the missing training runs that the claims need up to their next look, in order of the claims.

    All animals are trained until the first look.
    """
    first = [(one, task, seed) for seed in range(LOOKS[0]) for task in TASKS for one in animals() if has(task, one)]
    wanted = dict.fromkeys(in_task(*run) for run in first)
    for claim in claims():
        found = verdict(claim, rows)
        if not found.decided and LOOKS[0] <= found.runs < LOOKS[-1]:
            wanted |= dict.fromkeys(_runs(claim, LOOKS[LOOKS.index(found.runs) + 1]))
    stored = {row.design for row in rows}
    return [one for one in wanted if one not in stored]


def power(claim: Claim, runs: int) -> float:
    """Return the probability that an interval with this number of runs excludes 0, if the true value is `relevant`.

    It follows from the noncentral t distribution. Intervals on the wrong side of 0 are not counted.
    """
    freedom = claim.freedom(runs)
    limit = t.ppf((1 + CONFIDENCE) / 2, freedom)
    return float(nct.sf(limit, freedom, claim.relevant / claim.spread * math.sqrt(runs)))


def runs_for(claim: Claim) -> int:
    """Return the smallest number of runs of each animal that gives a probability of at least POWER."""
    runs = 2
    while power(claim, runs) < POWER:
        runs += 1
    return runs
