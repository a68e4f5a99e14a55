"""The search proposes by seed alone, spreads as asked, climbs, and takes failures as worst."""

import math

import numpy as np
import pytest
from closed_form import tiny

from evolve.genotype import Genotype
from evolve.search import Search, training_seed


def sphere(genomes, best=0.7):
    return [-float(np.sum((genome - best) ** 2)) for genome in genomes]


def history(config, fitness=sphere):
    search, asked = Search(config), []
    for _ in range(config.search.generations):
        asked.append(search.ask())
        search.tell(fitness(asked[-1]))
    return np.array(asked)


def test_same_seed_same_run_bit_for_bit():
    config = tiny("search.generations=20")
    np.testing.assert_array_equal(history(config), history(config))
    assert not np.array_equal(history(config), history(tiny("search.generations=20", "seed=1")))


def test_genomes_stay_in_the_unit_cube():
    asked = history(tiny("search.population=50", "search.sigma=1"))
    assert asked.min() >= 0
    assert asked.max() <= 1


@pytest.mark.parametrize("frozen", [(), ("genome.morphological.open=false",)], ids=["many genes", "few genes"])
def test_first_generation_spreads_by_sigma_around_the_start(frozen):
    """nevergrad scales the step in bounded spaces, by dimension; ours must not depend on that."""
    start = ("genome.n_eyes.start=8", "genome.resolution_width.start=8", "genome.resolution_height.start=8")
    centre = ("genome.memory_frames.start=5", "genome.neurons.start=256", "genome.doe.open=true")
    config = tiny("search.population=4000", "search.sigma=0.05", *start, *centre, *frozen)
    genomes = Search(config).ask()
    # 4000 draws: the mean is good to 0.05/sqrt(4000), the standard deviation to 1.1 %; five of each allowed.
    np.testing.assert_allclose(genomes.mean(axis=0), Genotype(config.genome).start, atol=5 * 0.05 / math.sqrt(4000))
    np.testing.assert_allclose(genomes.std(axis=0), 0.05, rtol=0.06)


def test_search_climbs():
    """CMA-ES on a sphere converges log-linearly; a search told the wrong sign, or out of order, does not."""
    asked = history(tiny("search.population=12", "search.generations=40", "genome.fov_deg.open=false"))
    distance = np.linalg.norm(asked - 0.7, axis=2).mean(axis=1)
    assert distance[-1] < 0.05 * distance[0]


def test_single_open_gene_is_searched():
    frozen = ("genome.morphological.open=false", "genome.neural.open=false")
    config = tiny("search.population=8", "search.generations=15", *frozen, "genome.refractive_index.open=true")
    asked = history(config)
    assert asked.shape == (15, 8, 1)
    assert abs(asked[-1].mean() - 0.7) < 0.05


def test_failure_counts_as_the_worst_fitness_so_far():
    config = tiny("search.generations=6")
    spoil = {1: 2, 3: 0}  # generation -> candidate that fails

    def run(stand_in):
        search, asked, told = Search(config), [], []
        for generation in range(6):
            asked.append(search.ask())
            fitness = sphere(asked[-1])
            if generation in spoil:
                fitness[spoil[generation]] = math.nan
                told += [value for value in fitness if math.isfinite(value)]
                fitness[spoil[generation]] = stand_in(told)
            else:
                told += fitness
            search.tell(fitness)
        return np.array(asked)

    np.testing.assert_array_equal(run(lambda told: -math.inf), run(min))
    assert not np.array_equal(run(lambda told: -math.inf), run(max))


def test_generation_of_failures_alone_is_survived():
    search = Search(tiny())
    for _ in range(3):
        genomes = search.ask()
        assert np.all(np.isfinite(genomes))
        search.tell([-math.inf] * 4)


def test_tell_must_match_ask():
    search = Search(tiny())
    search.ask()
    with pytest.raises(ValueError, match="4 genomes were asked for, 3 fitness values told"):
        search.tell([0.0] * 3)
    with pytest.raises(RuntimeError, match="not been told"):
        search.ask()


def test_training_seeds_are_fresh_for_every_candidate_and_run():
    seeds = {training_seed(run, candidate) for run in range(20) for candidate in range(800)}
    # 16,000 draws from 2^32: 0.03 collisions expected.
    assert len(seeds) >= 16_000 - 2
    assert training_seed(3, 5) == training_seed(3, 5)
