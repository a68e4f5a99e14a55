"""The null model of a search, and p values of runs under it."""

from dataclasses import replace

import numpy as np
import pytest

from evolve.config.assemble import assemble
from evolve.genome.phenotype import develop
from evolve.search.null_model import FIRST_SEED
from evolve.search.search import Search
from experiments.candidates import Row
from experiments.drift import Drift, _row, drifted, of_the_end
from experiments.evolved import RunMetadata, Store, null_table
from experiments.store import Origin

SEARCHES = 60


@pytest.fixture(autouse=True)
def few_searches(monkeypatch):
    monkeypatch.setattr("experiments.drift.SEEDS", SEARCHES)


ROW = Row(*("a", 0, 0, 0, 0, 0, 1.0, 0.5, 4, 2, 60.0, 45.0, 8, 8, 0.1, 5, 64, 1000))


@pytest.mark.slow
def test_random_fitness_moves_genes_that_are_open_and_no_others():
    config = assemble(
        "navigation", "bifurcation-navigation", assignments=("search.generations=6", "genome.fov_deg.open=true")
    )
    quantities = {"fov": lambda row: row.fov_deg, "up": lambda row: row.height, "fitness": lambda row: row.fitness}
    drift = drifted(config, "navigation", quantities, 4)
    assert {one.quantity for one in drift} == {"fov", "up"}, "the null model has no fitness"
    *fov, end = (one for one in drift if one.quantity == "fov")
    assert [one.generation for one in fov] == [0, 1, 2, 3]
    assert all(one.low < one.median < one.high for one in fov)
    assert fov[0].high - fov[0].low < fov[3].high - fov[3].low, "searches diverge"
    assert fov[0].low < 45 < fov[0].high, "all searches start at the same value"
    assert fov[1].low < end.median < fov[3].high
    assert len(end.ends.split()) == SEARCHES
    held = [one for one in drift if one.quantity == "up"]
    assert all(one.held for one in held)
    assert str(held[-1]) == "fixed at 1"


@pytest.mark.slow
def test_every_phase_has_an_end():
    """Each end covers the last three generations of its phase. The first phase has only two generations, so its end
    covers two.
    """
    config = assemble(preset="lens", assignments=("genome.doe.opens_at=2", "genome.refractive_index.opens_at=2"))
    drift = drifted(config, "lens", {"a": lambda row: row.relative_aperture, "n": lambda row: row.refractive_index}, 6)
    ends = {(one.quantity, one.generation): one for one in drift if one.ends}
    assert set(ends) == {("a", 1), ("a", 5), ("n", 1), ("n", 5)}
    assert ends["n", 1].held
    assert not ends["n", 5].held
    assert of_the_end(drift, 3) is None


def test_p_counts_searches_that_came_as_far_on_either_side():
    end = Drift("a", "x", 5, 0.0, 50.0, 100.0, " ".join(str(i) for i in range(1, 100)))  # 1 ... 99
    assert end.p(50.0) == 1.0
    assert end.p(-3.0) == end.p(200.0) == pytest.approx(2 / 100)
    assert end.p(5.0) == end.p(95.0) == pytest.approx(2 * 6 / 100)


def test_runs_that_agree_have_a_smaller_p_than_one():
    """The mean of two draws from a null model that is uniform in [0, 1] has a triangular distribution. A mean m < 1/2
    therefore has p = 4 m².
    """
    end = Drift("a", "x", 5, 0.0, 0.5, 1.0, " ".join(f"{(i + 0.5) / 1000:.4f}" for i in range(1000)))
    assert end.p(0.1, 0.1) == pytest.approx(4 * 0.1**2, rel=0.15), "three standard errors of this number of draws"
    assert end.p(0.1) == pytest.approx(2 * 0.1, rel=0.02)
    assert end.p(0.05, 0.95) == pytest.approx(1.0, abs=0.03), "runs in opposite directions cancel"
    assert end.p(-1.0, -1.0) == pytest.approx(2 / 1001), "p is at least 2 / (number of searches + 1)"


def test_runs_are_compared_where_the_null_model_was_computed():
    """The longer run has its p value. The run that stopped earlier has none, because the null model has drifted for
    longer."""
    rows = [
        replace(ROW, seed=seed, generation=g, fov_deg=10.0) for seed, last in ((0, 5), (1, 3)) for g in range(last + 1)
    ]
    conduct = [RunMetadata("a", seed, 6, n, 6, 1.0, "", 0.01, 1e-4) for seed, n in ((0, 6), (1, 4))]
    drift = [Drift("a", "fov", 5, 20.0, 45.0, 80.0, "20 45 80"), Drift("a", "fov", 5, 20.0, 45.0, 80.0)]
    store = Store(rows, conduct, drift, Origin.here(1.0), "")
    table = null_table(store, {"fov": lambda row: row.fov_deg}).splitlines()
    assert table[2:] == ["| a, seed 0 | 0.5 |", "| a, seed 1 | - |", "| a, 2 seeds together | - |"]
    both = replace(store, rows=[replace(row, seed=seed) for row in rows if row.seed == 0 for seed in (0, 1)])
    assert null_table(both, {"fov": lambda row: row.fov_deg}).splitlines()[-1] == "| a, 2 seeds together | 0.5 |"


def test_ties_are_ties_although_ends_have_six_digits():
    end = Drift("a", "eyes", 5, 1.0, 1.0, 1.1, " ".join(["1.02083"] * 10 + ["1"] * 90))
    assert end.p(49 / 48) == pytest.approx(2 * 11 / 101)
    third = Drift("a", "eyes", 5, 0.3, 0.3, 0.3, " ".join(["0.333333"] * 100))
    assert third.p(1 / 3) == 1.0


def test_ends_are_means_over_candidates_as_those_of_runs_are(monkeypatch):
    """For a quantity that few candidates have, generations are weighted by their number of such candidates, as in
    `last_values`."""
    monkeypatch.setattr("experiments.drift.SEEDS", 3)
    config = assemble("detection", "bifurcation-detection", assignments=("search.generations=3",))
    some = {"several": lambda row: row.placement_range_deg if row.n_eyes > 1 else float("nan")}
    [end] = [one for one in drifted(config, "detection", some, 3) if one.ends]
    search, values = Search(replace(config, seed=FIRST_SEED)), []
    chance = np.random.default_rng(FIRST_SEED)
    for _ in range(3):
        proposals = search.propose_generation()
        rows = [_row(develop(one.vector, config), config.eye) for one in proposals]
        values += [v for v in map(some["several"], rows) if np.isfinite(v)]
        search.tell([(one.id, chance.normal()) for one in proposals])
    assert float(end.ends.split()[0]) == pytest.approx(np.mean(values), rel=1e-5)
