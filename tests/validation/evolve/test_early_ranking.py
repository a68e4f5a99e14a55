"""The page on successive halving agrees with its store, and its numbers follow their definitions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evolve.search.successive_halving import budgets
from validation.evolve import early_ranking
from validation.evolve.early_ranking import (
    RUNGS,
    Row,
    animals,
    columns,
    config,
    correlation,
    halving,
    read_rows,
    write_rows,
)

ROOT = Path(__file__).parents[3]


def rows(order, seconds=(1.0, 1.0, 2.0, 4.0)):
    """Return rows of animals whose fitness after each rung is `order` (rung, animal)."""
    found = []
    for animal in range(len(order[0])):
        for rung in range(RUNGS):
            fitness = float(order[rung][animal])
            budget = 100 * 2**rung
            found.append(Row(animal, 1, 2, 3, budget, budget, fitness, fitness, seconds[rung]))
    return found


def test_rank_correlation():
    """Spearman's coefficient is 1 - 6 Σd² / (n (n² - 1)). Here, the differences of ranks are d = (1, 1, 0, 0), and n =
    4.
    """
    assert correlation(np.array([1.0, 2, 3, 4]), np.array([2.0, 1, 3, 4]))[0] == pytest.approx(1 - 6 * 2 / 60)


def test_halving_keeps_the_best_and_costs_half_where_ranks_hold():
    same = rows([range(8)] * RUNGS)
    four = halving(same, 4, 0.5)
    # 8 animals x 1 s, 4 x 1 s, 2 x 2 s, 1 x 4 s, out of 8 x 8 s
    assert (four.cost, four.place) == (pytest.approx((8 + 4 + 4 + 4) / 64), 1)
    two = halving(same, 2, 0.25)
    # A quarter of the budget is the second of four rungs: 8 x 2 s, then 2 x 6 s.
    assert (two.cost, two.place) == (pytest.approx((16 + 12) / 64), 1)


def test_halving_loses_the_best_where_ranks_turn_round():
    late = rows([range(8), range(8), range(8), [7 - i for i in range(8)]])
    assert halving(late, 2, 0.5).place == 5, "the upper half is promoted, and its best animal ends in fifth place"


def test_rows_survive_the_file(tmp_path):
    few = rows([range(2)] * RUNGS)
    write_rows(few, tmp_path / "a" / "b.csv")
    assert read_rows(tmp_path / "a" / "b.csv") == few
    assert read_rows(tmp_path / "none.csv") == []


def test_animals_are_spread_over_the_genome_and_each_is_the_same_whoever_asks():
    many = animals(20)
    assert many[:3] == animals(3)
    assert {animal.n_eyes for animal in many} == {1, 2, 3, 4}
    receptors = [animal.resolution[0] * animal.resolution[1] for animal in many]
    assert min(receptors) < 20
    assert max(receptors) > 100
    run = config(replace(many[0], resolution=(1, 1)))
    assert run.eye.rays_per_receptor == 96
    assert len(budgets(run.search, run.learning)) == RUNGS


def test_the_page_is_of_the_stored_trainings():
    stored = read_rows(ROOT / early_ranking.STORED)
    assert columns(stored, "budget").shape == (len(stored) // RUNGS, RUNGS)
    assert len(stored) >= 16 * RUNGS
    page = (ROOT / "docs/validation/early_ranking.md").read_text(encoding="utf-8")
    assert early_ranking.table(stored) in page
