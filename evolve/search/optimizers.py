"""Optimizers, which propose genomes one by one and accept their fitness in any order.

The state of an optimizer follows from its seed, and from the sequence of its proposals and of the fitness values that
it has received. A run can therefore be continued by repeating this sequence, and no state needs to be stored. Only this
module imports nevergrad.
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

__all__ = ["OWN", "Optimizer", "Space", "build_optimizer"]

Floats = NDArray[np.float64]
OWN = ("CMA", "mutation")  # names of optimizers that are defined here


@dataclass(frozen=True)
class Space:
    """Search space, in which each coordinate is in [0, 1], with the start and the seed of the search.

    genes: the genes that vary, each with its settings in the run; only the optimizer "mutation" needs them
    start: genome from which the search starts, (dimension,)
    seed: seed of random numbers, as integers for NumPy's `SeedSequence`
    """

    genes: Sequence[tuple[Gene, GeneConfig]]
    start: Floats
    seed: Sequence[int]


class Optimizer(Protocol):
    """Protocol of optimizers, which propose genomes and maximise fitness."""

    def ask(self, candidate_id: int) -> tuple[Floats, tuple[int, ...]]:
        """Return a genome (dimension,) for the candidate with this id, and the ids of its parents."""

    def tell(self, candidate_id: int, fitness: float) -> None:
        """Receive the fitness of a proposed candidate. The fitness must be finite."""


def build_optimizer(space: Space, search: SearchConfig) -> Optimizer:
    """Return the optimizer that `search.optimizer` names.

    Raises:
        ConfigError: the name is unknown, or the optimizer cannot be used here.
    """
    if search.optimizer == "mutation":
        return Mutation(space, search)
    if search.optimizer == "CMA":
        return CMA(space, search)
    return Named(space, search)


class Mutation:
    """Optimizer that mutates every gene of a parent. A real gene changes by a Gaussian step, an integer by -1, 0 or +1.

    The parent is drawn at random from the fittest candidates of the last two populations with known fitness. The number
    of these candidates is a quarter of a population, rounded down, but at least 1. Older candidates are excluded, so
    that a fitness that was high by chance has no permanent effect. Before any fitness is known, the parent is the start
    genome.
    """

    def __init__(self, space: Space, search: SearchConfig) -> None:
        self._space, self._sigma = space, search.sigma
        self._parents = max(1, search.population // 4)
        self._received: deque[tuple[int, float]] = deque(maxlen=2 * search.population)
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
        self._received.append((candidate_id, fitness))

    def _parent(self, chance: np.random.Generator) -> int | None:
        best = sorted(self._received, key=lambda pair: (-pair[1], pair[0]))[: self._parents]
        return best[int(chance.integers(len(best)))][0] if best else None


class Named:
    """Any optimizer of nevergrad, by its name in nevergrad's registry.

    The setting `search.sigma` is the standard deviation of nevergrad's mutations. Many optimizers use these mutations.

    Raises:
        ConfigError: the name is unknown, or the optimizer cannot be used here.
    """

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
    """CMA-ES (Hansen and Ostermeier 2001), implemented by pycma, which is called through nevergrad.

    The initial step size is `search.sigma`. As soon as the fitness of all candidates of a population is known, CMA-ES
    computes a weighted mean of the better half of this population. It samples new candidates around this mean. The
    members of the better half are recorded as the parents of each new candidate.

    nevergrad has an option for noisy functions, but its CMA-ES uses this option only to recommend a single best genome.
    The option is not set, because the best candidate is taken from the record of the run, which contains every
    evaluated candidate with its fitness.
    """

    def __init__(self, space: Space, search: SearchConfig) -> None:
        super().__init__(space, search)
        self._population = search.population
        self._better_half: tuple[int, ...] = ()
        self._received: list[tuple[int, float]] = []

    def _build(self, space: Space, search: SearchConfig) -> Any:
        from nevergrad.optimization.optimizerlib import ParametrizedCMA

        def scaled(scale: float) -> Any:
            # `CMA_active` gives negative weights to the worse half. Samples are reflected at the bounds. Near a bound,
            # negative weights therefore shrink the covariance in the direction across the bound to zero. Steps in this
            # direction then count as very long, so that the step size grows without limit.
            configured = ParametrizedCMA(scale=scale, popsize=search.population, inopts={"CMA_active": search.active})
            return configured(_array(space, 1.0), num_workers=search.population)

        # nevergrad multiplies the step size by an internal factor in bounded spaces. The division compensates for it.
        return scaled(search.sigma / scaled(1.0).es.sigma)

    def tell(self, candidate_id: int, fitness: float) -> None:
        super().tell(candidate_id, fitness)
        self._received.append((candidate_id, fitness))
        if len(self._received) == self._population:
            best = sorted(self._received, key=lambda pair: (-pair[1], pair[0]))[: self._population // 2]
            self._better_half, self._received = tuple(sorted(candidate_id for candidate_id, _ in best)), []

    def _parents(self, candidate: Any) -> tuple[int, ...]:
        return self._better_half


def _array(space: Space, sigma: float) -> Any:
    """Return nevergrad's description of the search space: an array of coordinates in [0, 1].

    sigma: standard deviation of nevergrad's mutations
    """
    from nevergrad import p

    # CMA-ES needs at least two dimensions to adapt a covariance. With one dimension, nevergrad would require an
    # optional package. If only one gene varies, an additional coordinate is therefore added and ignored.
    padded = np.append(space.start, 0.5) if space.start.size == 1 else space.start
    array = p.Array(init=padded, lower=0.0, upper=1.0).set_mutation(sigma=sigma)
    array.random_state.seed(np.random.SeedSequence(list(space.seed)).generate_state(4))
    return array


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress a warning of pycma and all warnings of nevergrad. All of them are harmless here.

    In small populations, pycma adds mirrored samples, which it calls injected solutions. nevergrad reflects them at the
    bounds. pycma then no longer recognises them, and warns. This is harmless, because the reflected samples are
    evaluated, and pycma receives them together with their fitness.

    nevergrad warns, for example, that some optimizers learn only from complete populations.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="orphanated injected solution")
        warnings.filterwarnings("ignore", module="nevergrad")
        yield
