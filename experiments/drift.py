"""The null model of a search: the same search with random fitness.

A gene that begins near one end of its range can only move away from it, and selection by random fitness moves genes
too. A result counts as the work of selection only where it lies outside the range of the null model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evolve.config.run_config import EyeConfig, RunConfig
from evolve.genome.phenotype import Phenotype, develop
from evolve.search.search import Search
from experiments.candidates import NO_NUMBER, Row, anatomy
from experiments.means import LAST

__all__ = ["POOLS", "SEEDS", "Drift", "drifted", "of_the_end", "shade"]

SEEDS = 1000
POOLS = 20_000  # of searches drawn together, where several runs are compared with the null model as one
TIE = 1e-5  # relative: what `ends` tell, six digits, may be equal to a value that has more
FIRST_SEED = 10_000  # none that anybody takes for a run


@dataclass(frozen=True)
class Drift:
    """Mean of a quantity over the candidates of a generation: median over searches, and the range of 95 % of them. At
    the end of a phase another row, of its last LAST generations together, with what every search came to (`ends`)."""

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

    def p(self, *values: float) -> float:
        """Two-sided p of a value, were it drawn like these: the one that is asked about counts as one of them (Davison
        and Hinkley 1997, §4.2), so that it is 2 / (searches + 1) at the least. Of several runs' values: that of their
        mean, among the means of as many searches drawn at random, and no less than of one."""
        ends, asked = np.array(self.ends.split(), float), float(np.mean(values))
        several = np.random.default_rng(0).choice(ends, (POOLS, len(values))).mean(axis=1)
        drawn, near = ends if len(values) == 1 else several, TIE * abs(asked)
        share = min((drawn <= asked + near).sum(), (drawn >= asked - near).sum()) / drawn.size
        return min(1.0, 2 * (float(share) * ends.size + 1) / (ends.size + 1))

    def __str__(self) -> str:
        return f"held at {self.median:.3g}" if self.held else f"{self.median:.3g} [{self.low:.3g}, {self.high:.3g}]"


def drifted(
    config: RunConfig, group: str, quantities: Mapping[str, Callable[[Row], float]], generations: int
) -> list[Drift]:
    """Of SEEDS searches with these settings and so many generations; quantities that are no numbers without a life are
    left out."""
    searches = [_means(replace(config, seed=FIRST_SEED + i), quantities, generations) for i in range(SEEDS)]
    means, counts = np.moveaxis(np.array(searches), 2, 0)  # (search, quantity, generation) each
    starts = sorted({use.opens_at for use in config.genome.values() if use.open and use.opens_at < generations})
    rows = []
    for place, name in enumerate(quantities):
        mine = means[:, place]
        if np.isfinite(mine).any(axis=0).all():
            rows += [_drift(group, name, generation, mine[:, generation]) for generation in range(generations)]
            for start, end in zip(starts, [*starts[1:], generations], strict=True):
                late = slice(max(start, end - LAST), end)
                known = counts[:, place, late]
                some = known.any(axis=1)
                ends = np.nansum(mine[some, late] * known[some], axis=1) / known[some].sum(axis=1)  # as `last_values`
                rows.append(replace(_drift(group, name, end - 1, ends), ends=" ".join(f"{one:.6g}" for one in ends)))
    return rows


def of_the_end(drift: list[Drift], generation: int) -> Drift | None:
    """That of the phase that ends with a generation; None where none does."""
    return next((one for one in drift if one.ends and one.generation == generation), None)


def shade(axes: Any, drift: list[Drift], color: str) -> None:
    """Shade the range of the null model over generations; nothing where a gene is held."""
    rows = [one for one in drift if not one.ends and not one.held]
    if rows:
        x, low, high = ([getattr(one, name) for one in rows] for name in ("generation", "low", "high"))
        axes.fill_between(x, low, high, color=color, alpha=0.1, lw=0)
        for edge in (low, high):  # ranges of several groups overlap
            axes.plot(x, edge, color=color, alpha=0.4, lw=0.6)


def _drift(group: str, quantity: str, generation: int, means: NDArray[np.float64]) -> Drift:
    low, median, high = (float(q) for q in np.nanquantile(means, [0.025, 0.5, 0.975]))
    return Drift(group, quantity, generation, low, median, high)


def _means(
    config: RunConfig, quantities: Mapping[str, Callable[[Row], float]], generations: int
) -> list[tuple[list[float], list[int]]]:
    """Of each quantity, for the first generations of one search: means, and of how many candidates."""
    search, chance = Search(config), np.random.default_rng(config.seed)
    found: list[tuple[list[float], list[int]]] = [([], []) for _ in quantities]
    for generation in range(generations):
        proposals = search.propose_generation()
        rows = [_row(develop(proposal.vector, config), config.eye, generation) for proposal in proposals]
        search.tell([(proposal.id, chance.normal()) for proposal in proposals])
        for (means, counts), value in zip(found, quantities.values(), strict=True):
            finite = [v for v in map(value, rows) if math.isfinite(v)]
            means.append(float(np.mean(finite)) if finite else NO_NUMBER)
            counts.append(len(finite))
    return found


def _row(animal: Phenotype, eye: EyeConfig, generation: int) -> Row:
    """Of an animal that has not lived."""
    none: dict[str, Any] = {
        "failed": 0,
        "fitness": NO_NUMBER,
        "success_rate": NO_NUMBER,
        "episodes": 0,
        "parameters": 0,
    }
    return Row(group="", seed=0, generation=generation, phase=0, index=0, **none, **anatomy(animal, eye))
