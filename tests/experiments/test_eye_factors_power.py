"""Power analysis of the experiment on factors of eyes, against simulated experiments with known differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

from experiments import eye_factors_power
from experiments.designed import Trained
from experiments.eye_factors_design import CAMERA, COMPOUND, RUNS, animals, controls, factorial, has, in_task
from experiments.eye_factors_estimates import spread_of_layouts
from experiments.eye_factors_power import BETWEEN, COMPARISON, CONFIDENCE, LOOKS, Claim, claims, needed, power, verdict

FIRST = Claim("maze", controls()[0], COMPARISON)


def rows(runs, many=0.0, spread=1.0, seed=0):
    """Training runs in which ten coarse eyes return more by `many` than all other animals."""
    chance = np.random.default_rng(seed)
    trained = [(one, task) for task in ("maze", "detection") for one in animals() if has(task, one)]
    return [
        Trained(
            **vars(in_task(one, task, n)), held_out=many * (one == COMPOUND) + spread * chance.normal(), steps=151_552
        )
        for n in range(runs)
        for one, task in trained
    ]


def test_power_is_the_share_of_simulated_experiments_that_find_the_difference():
    chance = np.random.default_rng(3)
    differences = chance.normal(COMPARISON, np.sqrt(2), (20_000, 12))
    reach = t.ppf((1 + CONFIDENCE) / 2, 11) * differences.std(axis=1, ddof=1) / np.sqrt(12)
    assert power(FIRST, 12) == pytest.approx((differences.mean(axis=1) > reach).mean(), abs=0.01)
    n = eye_factors_power.runs_for(FIRST)
    assert power(FIRST, n - 1) < 0.8 <= power(FIRST, n)


def test_the_spread_of_an_effect_follows_from_the_number_of_cells():
    """An effect is the difference of two means of eight cells, or twice as uncertain in variance between tasks."""
    of = ("width",)
    assert Claim("maze", of, 0.5).spread == pytest.approx(np.sqrt(1 / 8 + 1 / 8))
    assert Claim(BETWEEN, of, 0.5).spread == pytest.approx(np.sqrt(2) * np.sqrt(1 / 8 + 1 / 8))


def test_three_looks_without_any_difference_find_one_in_five_of_a_hundred_experiments():
    chance = np.random.default_rng(1)
    values = chance.normal(size=(20_000, RUNS))
    found = np.zeros(len(values), bool)
    for look in LOOKS:
        some = values[:, :look]
        found |= abs(some.mean(axis=1)) > t.ppf((1 + CONFIDENCE) / 2, look - 1) * some.std(axis=1, ddof=1) / look**0.5
    assert found.mean() == pytest.approx(0.05, abs=0.006)


def test_a_large_difference_is_decided_at_the_first_look_and_needs_no_further_runs():
    some = rows(LOOKS[0], many=20.0)
    found = verdict(FIRST, some)
    assert (found.runs, found.state) == (LOOKS[0], "positive")
    assert verdict(replace(FIRST, of=Claim("maze", ("n_eyes",), 0.5).of), some).state == "positive"
    without = {(one.task, one.of) for one in claims() if not verdict(one, some).decided}
    assert ("maze", controls()[0]) not in without
    assert without, "controls without the ten eyes have no difference, which four runs cannot show"


def test_open_claims_request_the_runs_up_to_the_next_look_in_the_order_of_the_claims():
    some = rows(LOOKS[0])
    assert not verdict(FIRST, some).decided
    wanted = needed(some)
    assert wanted[:8] == [in_task(one, "maze", n) for n in range(4, 8) for one in (COMPOUND, CAMERA)]
    assert max(one.seed for one in wanted) == LOOKS[1] - 1
    assert len(set(wanted)) == len(wanted)


def test_a_look_waits_for_all_its_runs():
    complete = rows(LOOKS[0], many=20.0)
    assert verdict(FIRST, complete[:-1]).runs == LOOKS[0], "the last row belongs to detection"
    lacks = [row for row in complete if row.design != in_task(CAMERA, "maze", 3)]
    assert (verdict(FIRST, lacks).runs, verdict(FIRST, lacks).state) == (0, "open")
    assert needed(lacks)[0] == in_task(CAMERA, "maze", 3)


def test_a_difference_that_does_not_matter_is_negligible():
    """The compared animals vary by 0.01, all others by 1, which gives the unit."""
    kinds = [(COMPOUND, "maze"), (CAMERA, "maze")]
    compared = {in_task(animal, task, n) for animal, task in kinds for n in range(LOOKS[0])}
    some = [replace(row, held_out=row.held_out / 100) if row.design in compared else row for row in rows(LOOKS[0])]
    assert verdict(FIRST, some).state == "negligible"


def test_the_spread_of_layouts_does_not_contain_that_of_training_runs():
    chance = np.random.default_rng(5)
    of_seed = chance.normal(0, 10, RUNS)
    few = [
        Trained(**vars(in_task(cell, "maze", seed)), held_out=10 * chance.normal() + shift)
        for seed, shift in enumerate(of_seed)
        for cell in factorial()
    ]
    expected = np.std(of_seed, ddof=1)
    assert spread_of_layouts(few, "maze") == pytest.approx(expected, rel=0.25)
    calm = [replace(row, held_out=row.held_out - of_seed[row.seed]) for row in few]
    assert spread_of_layouts(calm, "maze") < 2.5
