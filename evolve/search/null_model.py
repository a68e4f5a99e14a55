"""Null model of a search: the same search with random fitness.

A gene that starts near one end of its range can only move away from it, and selection by random fitness also moves
genes. A result is evidence of selection only if it lies outside the range of the null model.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype, develop
from evolve.search.search import Proposal, Search

__all__ = ["FIRST_SEED", "LAST", "SEVERAL", "NullModel", "last_generations", "null_model", "p_value"]

Floats = NDArray[np.float64]
Measure: TypeAlias = "Callable[[Phenotype], Mapping[str, float]]"
LAST = 3  # number of last generations whose mean is the end of a search
FIRST_SEED = 10_000  # above the usual seeds of runs
SEVERAL = 20_000  # number of random groups of searches for a comparison with the mean of several runs
TIE = 1e-5  # relative difference up to which means count as equal, because of summation order and rounded records


@dataclass(frozen=True)
class NullModel:
    """Results of searches with random fitness.

    means: mean of each quantity over the candidates of a generation that have it, (search, generation); NaN if none has
    counts: number of candidates that have it, (search, generation)
    """

    means: Mapping[str, Floats]
    counts: Mapping[str, NDArray[np.int64]]

    def ends(self, quantity: str, generations: range) -> Floats:
        """Return the mean over all candidates of these generations, (search,).

        Searches in which no candidate has the quantity are omitted.
        """
        late = slice(generations.start, generations.stop)
        means, counts = self.means[quantity][:, late], self.counts[quantity][:, late]
        some = counts.any(axis=1)
        ends: Floats = np.nansum(means[some] * counts[some], axis=1) / counts[some].sum(axis=1)
        return ends


def null_model(
    config: RunConfig, measure: Measure, generations: int, searches: int, done: Callable[[float], None] = lambda _: None
) -> NullModel:
    """Run the first generations of searches with these settings, random fitness and other seeds.

    generations, searches: number of generations of each search, and of searches
    measure: quantities of an untrained animal, the same for all animals; NaN for quantities that it lacks
    done: called with the share of completed searches
    """
    found = []
    for i in range(searches):
        found.append(_search(replace(config, seed=FIRST_SEED + i), measure, generations))
        done((i + 1) / searches)
    names = found[0].keys()
    means, counts = ({name: np.array([one[name][part] for one in found]) for name in names} for part in (0, 1))
    return NullModel(means, counts)


def _search(config: RunConfig, measure: Measure, generations: int) -> dict[str, tuple[list[float], list[int]]]:
    """Return, for each quantity, its mean in each generation and the number of candidates that have it."""
    found: dict[str, tuple[list[float], list[int]]] = {}
    for proposals in _proposals(config, generations):
        measured = [measure(develop(proposal.vector, config)) for proposal in proposals]
        for name in measured[0]:
            finite = [value for one in measured if math.isfinite(value := one[name])]
            means, counts = found.setdefault(name, ([], []))
            means.append(float(np.mean(finite)) if finite else math.nan)
            counts.append(len(finite))
    return found


def _proposals(config: RunConfig, generations: int) -> Iterator[list[Proposal]]:
    """Yield one generation after the other; in the steady state, fitness is reported after each candidate."""
    search, chance = Search(config), np.random.default_rng(config.seed)
    if not config.search.steady_state:
        for _ in range(generations):
            proposals = search.propose_generation()
            yield proposals
            search.tell([(proposal.id, chance.normal()) for proposal in proposals])
        return
    size = config.search.population
    proposals = [search.propose() for _ in range(size)]
    under_way = deque(proposals)
    while len(proposals) < generations * size:
        search.tell([(under_way.popleft().id, chance.normal())])
        proposals.append(search.propose())
        under_way.append(proposals[-1])
    for generation in range(generations):
        yield proposals[generation * size : (generation + 1) * size]


def last_generations(config: RunConfig, generations: int) -> list[range]:
    """Return the last LAST generations of each phase of a search, or all generations of a shorter phase."""
    starts = sorted({use.opens_at for use in config.genome.values() if use.open and use.opens_at < generations})
    ends = [*starts[1:], generations]
    return [range(max(start, end - LAST), end) for start, end in zip(starts, ends, strict=True)]


def p_value(values: Sequence[float], ends: Floats) -> float:
    """Return the two-sided p-value of the ends of one or several runs under the null model.

    For one run, its end counts as an additional sample of the null model (Davison and Hinkley 1997, §4.2), so that p is
    at least 2 / (searches + 1). For several runs, their mean is compared with means of random groups of searches of the
    same number, with the same lower limit of p.
    """
    asked = float(np.mean(values))
    several = np.random.default_rng(0).choice(ends, (SEVERAL, len(values))).mean(axis=1)
    drawn, near = ends if len(values) == 1 else several, TIE * abs(asked)
    share = min((drawn <= asked + near).sum(), (drawn >= asked - near).sum()) / drawn.size
    return min(1.0, 2 * (float(share) * ends.size + 1) / (ends.size + 1))
