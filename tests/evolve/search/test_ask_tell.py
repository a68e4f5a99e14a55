"""The real loop proposes what a plain ask/tell loop does, and that loop finds the best."""

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
    """Best at 70 degrees, three eyes and few neurons; no two animals alike."""
    return -abs(phenotype.fov_deg - 70.0) / 10 - abs(phenotype.n_eyes - 3) - phenotype.neurons / 100


def coarse(phenotype):
    """Many are equally fit, and CMA-ES ranks these in the order in which it is told."""
    return float(round(fitness(phenotype)))


class LastFirst:
    """An executor in closed form that hands the last candidate back first."""

    def __init__(self, value):
        self.value = value

    def run(self, jobs, progress) -> Iterator:
        while jobs:
            job = jobs.pop()
            yield job, Evaluation(self.value(job.phenotype))


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
    assert negated[6:] != genomes[6:], "fitness must matter for this to show anything"


@pytest.mark.parametrize("seed", [0, 1])
def test_it_finds_the_top_of_a_paraboloid(seed):
    """Log-linearly; told the wrong sign it runs to a corner instead."""
    best = np.array([0.7, 0.3, 0.6])
    search = SearchConfig(population=8, generations=30)
    generations = list(ask_tell(lambda genome: -float(np.sum((genome - best) ** 2)), np.full(3, 0.5), search, seed))
    assert max(generations[-1][1]) > -1e-4
    assert max(generations[-1][1]) > 0.01 * max(generations[0][1])


def test_it_prints_how_it_goes(capsys):
    main()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 20
    assert lines[0].startswith("generation  0  best fitness")
    assert float(lines[-1].split()[4]) > 0.01 * float(lines[0].split()[4])
