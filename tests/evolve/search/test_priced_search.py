"""Costs in the search: the optimizer, the rungs and the null model use task fitness minus costs."""

import numpy as np
import pytest

from evolve.analysis.statistics import champions, generation_statistics
from evolve.report.gene_drift import drift_of
from evolve.search.loop import evolve
from evolve.search.null_model import FIRST_SEED, fitness_spread, null_model
from evolve.search.successive_halving import reaching
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.closed_form import ClosedForm
from tests.evolve.closed_form import tiny
from tests.evolve.search.test_loop import SilentWatcher, history
from tests.evolve.search.test_null_model import Chance, Nobody, measured

PRICES = ("costs.per_receptor=0.01", "costs.per_eye=2", "costs.per_neuron=0.125")


class Constant:
    """An executor in which all animals solve their task equally well."""

    def run(self, jobs, progress=None):
        while jobs:
            yield jobs.popleft(), Evaluation(100.0, (100.0,), steps=10)


def priced(path, *settings):
    run = Run.create(path, tiny(*PRICES, *settings))
    evolve(run, Constant(), Nobody())
    return run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return priced(tmp_path_factory.mktemp("priced") / "run")


def test_fitness_is_task_fitness_minus_costs(run):
    for one in run.candidates:
        animal = one.phenotype
        rows, columns = animal.resolution
        receptors = 3 * animal.n_eyes * rows * columns
        assert one.costs == pytest.approx(0.01 * receptors + 2 * animal.n_eyes + 0.125 * animal.layers * animal.neurons)
        assert one.fitness == 100 - one.costs
        assert one.task_fitness == pytest.approx(100)


def test_the_best_animal_is_the_cheapest(run):
    cheapest = min(run.candidates, key=lambda one: one.costs)
    assert run.best == cheapest
    assert champions(run.candidates)[-1][1] == cheapest
    assert generation_statistics(run.candidates)[-1].best_so_far == 100 - cheapest.costs


def test_the_optimizer_receives_fitness_after_costs(tmp_path):
    """Equal task fitness gives no direction. With a price per eye, the search moves to fewer eyes."""
    settings = ("search.population=6", "search.generations=8", "genome.n_eyes.start=8")
    eyes = {}
    for price in (0, 5):
        run = Run.create(tmp_path / str(price), tiny(f"costs.per_eye={price}", *settings))
        evolve(run, Constant(), Nobody())
        eyes[price] = np.mean([one.phenotype.n_eyes for one in run.generation(7)])
    assert eyes[5] < 3 < eyes[0] - 2


def test_a_priced_run_resumes_to_the_same_history(tmp_path):
    cut, whole = (Run.create(tmp_path / name, tiny(*PRICES)) for name in ("cut", "whole"))
    evolve(whole, ClosedForm(), SilentWatcher())
    with pytest.raises(KeyboardInterrupt):
        evolve(cut, ClosedForm(), SilentWatcher(until=5))
    evolve(Run.open(cut.path), ClosedForm(), SilentWatcher())
    assert (cut.path / "candidates.jsonl").read_bytes() == (whole.path / "candidates.jsonl").read_bytes()
    assert history(Run.open(cut.path)) == history(whole)
    assert len({one.costs for one in whole.candidates}) > 6


def test_rungs_promote_the_fittest_after_costs(tmp_path):
    run = priced(tmp_path / "run", "search.rungs=2", "learning.total_steps=16384", "search.generations=1")
    promoted = reaching(run, 0, 1)
    first = sorted((run.on_record(i, 0) for i in range(4)), key=lambda one: one.costs)
    assert promoted == {one.id for one in first[:2]}
    assert all(run.on_record(i, 1).costs == run.on_record(i, 0).costs for i in promoted)


# --- null model


@pytest.mark.parametrize("settings", [(), ("search.steady_state=true",)])
def test_the_null_model_subtracts_costs(settings, tmp_path):
    """The null model equals the real loop with random task fitness of the same spread, 1."""
    config = tiny(f"seed={FIRST_SEED}", *PRICES, *settings)
    run = Run.create(tmp_path / "run", config)
    evolve(run, Chance(FIRST_SEED), Nobody())
    model = null_model(config, measured, 3, 1, spread=[1.0] * 3)
    for name, means in model.means.items():
        lived = [np.mean([measured(one.phenotype)[name] for one in run.generation(g)]) for g in range(3)]
        assert means.tolist() == [lived]


def test_the_null_model_needs_the_spread_if_there_are_costs():
    with pytest.raises(ValueError, match=r"spread has 2 values: must be 3, one for each generation"):
        null_model(tiny(*PRICES), measured, 3, 1, spread=[1.0, 1.0])


def test_the_spread_is_that_of_task_fitness_within_generations(tmp_path):
    runs = [Run.create(tmp_path / str(seed), tiny(f"seed={seed}", *PRICES)) for seed in (1, 2)]
    for seed, run in enumerate(runs):
        evolve(run, Chance(seed), Nobody())
    for generation, found in enumerate(fitness_spread(runs, 3)):
        values = [[one.task_fitness for one in run.generation(generation)] for run in runs]
        assert found == pytest.approx(np.sqrt(np.mean([np.var(each, ddof=1) for each in values])))
    alone = fitness_spread(runs, 5)  # generations without candidates
    assert alone[4] == pytest.approx(np.sqrt(np.mean(np.square(fitness_spread(runs, 3)))))


@pytest.mark.slow
def test_drift_does_not_mistake_costs_for_the_task(tmp_path):
    """Random task fitness with a high price per eye leads to few eyes, which the null model expects."""
    settings = ("search.population=6", "search.generations=8", "genome.n_eyes.start=8", "costs.per_eye=5")
    run = Run.create(tmp_path / "run", tiny(*settings))
    evolve(run, Chance(3), Nobody())
    drift = drift_of([run], 40)
    (eyes,) = (one for one in drift.moved if one.quantity == "n_eyes")
    assert eyes.p > 0.1
    assert "40 searches with random task fitness minus costs." in "\n".join(drift.lines())
    assert drift.as_plain_values()["random"] == "task fitness minus costs"
    free = null_model(tiny(*settings[:3]), measured, 8, 40)
    assert eyes.mean < np.quantile(free.ends("n_eyes", drift.generations), 0.05), "chance alone keeps more eyes"
