"""Intervals: membership, and their form in messages."""

import math

import pytest

from evolve.genome.interval import Interval


@pytest.mark.parametrize(
    ("interval", "inside", "outside", "quoted"),
    [
        (Interval(0, 1), (0, 0.5, 1), (-1e-9, 1.1, math.nan), "[0, 1]"),
        (Interval(0, 1, open_low=True), (1e-9, 1), (0, math.inf), "(0, 1]"),
        (Interval(2), (2, 1e300), (1, math.inf, math.nan), "[2, inf)"),
    ],
)
def test_interval_holds_its_numbers_and_no_others(interval, inside, outside, quoted):
    assert all(value in interval for value in inside)
    assert not any(value in interval for value in outside)
    assert str(interval) == quoted
