"""The null model is the search itself with random fitness, and its p-value is correct without selection."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import kstest

from evolve.analysis.statistics import gene_values
from evolve.search import null_model as null_model_module
from evolve.search.loop import evolve
from evolve.search.null_model import FIRST_SEED, NullModel, fitness_spread, last_generations, null_model, p_value
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny

OPEN = ("n_eyes", "fov_deg", "resolution_width")


class Chance:
    """An executor whose fitness does not depend on the candidate."""

    training = evaluated = None

    def __init__(self, seed):
        self.chance = np.random.default_rng(seed)

    def run(self, jobs, progress=None):
        while jobs:
            value = self.chance.normal()
            yield jobs.popleft(), Evaluation(value, (value,))


class Nobody:
    def training(self, candidate_id, steps, planned):
        """Do nothing."""

    def evaluated(self, candidate):
        """Do nothing."""


def measured(animal):
    return {name: value for name, value in gene_values(animal).items() if name in OPEN}


@pytest.mark.parametrize(
    "settings", [(), ("search.steady_state=true",), ("genome.fov_deg.opens_at=2", "search.generations=5")]
)
def test_it_is_the_loop_with_fitness_by_chance(settings, tmp_path):
    config = tiny(f"seed={FIRST_SEED}", *settings)
    run = Run.create(tmp_path / "run", config)
    evolve(run, Chance(FIRST_SEED), Nobody())
    generations = config.search.generations
    model = null_model(replace(config, seed=3), measured, generations, 1)
    for name in OPEN:
        lived = [[measured(c.phenotype)[name] for c in run.generation(g)] for g in range(generations)]
        assert model.means[name].tolist() == [[np.mean(values) for values in lived]]
        assert (model.counts[name] == 4).all()


def test_every_search_has_a_seed_of_its_own():
    model = null_model(tiny(), measured, 3, 5)
    assert len(set(model.means["fov_deg"][:, 2])) == 5


def test_progress_is_reported_after_every_search():
    fractions = []
    null_model(tiny(), measured, 1, 4, fractions.append)
    assert fractions == [0.25, 0.5, 0.75, 1]


def test_what_few_candidates_have_counts_by_how_many():
    """Generations are weighted by the number of candidates that have the quantity. A search without any such candidate
    is omitted.
    """
    nan = np.nan
    means = np.array([[9.0, 1.0, 4.0], [9.0, nan, 2.0], [9.0, nan, nan]])
    model = NullModel({"x": means}, {"x": np.array([[5, 3, 1], [5, 0, 2], [5, 0, 0]])})
    assert model.ends("x", range(1, 3)).tolist() == [(3 * 1.0 + 4.0) / 4, 2.0]
    assert model.ends("x", range(3)).tolist()[2] == 9.0


def test_a_phase_ends_with_its_own_last_generations():
    config = tiny("genome.fov_deg.opens_at=2", "search.generations=9")
    assert last_generations(config, 9) == [range(2), range(6, 9)]
    assert last_generations(config, 3) == [range(2), range(2, 3)]
    assert last_generations(config, 2) == [range(2)]


def test_p_is_uniform_where_nothing_is_selected():
    """The cases are single searches with other seeds, and means of three of them: p is below 0.05 in 5 % of the cases.
    (With 300 draws, a one-sided p, or one that treats the mean of three as a single search, fails at once.)
    """
    chance = np.random.default_rng(1)
    ends = chance.gamma(2.0, size=999)
    for several in (1, 3):
        found = [p_value(chance.gamma(2.0, size=several), ends) for _ in range(300)]
        assert kstest(found, "uniform").pvalue > 1e-3
    assert kstest([p_value([chance.gamma(2.0, size=3).mean()], ends) for _ in range(300)], "uniform").pvalue < 1e-3


def test_spreads_are_pooled_over_runs_and_over_all_generations_where_there_are_too_few():
    """The first generation has one degree of freedom in all, the second two, and the third none."""

    def run(*generations):
        members = [
            [SimpleNamespace(task_fitness=fitness, failure=None if fitness < 9 else "lost") for fitness in fitnesses]
            for fitnesses in generations
        ]
        return SimpleNamespace(generation=lambda number: members[number])

    runs = [run([1.0, 2.0, 9.0], [0.0, 4.0], [3.0]), run([5.0], [1.0, 2.0], [9.0, 8.0])]
    overall = (0.5 + 8 + 0.5) / 3
    expected = [math.sqrt(0.5), math.sqrt(8.5 / 2), math.sqrt(overall)]
    assert fitness_spread(runs, 3) == pytest.approx(expected)
    assert fitness_spread([run([1.0])], 1) == [0]


def test_ties_count_on_both_sides():
    """A value that all searches reach is not extreme, even if it is 0 and leaves no room for rounding."""
    for value in (0.0, 0.1, -3.0):
        assert p_value([value], np.full(9, value)) == 1
    ends = np.array([0.0, 0.0, 1.0, 2.0])
    assert p_value([0.0], ends) == 1.0
    assert p_value([2.0], ends) == pytest.approx(2 * (1 + 1) / 5)
    assert p_value([3.0], ends) == pytest.approx(2 / 5)


def test_means_leave_out_values_that_are_not_finite(monkeypatch):
    """The first generation has two finite values of three, and the second none."""
    values = iter([1.0, math.inf, 4.0, math.nan, math.nan])
    vectors = [[SimpleNamespace(vector=None)] * count for count in (3, 2)]
    monkeypatch.setattr(null_model_module, "_proposals", lambda config, generations, spread: vectors)
    monkeypatch.setattr(null_model_module, "develop", lambda vector, config: None)
    means, counts = null_model_module._search(None, lambda animal: {"acuity": next(values)}, 2, [])["acuity"]
    assert counts == [2, 0]
    assert means[0] == 2.5
    assert math.isnan(means[1])
