"""Results of the searches for eyes: synthetic records with a known answer, and groups that are not complete."""

import math
from dataclasses import replace

import numpy as np
import pytest

from evolve.genome.phenotype import develop
from evolve.search.search import Search as Proposer
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from experiments import eye_search_results, eye_searches
from experiments.designed import Trained
from experiments.drift import Drift
from experiments.evolved import RunMetadata, Store
from experiments.eye_factors_design import TASKS
from experiments.eye_search_best import NEW_SEEDS, best, best_table, designs, random_table
from experiments.eye_search_records import complete_groups
from experiments.eye_search_tests import (
    CLAIMS,
    COMPARED,
    TESTED,
    adjusted,
    compared,
    exploratory,
    group,
    outcome,
    seeds,
)
from experiments.eye_searches import SEEDS, Search, searches
from experiments.store import Origin
from tests.experiments.test_evolved import ROW

ORIGIN = Origin(1.0, "m", {"commit": "a", "python": "3"})
SMALL = "search.population=4", "search.generations=4"


def store_of(ratios, kinds=TESTED):
    """Three searches per group. ln(width / eyes) is that of `ratios`, by task; that of random searches has the mean 0
    and the standard deviation 0.5."""
    chance = np.random.default_rng(5)
    rows, drift = [], []
    for task in TASKS:
        for kind in kinds:
            name = group(task, kind)
            for seed in SEEDS:
                eyes, across = (4, round(4 * math.exp(ratios[task]))) if ratios[task] > 0 else (8, 8)
                rows += [
                    replace(ROW, group=name, seed=seed, generation=g, index=i, n_eyes=eyes, width=across, height=across,
                            placement_range_deg=90.0 + i, fitness=float(10 * g + i))
                    for g in range(12) for i in range(16)
                ]  # fmt: skip
            for quantity, middle, spread in zip(COMPARED, (0, 7, 7, 150), (0.5, 2, 2, 20), strict=True):
                ends = " ".join(f"{one:.6g}" for one in chance.normal(middle, spread, 1000))
                drift.append(Drift(name, quantity, 11, middle - 2 * spread, middle, middle + 2 * spread, ends))
    runs = [RunMetadata(name, 0, 192, 12, 12, 1.0, "abc", 0.01, 1e-4) for name in {row.group for row in rows}]
    return Store(rows, runs, drift, ORIGIN, "Yes.")


FINE = {"maze": 0.0, "detection": math.log(4)}
COARSE = {"maze": math.log(4), "detection": 0.0}
EQUAL = {"maze": 0.0, "detection": 0.0}


def test_finer_eyes_in_detection_reproduce_the_published_difference():
    store = store_of(FINE)
    assert compared(store, "free").value == pytest.approx(math.log(4))
    assert adjusted(store) == pytest.approx({"free": 4 / 1001, "priced": 4 / 1001})
    assert outcome(store) == "reproduced"


@pytest.mark.parametrize("ratios", [COARSE, EQUAL])
def test_the_wrong_sign_and_no_difference_are_not_reproduced(ratios):
    store = store_of(ratios)
    assert outcome(store) == "not reproduced"
    assert (adjusted(store)["free"] <= 0.05) == (ratios is COARSE)


def test_a_group_that_is_not_complete_is_stated_and_leaves_the_outcome_open():
    free = store_of(EQUAL, ("free",))
    assert compared(free, "priced") is None
    assert outcome(free) == "open"
    assert outcome(store_of(FINE, ("free",))) == "reproduced"
    text = eye_search_results.page(store_of(FINE, ("free",)), []).markdown
    assert "| free | 6 of 6 | 1.39 (null model:" in text
    assert "| priced | 0 of 6 | not computed | - |" in text


def test_a_difference_with_prices_only_is_named_so():
    free, priced = store_of(EQUAL, ("free",)), store_of(FINE, ("priced",))
    both = replace(free, rows=[*free.rows, *priced.rows], drift=[*free.drift, *priced.drift])
    assert outcome(both) == "reproduced with prices"
    assert seeds(both, "priced") == "6 of 6"


def test_claims_are_compared_with_random_searches_in_the_expected_direction():
    """Four eyes of 16 receptors across over 98° in detection; random searches have seven of seven over 150°."""
    store = store_of(FINE)
    states = {claim.text: exploratory(store, claim, "free").state for claim in CLAIMS}
    assert states["fine eyes in detection"] == "supported"
    assert states["eyes that look ahead in detection"] == "supported"
    assert states["eyes around the body in mazes"] == "contradicted"
    assert states["coarse eyes in mazes"] == "open"
    assert exploratory(store, CLAIMS[0], "free").value == 4


