"""Errors in messages have enough digits to show that they exceed the tolerance."""

import math

import pytest

from optics.numerics.accuracy import above


@pytest.mark.parametrize(
    ("error", "tolerance", "shown"),
    [
        (0.0023, 0.001, "0.002"),
        (0.00104, 0.001, "0.00104"),
        (0.96, 0.9, "1"),
        (math.inf, 0.1, "inf"),
        (math.nan, 0.1, "nan"),
    ],
)
def test_an_error_above_the_tolerance_does_not_look_equal(error, tolerance, shown):
    assert above(error, tolerance) == shown
