"""Confidence intervals of means and differences have their nominal coverage, also with few seeds."""

import numpy as np
import pytest

from experiments.means import difference, mean_of

EXPERIMENTS = 4000
BINOMIAL = 3 * np.sqrt(0.95 * 0.05 / EXPERIMENTS)  # three standard errors of a fraction of 0.95


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("seeds", [2, 3, 6])
def test_intervals_over_seeds_hold_the_mean_in_95_of_100(seeds):
    samples = np.random.default_rng(seeds).normal(size=(EXPERIMENTS, seeds))
    held = [one.low < 0 < one.high for one in map(mean_of, samples)]
    assert abs(np.mean(held) - 0.95) < BINOMIAL


@pytest.mark.parametrize("seeds", [2, 3, 6])
def test_a_bootstrap_over_as_few_seeds_would_be_too_narrow(seeds):
    """The test above rejects this wrong method: with two and three seeds the bootstrap interval spans at most their
    range."""
    chance = np.random.default_rng(seeds)
    held = []
    for sample in chance.normal(size=(1000, seeds)):
        means = sample[chance.integers(seeds, size=(400, seeds))].mean(axis=1)
        low, high = np.quantile(means, [0.025, 0.975])
        held.append(low < 0 < high)
    assert np.mean(held) < 0.95 - 2 * BINOMIAL


def test_intervals_of_differences_hold_them_where_spreads_differ():
    """Welch's degrees of freedom are an approximation, so half a percent is allowed in addition to the binomial
    error."""
    chance = np.random.default_rng(0)
    drawn = [(3 * chance.normal(size=6), chance.normal(size=12)) for _ in range(EXPERIMENTS)]
    held = [one.low < 0 < one.high for one in (difference(*both) for both in drawn)]
    assert abs(np.mean(held) - 0.95) < BINOMIAL + 0.005


def test_a_difference_has_the_sign_of_the_first_sample():
    found = difference(np.array([5.0, 5.0]), np.array([2.0, 2.0]))
    assert (found.mean, found.low, found.high) == (3.0, 3.0, 3.0)


def test_one_value_has_no_interval():
    assert str(mean_of(np.array([3.0]))) == "3"
    with pytest.raises(ValueError, match="at least two values"):
        difference(np.ones(1), np.ones(3))