def test_the_best_animals_are_the_fittest_after_prices_each_once():
    """Ten eyes of 4 x 4 cost 21.6 with the planned prices, and one costs 2.16."""
    many, one = (replace(ROW, n_eyes=n, width=4, height=4, fitness=f) for n, f in ((10, 50.0), (1, 40.0)))
    for kind, fittest in (("free", many), ("priced", one)):
        search = Search("maze", kind, 1)
        rows = [replace(row, group=group("maze", kind), seed=1, index=i) for i, row in enumerate([many, one, many])]
        found = best(Store(rows, [], [], ORIGIN, ""), search)
        assert [design.n_eyes for _, design in found] == [fittest.n_eyes, 11 - fittest.n_eyes]


def test_new_training_runs_of_the_best_animals_have_new_seeds_and_the_layouts_of_their_search():
    store = store_of(FINE, ("free",))
    wanted = designs(store)
    assert {one.seed for one in wanted} == set(NEW_SEEDS)
    assert all(f"family_seed={seed}" in str([one.own for one in wanted]) for seed in SEEDS)
    trained = [Trained(**vars(one), fitness=60.0 + i, held_out=50.0 + i, steps=1) for i, one in enumerate(wanted)]
    assert best_table(store, []).count("| - | - |") == len(best_table(store, trained).splitlines()) - 2
    assert "| - |" not in best_table(store, trained)


def test_random_search_is_compared_after_equal_numbers_of_candidates():
    rows = [
        replace(ROW, group="maze, random", seed=SEEDS[0], generation=g, index=i, fitness=float(16 * g + i))
        for g in range(12) for i in range(16)
    ]  # fmt: skip
    assert "| maze, random search, seed 20 | 47 | 95 | 191 |" in random_table(Store(rows, [], [], ORIGIN, ""))


def record(folder, search, fitness, candidates=None):
    """Write the record of a search with this fitness of animals; `candidates`: number after which it is interrupted."""
    config, proposer = search.config, Proposer(search.config)
    run = Run.create(folder / search.name, config)
    for _ in range(config.search.generations):
        told = []
        for one in proposer.propose_generation():
            if candidates is not None and one.id >= candidates:
                return
            animal = develop(one.vector, config)
            value = fitness(animal, one.id)
            result = Evaluation(value - config.costs.total(animal, config.eye), (value,) * 4, 0.5, 10, 1.0)
            run.append(Candidate.from_evaluation(one.place, one.genome, animal, one.id, result))
            told.append((one.id, result.fitness))
        proposer.tell(told)


def ratio(animal):
    return math.log(animal.resolution[1] / animal.n_eyes)


def test_incomplete_groups_are_refused_and_complete_ones_found(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(eye_searches, "SETTINGS", (*eye_searches.SETTINGS, *SMALL))
    first = Search("maze", "random", SEEDS[0])
    record(tmp_path, first, lambda animal, number: float(number), candidates=7)
    arguments = ["--records", str(tmp_path), "--docs", str(tmp_path / "docs")]
    assert eye_search_results.main(arguments) == 2
    assert "no group of searches is complete; missing or unfinished: eyes-105k-free-maze-20" in capsys.readouterr().err
    (tmp_path / first.name).rename(tmp_path / "former")
    for task in TASKS:
        record(tmp_path, Search(task, "random", SEEDS[0]), lambda animal, number: float(number))
    assert [search.kind for search, _ in complete_groups(tmp_path, SEEDS)] == ["random", "random"]
    monkeypatch.setattr(eye_searches, "SETTINGS", (*eye_searches.SETTINGS, "learning.gamma=0.9"))
    assert eye_search_results.main(arguments) == 2
    assert "has other settings than the plan: learning.gamma" in capsys.readouterr().err


@pytest.mark.slow
def test_records_with_opposite_selection_reproduce_the_difference(tmp_path, monkeypatch):
    """Fitness rises with ln(width / eyes) in detection and falls with it in mazes. There are 80 random searches per
    task, and no records with prices."""
    small = "search.population=8", "search.generations=6"
    monkeypatch.setattr(eye_searches, "SETTINGS", (*eye_searches.SETTINGS, *small))
    monkeypatch.setattr("experiments.drift.SEEDS", 80)
    for search in searches()[:6]:
        sign = {"maze": -100, "detection": 100}[search.task]
        record(tmp_path, search, lambda animal, _, sign=sign: sign * ratio(animal))
    arguments = ["--docs", str(tmp_path / "docs"), "--records", str(tmp_path)]
    assert eye_search_results.main(arguments) == 0
    text = (tmp_path / "docs/eye_searches.md").read_text()
    assert "**reproduced**" in text
    assert "| free | 6 of 6 |" in text
    assert "| priced | 0 of 6 | not computed | - |" in text
    assert (tmp_path / "docs/figures/eye_searches.png").stat().st_size > 5000
