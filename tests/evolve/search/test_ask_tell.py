"""The real loop makes the same proposals as a plain loop around `ask` and `tell`, and that loop finds the optimum."""

from collections.abc import Iterator

import numpy as np
import pytest

from evolve.config.run_config import SearchConfig
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.search.ask_tell import ask_tell, main
from evolve.search.loop import evolve
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny
from tests.evolve.search.test_loop import SilentWatcher

SETTINGS = ("search.population=6", "search.generations=5", "seed=11")


def fitness(phenotype):
    """Return a fitness with its optimum at 70 degrees, three eyes and few neurons; all animals differ."""
    return -abs(phenotype.fov_deg - 70.0) / 10 - abs(phenotype.n_eyes - 3) - phenotype.neurons / 100


def coarse(phenotype):
    """Return a fitness with many ties, which CMA-ES ranks in the order in which it receives them."""
    return float(round(fitness(phenotype)))


class LastFirst:
    """An executor in closed form that returns the last candidate first."""

    def __init__(self, value):
        self.value = value

    def run(self, jobs, progress) -> Iterator:
        while jobs:
            job = jobs.pop()
            value = self.value(job.phenotype)
            yield job, Evaluation(value, (value,))


def plainly(config, value):
    start = Genotype(config.genome).start
    found = ask_tell(value, start, config.search, config.seed)
    return [tuple(genome) for genomes, _ in found for genome in genomes]


@pytest.mark.parametrize("value", [fitness, coarse])
def test_the_loop_proposes_what_asking_and_telling_does(tmp_path, value):
    config = tiny(*SETTINGS)
    run = Run.create(tmp_path / "run", config)
    evolve(run, LastFirst(value), SilentWatcher())
    genomes = plainly(config, lambda genome: value(develop(genome, config)))
    assert [candidate.genome for candidate in run.candidates] == genomes
    negated = plainly(config, lambda genome: -value(develop(genome, config)))
    assert negated[:6] == genomes[:6]
    assert negated[6:] != genomes[6:], "fitness must affect the search for this test to be valid"


@pytest.mark.parametrize("seed", [0, 1])
def test_it_finds_the_top_of_a_paraboloid(seed):
    """The search converges log-linearly. With the wrong sign of the fitness it ends in a corner."""
    best = np.array([0.7, 0.3, 0.6])
    search = SearchConfig(population=8, generations=30)
    generations = list(ask_tell(lambda genome: -float(np.sum((genome - best) ** 2)), np.full(3, 0.5), search, seed))
    assert max(generations[-1][1]) > -1e-4
    assert max(generations[-1][1]) > 0.01 * max(generations[0][1])


def test_it_prints_how_it_goes(capsys):
    with np.printoptions(legacy=False):  # importing colour-science, as other tests do, selects an old format
        main()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 20
    assert lines[0] == "generation  0  best fitness  -9.93e-02  at [0.389 0.699 0.75 ]"
    assert float(lines[-1].split()[4]) > 0.01 * float(lines[0].split()[4])
    found = [float(value) for value in lines[-1].split("[")[1].rstrip("]").split()]
    np.testing.assert_allclose(found, [0.7] * 3, atol=0.02)
