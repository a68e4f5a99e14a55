"""The search in its simplest form: CMA-ES proposes genomes, then receives the fitness of each.

`evolve.search.loop` runs the same search on animals, which are trained before their fitness is measured. That loop also
supports several workers, further genes that begin to vary in later generations, and exact continuation of a killed run.
A test checks that this example and the loop propose the same genomes.

    python -m evolve.search.ask_tell
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from evolve.config.numbering import generation_ids
from evolve.config.run_config import SearchConfig
from evolve.search.optimizers import Space, build_optimizer

__all__ = ["ask_tell"]

Floats = NDArray[np.float64]


def ask_tell(
    fitness: Callable[[Floats], float], start: Floats, search: SearchConfig, seed: int
) -> Iterator[tuple[list[Floats], list[float]]]:
    """Yield the genomes of each generation, and their fitness, which the search maximises.

    Each genome is (dimension,), with coordinates in [0, 1].

    fitness: function that returns the finite fitness of a genome
    start: genome from which the search starts, (dimension,)
    search: settings; the optimizer "mutation" is not supported, because it needs genes

    Raises:
        ConfigError: the optimizer is unknown, or cannot be used here.
    """
    optimizer = build_optimizer(Space(genes=(), start=start, seed=(seed,)), search)
    for generation in range(search.generations):
        ids = generation_ids(generation, search.population)
        genomes = {candidate_id: optimizer.ask(candidate_id)[0] for candidate_id in ids}
        values = {candidate_id: fitness(genome) for candidate_id, genome in genomes.items()}
        for candidate_id, value in values.items():
            optimizer.tell(candidate_id, value)
        yield list(genomes.values()), list(values.values())


def main() -> None:
    """Search for the maximum of a paraboloid, which is at (0.7, 0.7, 0.7), and print the progress."""
    search = SearchConfig(population=8, generations=20)
    generations = ask_tell(lambda genome: -float(np.sum((genome - 0.7) ** 2)), np.full(3, 0.5), search, seed=0)
    for number, (genomes, values) in enumerate(generations):
        best = int(np.argmax(values))
        print(f"generation {number:2}  best fitness {values[best]:10.2e}  at {np.round(genomes[best], 3)}")


if __name__ == "__main__":
    main()
