"""Optimizers: each proposes genomes one by one and is told the fitness of each, in any order.

All that an optimizer does follows from its seed and from what it was asked and told, in that order; that is how a run
continues without stored state. nevergrad is imported here and nowhere else.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evolve.config.checks import ConfigError, suggestion
from evolve.config.run_config import SearchConfig
from evolve.genome.genes import Gene, GeneConfig

__all__ = ["Optimizer", "Space", "build_optimizer"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Space:
    """What is searched, in coordinates [0, 1]: `genes` with their uses, from `start`, with all chance from `seed`."""

    genes: Sequence[tuple[Gene, GeneConfig]]
    start: Floats
    seed: Sequence[int]


class Optimizer(Protocol):
    """Someone who proposes genomes and learns from their fitness, which it maximises."""

    def ask(self, candidate_id: int) -> tuple[Floats, tuple[int, ...]]:
        """Genome for the candidate with this id, and the candidates it was made from."""

    def tell(self, candidate_id: int, fitness: float) -> None:
        """Fitness of a candidate that was asked for; finite."""


def build_optimizer(space: Space, search: SearchConfig) -> Optimizer:
    """The optimizer that `search.optimizer` names.

    Raises:
        ConfigError: there is none of that name, or it cannot be used here.
    """
    if search.optimizer == "mutation":
        return Mutation(space, search)
    if search.optimizer == "CMA":
        return CMA(space, search)
    return Named(space, search)


class Mutation:
    """Children of the fittest, one mutation of each gene away: Gaussian for real genes, -1, 0 or +1 for integers.

    Parents are the fittest of the last two populations told, a quarter as many as one has. Luck in noisy fitness
    expires with them.
    """

    def __init__(self, space: Space, search: SearchConfig) -> None:
        self._space, self._sigma = space, search.sigma
        self._parents = max(1, search.population // 4)
        self._told: deque[tuple[int, float]] = deque(maxlen=2 * search.population)
        self._genomes: dict[int, Floats] = {}

    def ask(self, candidate_id: int) -> tuple[Floats, tuple[int, ...]]:
        chance = np.random.default_rng([*self._space.seed, candidate_id])
        parent = self._parent(chance)
        genome = self._space.start if parent is None else self._genomes[parent]
        normal, steps = chance.standard_normal(genome.size), chance.integers(-1, 2, genome.size)
        child = [
            gene.mutated(float(u), self._sigma, float(normal[i]), int(steps[i]), use)
            for i, ((gene, use), u) in enumerate(zip(self._space.genes, genome, strict=True))
        ]
        self._genomes[candidate_id] = np.array(child)
        return self._genomes[candidate_id], () if parent is None else (parent,)

    def tell(self, candidate_id: int, fitness: float) -> None:
        self._told.append((candidate_id, fitness))

    def _parent(self, chance: np.random.Generator) -> int | None:
        best = sorted(self._told, key=lambda told: (-told[1], told[0]))[: self._parents]
        return best[int(chance.integers(len(best)))][0] if best else None


class Named:
    """Any optimizer of nevergrad; its step is `sigma`, if it knows one."""

    def __init__(self, space: Space, search: SearchConfig) -> None:
        self._dimension = space.start.size
        self._asked: dict[int, Any] = {}
        self._ids: dict[str, int] = {}
        self._optimizer = self._build(space, search)

    def _build(self, space: Space, search: SearchConfig) -> Any:
        from nevergrad.optimization.optimizerlib import registry

        name = search.optimizer
        if name not in registry:
            known = suggestion(name, ("CMA", "mutation", *sorted(registry)))
            hint = known if known.startswith("did") else "see nevergrad's list of optimizers"
            raise ConfigError(
                f"search.optimizer = {name!r}: must be CMA, mutation or one of nevergrad's; {hint}", "search.optimizer"
            )
        budget = search.population * search.generations
        try:
            return registry[name](_array(space, search.sigma), budget=budget, num_workers=search.population)
        except Exception as error:
            reason = " ".join(str(error).split())
            raise ConfigError(
                f"search.optimizer = {name!r}: cannot be used here: {reason}", "search.optimizer"
            ) from error

    def ask(self, candidate_id: int) -> tuple[Floats, tuple[int, ...]]:
        with _quiet():
            candidate = self._optimizer.ask()
        self._asked[candidate_id], self._ids[candidate.uid] = candidate, candidate_id
        genome = np.clip(candidate.value[: self._dimension], 0.0, 1.0)
        return genome, self._parents(candidate)

    def tell(self, candidate_id: int, fitness: float) -> None:
        with _quiet():
            self._optimizer.tell(self._asked.pop(candidate_id), -fitness)

    def _parents(self, candidate: Any) -> tuple[int, ...]:
        return tuple(sorted(self._ids[uid] for uid in candidate.parents_uids if uid in self._ids))


class CMA(Named):
    """CMA-ES (Hansen and Ostermeier 2001, as in pycma, by nevergrad), whose first generation spreads by `sigma`.

    A candidate's parents are those whose mean its distribution moved to: the better half of the last population told.

    nevergrad has a flag for noisy functions, but CMA-ES there heeds it only when recommending a single best genome.
    We take the best candidate from the record and ask for no recommendation.
    """

    def __init__(self, space: Space, search: SearchConfig) -> None:
        super().__init__(space, search)
        self._population = search.population
        self._better_half: tuple[int, ...] = ()
        self._told: list[tuple[int, float]] = []

    def _build(self, space: Space, search: SearchConfig) -> Any:
        from nevergrad.optimization.optimizerlib import ParametrizedCMA

        def scaled(scale: float) -> Any:
            # Where samples are reflected at a bound, negative weights shrink the covariance across it to nothing, and
            # what is left of a step there counts as so long that the step size grows without bound.
            configured = ParametrizedCMA(scale=scale, popsize=search.population, inopts={"CMA_active": search.active})
            return configured(_array(space, 1.0), num_workers=search.population)

        # nevergrad shrinks the step in bounded spaces by a factor of its own choosing; it is divided out.
        return scaled(search.sigma / scaled(1.0).es.sigma)

    def tell(self, candidate_id: int, fitness: float) -> None:
        super().tell(candidate_id, fitness)
        self._told.append((candidate_id, fitness))
        if len(self._told) == self._population:
            best = sorted(self._told, key=lambda told: (-told[1], told[0]))[: self._population // 2]
            self._better_half, self._told = tuple(sorted(candidate_id for candidate_id, _ in best)), []

    def _parents(self, candidate: Any) -> tuple[int, ...]:
        return self._better_half


def _array(space: Space, sigma: float) -> Any:
    """nevergrad's array of coordinates in [0, 1]."""
    from nevergrad import p

    # CMA-ES has no covariance to adapt in one dimension (nevergrad would switch to a package we don't depend on):
    # a single open gene gets a coordinate beside it that no one reads.
    padded = np.append(space.start, 0.5) if space.start.size == 1 else space.start
    array = p.Array(init=padded, lower=0.0, upper=1.0).set_mutation(sigma=sigma)
    array.random_state.seed(np.random.SeedSequence(list(space.seed)).generate_state(4))
    return array


@contextmanager
def _quiet() -> Iterator[None]:
    """pycma misses the mirrored samples it planted in a small population when nevergrad tells them as reflected at the
    bounds, and warns; the samples told are those that were evaluated, which is what counts. nevergrad warns of
    optimizers that learn nothing before a whole population is told."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="orphanated injected solution")
        warnings.filterwarnings("ignore", module="nevergrad")
        yield
