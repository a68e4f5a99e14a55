"""The search: CMA-ES that proposes a generation of genomes and is told their fitness.

Its whole state follows from the seed and the fitness told so far, so a run is continued by asking and telling again
what was asked and told before; no state is stored. nevergrad is imported here and nowhere else.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evolve.config import RunConfig
from evolve.genotype import Genotype

__all__ = ["Search", "training_seed"]


class Search:
    """CMA-ES (Hansen and Ostermeier 2001, as in pycma, by nevergrad) over the open genes.

    nevergrad has a flag for noisy functions, but CMA-ES there heeds it only when recommending a single best genome.
    We take the best candidate from the record and ask for no recommendation.
    """

    def __init__(self, config: RunConfig) -> None:
        genotype = Genotype(config.genome)
        self._dimension = genotype.dimension
        self._population = config.search.population
        self._optimizer = _cma(genotype.start, config.search.sigma, self._population, config.seed)
        self._asked: list[Any] = []
        self._told: list[float] = []

    def ask(self) -> NDArray[np.float64]:
        """Genomes of the next generation, (population, dimension) in [0, 1]."""
        if self._asked:
            raise RuntimeError("ask: the fitness of the last generation has not been told yet")
        with _reflected_mirrors():
            self._asked = [self._optimizer.ask() for _ in range(self._population)]
        return np.array([candidate.value[: self._dimension] for candidate in self._asked])

    def tell(self, fitness: Sequence[float]) -> None:
        """Fitness of the generation asked last, in its order; -inf (failed) counts as the worst fitness so far."""
        if len(fitness) != len(self._asked):
            raise ValueError(f"tell: {len(self._asked)} genomes were asked for, {len(fitness)} fitness values told")
        self._told += [value for value in fitness if math.isfinite(value)]
        worst = min(self._told, default=0.0)
        with _reflected_mirrors():
            for candidate, value in zip(self._asked, fitness, strict=True):
                self._optimizer.tell(candidate, -value if math.isfinite(value) else -worst)
        self._asked = []


def training_seed(run_seed: int, candidate_id: int) -> int:
    """Seed of one candidate's training and evaluation: fresh for each, whoever evaluates it."""
    return int(np.random.SeedSequence([run_seed, candidate_id]).generate_state(1)[0])


def _cma(start: NDArray[np.float64], sigma: float, population: int, seed: int) -> Any:
    """nevergrad's CMA-ES whose first generation spreads by `sigma` around `start`."""
    # CMA-ES has no covariance to adapt in one dimension (nevergrad would switch to a package we don't depend on):
    # a single open gene gets a coordinate beside it that no one reads.
    padded = np.append(start, 0.5) if start.size == 1 else start

    def build(scale: float) -> Any:
        from nevergrad import p
        from nevergrad.optimization.optimizerlib import ParametrizedCMA

        space = p.Array(init=padded, lower=0.0, upper=1.0).set_mutation(sigma=1.0)
        space.random_state.seed(np.random.SeedSequence(seed).generate_state(4))
        return ParametrizedCMA(scale=scale, popsize=population)(space, num_workers=population)

    # nevergrad shrinks the step in bounded spaces by a factor of its own choosing; it is divided out.
    return build(sigma / build(1.0).es.sigma)


@contextmanager
def _reflected_mirrors() -> Iterator[None]:
    """pycma misses the mirrored samples it planted in a small population when nevergrad tells them as reflected at the
    bounds, and warns; the samples told are those that were evaluated, which is what counts."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="orphanated injected solution")
        yield
