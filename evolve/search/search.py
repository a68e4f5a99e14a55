"""The search: proposes candidates and is told their fitness, through the phases in which genes open.

Its whole state follows from the seed and the fitness told so far, so a run is continued by proposing and telling again
what was proposed and told before; no state is stored.
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

LOWEST = -1e9  # below any mean return: what a failure counts as while no candidate has succeeded


@dataclass(frozen=True)
class Proposal:
    """A genome to try.

    place: of the candidate in the search
    genome: (dimension,) in [0, 1]
    parents: ids of the candidates that it was made from; in a later phase, before its optimizer names any, that one
        around which the phase began
    """

    place: Place
    genome: tuple[float, ...]
    parents: tuple[int, ...]

    @property
    def id(self) -> int:
        """The candidate's id."""
        return self.place.id

    @property
    def vector(self) -> NDArray[np.float64]:
        return np.array(self.genome)


class Search:
    """Proposes one candidate after the other.

    Where genes open in a later generation, a new optimizer begins there: from the best genome so far, over the genes
    that are open then. Fitness that comes in late is told to the optimizer that had asked for it.

    Raises:
        ConfigError: there is no such optimizer.
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
        """Candidates proposed so far."""
        return self._next

    def propose(self) -> Proposal:
        """The next candidate."""
        place = Place.of(self._next, self._config.search.population)
        if place.index == 0 and place.generation > 0 and place.generation in self._genotype.phases:
            self._begin_phase(place.generation)
        part, parents = self._optimizer.ask(self._next)
        genome = self._base.copy()
        genome[self._varied] = part
        proposal = Proposal(place, tuple(genome.tolist()), parents or self._origin)
        self._asked[self._next] = self._optimizer, proposal
        self._next += 1
        return proposal

    def propose_generation(self) -> list[Proposal]:
        """All candidates of the next generation.

        Raises:
            RuntimeError: the fitness of the last one has not been told yet.
        """
        if self._asked:
            raise RuntimeError("propose_generation: the fitness of the last generation has not been told yet")
        return [self.propose() for _ in range(self._config.search.population)]

    def tell(self, fitness: Sequence[tuple[int, float]]) -> None:
        """(candidate id, fitness) of candidates proposed; -inf (failed) counts as the worst fitness so far, and as
        worse than any that may come before there is one.

        Raises:
            ValueError: a candidate was not proposed, or has been told already.
        """
        for candidate_id, value in fitness:
            if candidate_id not in self._asked:
                raise ValueError(f"tell: candidate {candidate_id} has not been proposed, or has been told already")
            if math.isfinite(value):
                self._worst = min(self._worst, value)
        worst = self._worst if math.isfinite(self._worst) else LOWEST
        for candidate_id, value in fitness:
            optimizer, proposal = self._asked.pop(candidate_id)
            optimizer.tell(candidate_id, value if math.isfinite(value) else worst)
            if value > self._best:
                self._best, self._fittest, self._fittest_id = value, proposal.vector, candidate_id

    def _begin_phase(self, generation: int) -> None:
        """A new optimizer over the genes open in this generation, around the best genome so far."""
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
    """Seed of one candidate's training and evaluation: fresh for each, whoever evaluates it."""
    return int(np.random.SeedSequence([run_seed, candidate_id]).generate_state(1)[0])
