"""What chance alone makes of a search: the same one, with fitness drawn at random.

Genes that begin near one end of their range can only move away from it, and selection that sees nothing but luck moves
them too. What a run did counts as selection's work only where it leaves what is found here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evolve.config import RunConfig
from evolve.development import Phenotype, develop
from evolve.search import Search
from experiments.candidates import NO_NUMBER, Row, anatomy
from experiments.means import LAST

__all__ = ["END", "SEEDS", "Drift", "drifted", "of_the_end", "shade"]

SEEDS = 200
END = -1  # the "generation" that stands for the mean of the last LAST
FIRST_SEED = 10_000  # none that anybody takes for a run


@dataclass(frozen=True)
class Drift:
    """Mean of a quantity over the candidates of a generation, or of the last ones (END): median over searches, and
    the range of 95 % of them; of the END, what every search came to."""

    group: str
    quantity: str
    generation: int
    low: float
    median: float
    high: float
    ends: str = ""

    @property
    def held(self) -> bool:
        """Nothing moves it: its gene is closed."""
        return self.low == self.high

    def as_far(self, value: float) -> float:
        """Share of searches that came at least as far from the middle, on whichever side (two-sided, the one that is
        asked about counted as one of them: Davison and Hinkley 1997, §4.2)."""
        ends = np.array(self.ends.split(), float)
        fewer = min((ends <= value).sum(), (ends >= value).sum())
        return min(1.0, 2 * (float(fewer) + 1) / (ends.size + 1))

    def __str__(self) -> str:
        return f"held at {self.median:.3g}" if self.held else f"{self.median:.3g} [{self.low:.3g}, {self.high:.3g}]"


def drifted(config: RunConfig, group: str, quantities: Mapping[str, Callable[[Row], float]]) -> list[Drift]:
    """Of SEEDS searches with these settings; quantities that are no numbers without a life are left out."""
    searches = [_means(replace(config, seed=FIRST_SEED + i), quantities) for i in range(SEEDS)]
    means = np.array(searches)  # (search, quantity, generation)
    rows = []
    for place, name in enumerate(quantities):
        mine = means[:, place]
        if np.isfinite(mine).any(axis=0).all():
            rows += [_drift(group, name, generation, mine[:, generation]) for generation in range(mine.shape[1])]
            late = mine[:, -LAST:]
            ends = np.nanmean(late[np.isfinite(late).any(axis=1)], axis=1)
            rows.append(replace(_drift(group, name, END, ends), ends=" ".join(f"{end:.4g}" for end in ends)))
    return rows


def of_the_end(drift: list[Drift], before: int | None = None) -> Drift | None:
    """That of the last generations together, or of the last one before a generation; None where there is none."""
    wanted = END if before is None else before - 1
    return next((one for one in drift if one.generation == wanted), None)


def shade(axes: Any, drift: list[Drift], color: str) -> None:
    """Shade what chance alone makes, over generations; nothing where a gene is held."""
    rows = [one for one in drift if one.generation != END and not one.held]
    if rows:
        x, low, high = ([getattr(one, name) for one in rows] for name in ("generation", "low", "high"))
        axes.fill_between(x, low, high, color=color, alpha=0.1, lw=0)


def _drift(group: str, quantity: str, generation: int, means: NDArray[np.float64]) -> Drift:
    low, median, high = (float(q) for q in np.nanquantile(means, [0.025, 0.5, 0.975]))
    return Drift(group, quantity, generation, low, median, high)


def _means(config: RunConfig, quantities: Mapping[str, Callable[[Row], float]]) -> list[list[float]]:
    """Of each quantity, for every generation of one search."""
    search, chance = Search(config), np.random.default_rng(config.seed)
    means: list[list[float]] = [[] for _ in quantities]
    for generation in range(config.search.generations):
        proposals = search.propose_generation()
        rows = [_row(develop(proposal.vector, config), generation) for proposal in proposals]
        search.tell([(proposal.id, chance.normal()) for proposal in proposals])
        for mine, value in zip(means, quantities.values(), strict=True):
            finite = [v for v in map(value, rows) if math.isfinite(v)]
            mine.append(float(np.mean(finite)) if finite else NO_NUMBER)
    return means


def _row(animal: Phenotype, generation: int) -> Row:
    """Of an animal that has not lived."""
    none: dict[str, Any] = {
        "failed": 0,
        "fitness": NO_NUMBER,
        "success_rate": NO_NUMBER,
        "episodes": 0,
        "parameters": 0,
    }
    return Row(group="", seed=0, generation=generation, phase=0, index=0, **none, **anatomy(animal))
