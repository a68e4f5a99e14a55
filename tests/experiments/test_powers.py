"""Power laws: exact laws are recovered, and intervals have their nominal coverage."""

import numpy as np
import pytest

from experiments.powers import power_law


def test_exact_powers_are_found():
    chance = np.random.default_rng(0)
    a, b = np.exp(chance.uniform(3, 9, (2, 30)))
    law = power_law(0.3 * a**-0.4 * b**0.2, a, b)
    assert [one.mean for one in law.exponents] == pytest.approx([0.4, -0.2])
    assert [one.low for one in law.exponents] == pytest.approx([0.4, -0.2])
    assert law.scale == pytest.approx(0.3)
    assert law.explained == pytest.approx(1.0)
    assert law.error(a, b) == pytest.approx(0.3 * a**-0.4 * b**0.2)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    """The intervals of 95 of 100 laws with 40 candidates should contain the true exponent. A bootstrap of pairs is
    slightly too narrow, so the limit is 3.3 standard deviations below a count of 93.
    """
    chance = np.random.default_rng(1)
    held = 0
    for seed in range(100):
        size = np.exp(chance.uniform(0, 5, 40))
        law = power_law(size**-0.3 * np.exp(0.4 * chance.standard_normal(40)), size, seed=seed)
        held += law.exponents[0].low <= 0.3 <= law.exponents[0].high
    assert 85 <= held <= 99


@pytest.mark.slow
def test_spread_is_what_is_not_explained():
    """The size explains half of the variance."""
    chance = np.random.default_rng(2)
    x, noise = chance.standard_normal((2, 20_000))
    assert power_law(np.exp(-x + noise), np.exp(x)).explained == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(
    ("errors", "sizes", "message"),
    [
        ([0.5, 0.4, 0.3], [[1, 1, 1]], "at least 3"),
        ([0.5, 0.4, 0.3, 0.2], [[1, 2, 3, 4], [2, 4, 6, 8]], "following"),
        ([0.5, 0.5, 0.5, 0.5], [[1, 2, 3, 4]], "all equal"),
        ([0.5, 0.0, 0.3, 0.4], [[1, 2, 3, 4]], "must be positive"),
    ],
)
def test_what_has_no_power_law_is_refused(errors, sizes, message):
    with pytest.raises(ValueError, match=message):
        power_law(np.array(errors), *map(np.array, sizes))
