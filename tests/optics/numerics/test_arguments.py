"""Checks of arguments: the bounds are allowed, and values beyond them are named."""

import math

import numpy as np
import pytest

from optics.numerics.arguments import finite, positive, reals, shape_2d, whole


@pytest.mark.parametrize("value", [2, 5, 3.0])
def test_whole_numbers_within_bounds_are_taken(value):
    assert whole("n", value, 2, 5) == value


@pytest.mark.parametrize("value", [1, 6, True, 2.5, math.nan, math.inf, "3", None, [3], 10**400])
def test_others_are_named(value):
    with pytest.raises(ValueError, match=r"^n = .*: must be a whole number in \[2, 5\]"):
        whole("n", value, 2, 5)


@pytest.mark.parametrize("check", [finite, positive, reals, lambda name, value: shape_2d(name, (2, value))])
def test_booleans_are_no_numbers(check):
    assert np.ravel(check("n", 1))[-1] == 1
    for value in (True, np.True_):
        with pytest.raises(ValueError, match=r"^n.*: must be"):
            check("n", value)


def test_a_largest_value_is_named():
    assert positive("n", 360, most=360) == 360
    with pytest.raises(ValueError, match=r"^n = 361: must be greater than 0 and at most 360, in degrees$"):
        positive("n", 361, "degrees", most=360)
