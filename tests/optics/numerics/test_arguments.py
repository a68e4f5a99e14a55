"""Checks of arguments: the bounds are allowed, and values beyond them are named."""

import math

import pytest

from optics.numerics.arguments import whole


@pytest.mark.parametrize("value", [2, 5, 3.0])
def test_whole_numbers_within_bounds_are_taken(value):
    assert whole("n", value, 2, 5) == value


@pytest.mark.parametrize("value", [1, 6, 2.5, math.nan, math.inf, "3", None, [3], 10**400])
def test_others_are_named(value):
    with pytest.raises(ValueError, match=r"^n = .*: must be a whole number in \[2, 5\]"):
        whole("n", value, 2, 5)
