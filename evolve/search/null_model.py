"""Null model of a search: the same search with random task fitness.

The values of genes can change without any selection for them. A gene that starts near one end of its range can only
move away from this end, and selection by random fitness also moves genes. The final values of a run are therefore
evidence of selection only if they lie outside the range of the null model.

Costs also select: with a price per receptor, even random task fitness leads to few receptors. The null model therefore
subtracts the costs from its random task fitness. If the result of a run lies outside the range of the null model, this
is evidence of selection by the task itself.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype, develop
from evolve.search.search import Proposal, Search
from evolve.store.directory import Run

__all__ = ["FIRST_SEED", "LAST", "SEVERAL", "NullModel", "fitness_spread", "last_generations", "null_model", "p_value"]

Floats = NDArray[np.float64]
Measure: TypeAlias = "Callable[[Phenotype], Mapping[str, float]]"
LAST = 3  # number of generations at the end over which the final value of a quantity is averaged
FIRST_SEED = 10_000  # seed of the first search; larger than the usual seeds of runs
SEVERAL = 20_000  # number of random groups of searches with which the mean of several runs is compared
# Relative difference up to which two means count as equal. Equal means may differ by the order of sums and by rounding.
TIE = 1e-5


@dataclass(frozen=True)
class NullModel:
    """Results of searches with random fitness: means of measured quantities, such as the number of receptors.

    Both fields map the name of a quantity to an array (search, generation). Some candidates lack a quantity.

    means: mean over the candidates of the generation that have the quantity; NaN if no candidate has it
    counts: number of candidates of the generation that have the quantity
    """

    means: Mapping[str, Floats]
    counts: Mapping[str, NDArray[np.int64]]

    def ends(self, quantity: str, generations: range) -> Floats:
        """Return, for each search, the mean of a quantity over all candidates of these generations: array (search,).

        Searches in which no candidate has the quantity are omitted.
        """
        late = slice(generations.start, generations.stop)
        means, counts = self.means[quantity][:, late], self.counts[quantity][:, late]
        some = counts.any(axis=1)
        ends: Floats = np.nansum(means[some] * counts[some], axis=1) / counts[some].sum(axis=1)
        return ends


def null_model(
    config: RunConfig,
    measure: Measure,
    generations: int,
    searches: int,
    done: Callable[[float], None] = lambda _: None,
    spread: Sequence[float] = (),
) -> NullModel:
    """Run searches with these settings, but with random task fitness and other seeds.

    config: settings of the run; its seed is not used
    measure: function that returns quantities of an untrained animal by name. It returns the same names for all animals,
        with NaN for quantities that an animal lacks.
    generations: number of generations of each search
    searches: number of searches, at least 1
    done: function that is called with the completed fraction of the searches
    spread: standard deviation of task fitness in each generation, from `fitness_spread`. Only needed if the settings
        subtract costs of eyes and brain from the fitness. Without costs, the standard deviation is 1, because CMA-ES
        and "mutation" use only the order of fitness values.

    Raises:
        ValueError: there are costs, and `spread` has fewer values than generations.
        ConfigError: the optimizer is unknown, or cannot be built for this genome and population.
    """
    if not config.costs.free and len(spread) < generations:
        raise ValueError(f"spread has {len(spread)} values: must be {generations}, one for each generation")
    found = []
    for i in range(searches):
        found.append(_search(replace(config, seed=FIRST_SEED + i), measure, generations, spread))
        done((i + 1) / searches)
    names = found[0].keys()
    means, counts = ({name: np.array([one[name][part] for one in found]) for name in names} for part in (0, 1))
    return NullModel(means, counts)


def fitness_spread(runs: Sequence[Run], generations: int) -> list[float]:
    """Return the standard deviation of task fitness within each generation, pooled over the runs.

    For a generation in which no run has two successful candidates, the value is pooled over all generations. If there
    is no such generation, all values are 0.

    generations: number of generations, counted from the first
    """
    squares, free = np.zeros(generations), np.zeros(generations)
    for run in runs:
        for generation in range(generations):
            members = run.generation(generation)
            values = np.array([one.task_fitness for one in members if one.failure is None])
            if values.size > 1:
                squares[generation] += np.square(values - values.mean()).sum()
                free[generation] += values.size - 1
    overall = squares.sum() / max(free.sum(), 1)
    variances = np.divide(squares, free, out=np.full(generations, overall), where=free > 0)
    return [float(spread) for spread in np.sqrt(variances)]


def _search(
    config: RunConfig, measure: Measure, generations: int, spread: Sequence[float]
) -> dict[str, tuple[list[float], list[int]]]:
    """Return, for each quantity that `measure` returns, its mean and the number of its values in each generation.

    Candidates for which the value is NaN are not counted. If no candidate has a value, the mean is NaN.

    spread: standard deviation of task fitness in each generation; only needed if eyes and brain have costs
    """
    found: dict[str, tuple[list[float], list[int]]] = {}
    for proposals in _proposals(config, generations, spread):
        measured = [measure(develop(proposal.vector, config)) for proposal in proposals]
        for name in measured[0]:
            finite = [value for one in measured if math.isfinite(value := one[name])]
            means, counts = found.setdefault(name, ([], []))
            means.append(float(np.mean(finite)) if finite else math.nan)
            counts.append(len(finite))
    return found


def _proposals(config: RunConfig, generations: int, spread: Sequence[float]) -> Iterator[list[Proposal]]:
    """Yield the proposals of one generation after the other, and report a random fitness for each proposal.

    Without costs of eyes and brain, the fitness is a standard normal random number. With costs, this number is
    multiplied by the value of `spread` for the generation, and the costs are subtracted from the product.

    With `search.steady_state`, as in a run, the first generation is proposed before any fitness is reported. Before
    each later proposal, one fitness is reported: that of the oldest proposal whose fitness has not been reported yet.
    """
    search, chance = Search(config), np.random.default_rng(config.seed)

    def fitness(proposal: Proposal) -> float:
        drawn = chance.normal()
        if config.costs.free:
            return drawn
        costs = config.costs.total(develop(proposal.vector, config), config.eye)
        return spread[proposal.place.generation] * drawn - costs

    if not config.search.steady_state:
        for _ in range(generations):
            proposals = search.propose_generation()
            yield proposals
            search.tell([(proposal.id, fitness(proposal)) for proposal in proposals])
        return
    size = config.search.population
    proposals = [search.propose() for _ in range(size)]
    under_way = deque(proposals)
    while len(proposals) < generations * size:
        proposal = under_way.popleft()
        search.tell([(proposal.id, fitness(proposal))])
        proposals.append(search.propose())
        under_way.append(proposals[-1])
    for generation in range(generations):
        yield proposals[generation * size : (generation + 1) * size]


def last_generations(config: RunConfig, generations: int) -> list[range]:
    """Return the final 3 generations of each phase, or all generations of a shorter phase.

    A phase begins with a generation in which genes begin to vary. It lasts until the next such generation, or to the
    end of the search.

    generations: number of generations of the search
    """
    starts = sorted({use.opens_at for use in config.genome.values() if use.open and use.opens_at < generations})
    return [range(max(start, end - LAST), end) for start, end in pairwise([*starts, generations])]


def p_value(values: Sequence[float], ends: Floats) -> float:
    """Return the two-sided p-value of a quantity's final values in one or several runs, tested against the null model.

    The samples of the null model are searches with random fitness. The value of a single run counts as an additional
    sample (Davison and Hinkley 1997, §4.2). Therefore, p is at least 2 / (searches + 1). For several runs, their mean
    is compared with the means of random groups of searches, drawn with a fixed seed. The number of searches in a group
    is the number of runs. Here, too, p is at least 2 / (searches + 1).

    values: final value of a quantity in each run
    ends: final values of the quantity in the searches, from `NullModel.ends`: array (search,)
    """
    mean = float(np.mean(values))
    several = np.random.default_rng(0).choice(ends, (SEVERAL, len(values))).mean(axis=1)
    drawn, near = ends if len(values) == 1 else several, TIE * abs(mean)
    tail = min((drawn <= mean + near).sum(), (drawn >= mean - near).sum()) / drawn.size
    return min(1.0, 2 * (float(tail) * ends.size + 1) / (ends.size + 1))
