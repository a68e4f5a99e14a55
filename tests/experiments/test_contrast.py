"""Differences between groups of searches: their p-values are uniform without a difference, and Holm's adjustment."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from experiments.contrast import contrast, holm
from experiments.drift import Drift
from experiments.evolved import Store
from experiments.store import Origin
from tests.experiments.test_evolved import ROW

GROUPS = ("a", "b")


def store_of(values, ends):
    """Searches of one candidate each, with these values of cpd (group, seed), and the ends of random searches."""
    rows = [
        replace(ROW, group=group, seed=seed, cpd=value)
        for group, of_group in zip(GROUPS, values, strict=True)
        for seed, value in enumerate(of_group)
    ]
    told = " ".join(map(str, ends))
    return Store(rows, [], [Drift(group, "x", 0, -2.0, 0.0, 2.0, told) for group in GROUPS], Origin.here(1.0), "")


def compared(values, ends):
    return contrast(store_of(values, ends), "x", lambda row: row.cpd, *GROUPS)


def test_without_a_difference_p_is_uniform(monkeypatch):
    """The distribution of 250 p-values is at most 0.103 away from the uniform one, the 1 % limit of the test by
    Kolmogorov and Smirnov."""
    monkeypatch.setattr("experiments.contrast.SEVERAL", 1000)  # random groups, fewer than usual
    chance = np.random.default_rng(1)
    ends = chance.normal(size=1000)
    ps = [compared(chance.normal(size=(2, 3)), ends).p for _ in range(250)]
    assert kstest(ps, "uniform").statistic < 0.103


def test_a_strong_difference_has_the_least_p_whatever_its_sign():
    ends = np.random.default_rng(0).normal(size=1000)
    for sign in (1, -1):
        found = compared([[0, 0, 0], [4 * sign, 5 * sign, 6 * sign]], ends)
        assert found.value == pytest.approx(5 * sign)
        assert found.p == pytest.approx(2 / 1001)
    assert found.low == pytest.approx(-1.96 * np.sqrt(2 / 3), abs=0.1)


def test_a_known_difference_has_the_p_of_the_normal_distribution():
    """The difference of two means of three normal values has a standard deviation of √(2/3); 1.6 is 1.96 of them."""
    ends = np.random.default_rng(3).normal(size=5000)
    assert compared([[0, 0, 0], [1.6, 1.6, 1.6]], ends).p == pytest.approx(0.05, abs=0.005)


def test_groups_of_unequal_length_or_without_searches_are_not_compared():
    store = store_of([[0, 0], [1, 1]], range(10))
    later = replace(store, rows=[*store.rows, replace(store.rows[0], generation=1)])
    assert contrast(later, "x", lambda row: row.cpd, *GROUPS) is None
    assert contrast(replace(store, rows=store.group("a")), "x", lambda row: row.cpd, *GROUPS) is None


def test_holm_multiplies_the_smallest_p_by_the_number_of_tests():
    """Example: 0.01 * 4, 0.02 * 3, then the maximum of what precedes and 0.03 * 2 or 0.04 * 1."""
    assert holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.6, 1.0]) == [1.0, 1.0]
