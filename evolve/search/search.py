"""The search, which proposes candidates and receives their fitness.

A gene begins to vary in the generation that its setting `opens_at` gives, which need not be the first one. A phase
begins with a generation in which genes begin to vary. It lasts until the next such generation, or to the end of the
search. The state of the search follows from the settings, the seed and the fitness values received so far. A run is
continued by repeating all proposals and reporting all recorded fitness values again; no state is stored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evolve.config.numbering import Place
from evolve.config.run_config import RunConfig
from evolve.genome.genotype import Genotype
from evolve.search.optimizers import Optimizer, Space, build_optimizer

__all__ = ["Proposal", "Search", "training_seed"]

LOWEST = -1e9  # fitness of failed candidates before any candidate has succeeded; lower than any mean return


@dataclass(frozen=True)
class Proposal:
    """A proposed genome.

    place: id of the candidate, its generation, and its number in this generation
    genome: coordinates, in [0, 1], of all genes that vary in at least one generation of the search
    parents: ids of the candidates from which the optimizer derived the genome. When further genes begin to vary, a new
        optimizer starts from the best candidate so far, if there is one. This candidate counts as the parent until the
        new optimizer names parents.
    """

    place: Place
    genome: tuple[float, ...]
    parents: tuple[int, ...]

    @property
    def id(self) -> int:
        """Id of the candidate."""
        return self.place.id

    @property
    def vector(self) -> NDArray[np.float64]:
        """The genome as an array, (gene,)."""
        return np.array(self.genome)


class Search:
    """Search that proposes one candidate after the other.

    In each generation in which further genes begin to vary, a new optimizer starts from the best genome so far, or
    from the start genome if no candidate has succeeded. This optimizer varies these genes and those that varied before.
    Each optimizer receives the fitness of the candidates that it has proposed.

    Raises:
        ConfigError: the optimizer is unknown, or cannot be built for this genome and population.
    """

    def __init__(self, config: RunConfig) -> None:
        self._config = config
        self._genotype = Genotype(config.genome)
        self._next = 0
        self._fittest, self._best = self._genotype.start, -math.inf
        self._fittest_id: int | None = None
        self._worst = math.inf
        self._asked: dict[int, tuple[Optimizer, Proposal]] = {}
        self._begin_phase(0)

    @property
    def proposed(self) -> int:
        """Number of candidates proposed so far."""
        return self._next

    def propose(self) -> Proposal:
        """Return the next candidate."""
        place = Place.from_id(self._next, self._config.search.population)
        if place.index == 0 and place.generation in self._genotype.phases[1:]:
            self._begin_phase(place.generation)
        part, parents = self._optimizer.ask(self._next)
        genome = self._base.copy()
        genome[self._varied] = part
        proposal = Proposal(place, tuple(genome.tolist()), parents or self._origin)
        self._asked[self._next] = self._optimizer, proposal
        self._next += 1
        return proposal

    def propose_generation(self) -> list[Proposal]:
        """Return all candidates of the next generation.

        Raises:
            RuntimeError: the fitness of the last generation is not complete.
        """
        if self._asked:
            raise RuntimeError("propose_generation: the fitness of the last generation is not complete")
        return [self.propose() for _ in range(self._config.search.population)]

    def tell(self, fitness: Sequence[tuple[int, float]]) -> None:
        """Receive (candidate id, fitness) of proposed candidates.

        A failed candidate has the fitness -inf. The optimizer receives the lowest fitness so far instead, or -10⁹ if
        no candidate has succeeded.

        Raises:
            ValueError: a candidate was not proposed, or its fitness has been received already.
        """
        for candidate_id, value in fitness:
            if candidate_id not in self._asked:
                raise ValueError(f"tell: candidate {candidate_id} was not proposed, or already has a fitness")
            if math.isfinite(value):
                self._worst = min(self._worst, value)
        worst = self._worst if math.isfinite(self._worst) else LOWEST
        for candidate_id, value in fitness:
            optimizer, proposal = self._asked.pop(candidate_id)
            optimizer.tell(candidate_id, value if math.isfinite(value) else worst)
            if value > self._best:
                self._best, self._fittest, self._fittest_id = value, proposal.vector, candidate_id

    def _begin_phase(self, generation: int) -> None:
        """Start a new optimizer at the best genome so far; it varies the genes that may vary in this generation."""
        self._base = self._fittest
        self._origin = () if self._fittest_id is None else (self._fittest_id,)
        self._varied = self._genotype.varied(generation)
        genes = [(gene, self._config.genome[gene.name]) for gene in self._genotype.open_genes]
        phase = [generation] if generation else []
        space = Space(
            genes=[genes[place] for place in self._varied],
            start=self._base[self._varied],
            seed=(self._config.seed, *phase),
        )
        self._optimizer = build_optimizer(space, self._config.search)


def training_seed(run_seed: int, candidate_id: int) -> int:
    """Return the seed for the training and evaluation of a candidate.

    The function computes this seed from the seed of the run and the id of the candidate.

    run_seed: the setting `seed` of the run
    """
    return int(np.random.SeedSequence([run_seed, candidate_id]).generate_state(1).item())
