"""Effects in a factorial design, against means of cells and known coefficients."""

import itertools

import numpy as np
import pytest

from experiments.factorial import effects, interaction_with_task

NAMES = ("number", "width", "arc")


def runs(repeats):
    """Levels and blocks of a complete design."""
    cells = list(itertools.product((-1, 1), repeat=len(NAMES)))
    levels = {name: [cell[n] for _ in range(repeats) for cell in cells] for n, name in enumerate(NAMES)}
    return levels, [block for block in range(repeats) for _ in cells]


def response(levels, blocks, seed, number=3.0, joint=0.0, spread=1.0):
    noise = spread * np.random.default_rng(seed).normal(size=len(blocks))
    a, b = np.array(levels["number"]), np.array(levels["width"])
    return number / 2 * a + joint / 2 * a * b + 10.0 * np.array(blocks) + noise


def test_effects_are_differences_of_means_in_a_balanced_design():
    levels, blocks = runs(4)
    y = response(levels, blocks, 0)
    found = effects(levels, blocks, y)
    for name in NAMES:
        high = np.array(levels[name]) > 0
        expected = (y[high].mean() - y[~high].mean()) / found.spread
        assert found.of[(name,)].mean == pytest.approx(expected)
    assert found.freedom == 4 * 8 - 7 - 4


def test_differences_between_blocks_do_not_widen_the_intervals():
    levels, blocks = runs(6)
    found = effects(levels, blocks, response(levels, blocks, 1))
    assert found.spread == pytest.approx(1.0, rel=0.3)


def test_95_of_100_intervals_contain_the_true_effect():
    """The binomial standard deviation of 400 trials is 1.1 %; effects are stated in units of an estimated spread."""
    levels, blocks = runs(3)
    hits = {("arc",): 0, ("number", "width"): 0}
    for seed in range(400):
        found = effects(levels, blocks, response(levels, blocks, seed))
        for names in hits:
            hits[names] += found.of[names].low <= 0 <= found.of[names].high
    assert all(abs(count / 400 - 0.95) < 0.035 for count in hits.values()), hits


def test_an_effect_that_depends_on_the_task_is_found_in_the_interaction_only():
    levels, blocks = runs(8)
    one, other = (effects(levels, blocks, response(levels, blocks, seed, n)) for seed, n in ((2, 3.0), (3, -3.0)))
    both = interaction_with_task(one, other)
    assert both[("number",)].low > 3
    assert both[("width",)].low < 0 < both[("width",)].high


def test_too_few_runs_are_refused():
    levels, blocks = runs(1)
    with pytest.raises(ValueError, match="too few for 7 effects and 1 blocks"):
        effects(levels, blocks, response(levels, blocks, 0))
