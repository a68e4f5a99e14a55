"""The null model of a search: the same search with random fitness.

A gene that begins near one end of its range can only move away from it, and selection by random fitness moves genes
too. A result counts as the work of selection only where it lies outside the range of the null model.
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
LAST = 3  # generations whose mean says where a search ends
FIRST_SEED = 10_000  # none that anybody takes for a run
SEVERAL = 20_000  # of searches drawn together, where several runs are compared with the null model as one
TIE = 1e-5  # relative: means over candidates may be equal but for the order in which they were summed, or for digits


@dataclass(frozen=True)
class NullModel:
    """What searches with random fitness come to.

    means: of each quantity, over the candidates of a generation that have it, (search, generation); NaN if none has
    counts: how many have, (search, generation)
    """

    means: Mapping[str, Floats]
    counts: Mapping[str, NDArray[np.int64]]

    def ends(self, quantity: str, generations: range) -> Floats:
        """Mean over all candidates of these generations, (search,), of the searches in which some have the quantity."""
        late = slice(generations.start, generations.stop)
        means, counts = self.means[quantity][:, late], self.counts[quantity][:, late]
        some = counts.any(axis=1)
        ends: Floats = np.nansum(means[some] * counts[some], axis=1) / counts[some].sum(axis=1)
        return ends


def null_model(
    config: RunConfig, measure: Measure, generations: int, searches: int, done: Callable[[float], None] = lambda _: None
) -> NullModel:
    """The first generations of so many searches with these settings, from other seeds than theirs.

    measure: quantities of an animal that has not lived, the same ones of each; NaN for what it does not have
    done: told what share of the searches has been made
    """
    found = []
    for i in range(searches):
        found.append(_search(replace(config, seed=FIRST_SEED + i), measure, generations))
        done((i + 1) / searches)
    names = found[0].keys()
    means, counts = ({name: np.array([one[name][part] for one in found]) for name in names} for part in (0, 1))
    return NullModel(means, counts)


def _search(config: RunConfig, measure: Measure, generations: int) -> dict[str, tuple[list[float], list[int]]]:
    """Of each quantity: its mean in each generation, and over how many candidates."""
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
    """A generation after the other; in the steady state candidates are told, and others proposed, one by one."""
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
    """The last LAST generations of each phase of a search that goes on for so many, or all of a shorter phase."""
    starts = sorted({use.opens_at for use in config.genome.values() if use.open and use.opens_at < generations})
    ends = [*starts[1:], generations]
    return [range(max(start, end - LAST), end) for start, end in zip(starts, ends, strict=True)]


def p_value(values: Sequence[float], ends: Floats) -> float:
    """Two-sided p of a run's end, were it drawn like these of the null model: the one that is asked about counts as one
    of them (Davison and Hinkley 1997, §4.2), so that it is 2 / (searches + 1) at the least. Of several runs' ends: that
    of their mean, among the means of as many searches drawn at random, and no less than of one."""
    asked = float(np.mean(values))
    several = np.random.default_rng(0).choice(ends, (SEVERAL, len(values))).mean(axis=1)
    drawn, near = ends if len(values) == 1 else several, TIE * abs(asked)
    share = min((drawn <= asked + near).sum(), (drawn >= asked - near).sum()) / drawn.size
    return min(1.0, 2 * (float(share) * ends.size + 1) / (ends.size + 1))
