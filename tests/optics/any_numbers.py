"""Strategies from which tests draw inputs, odd ones included, and a check of refusals."""

import math
import os

from hypothesis import strategies as st

from tests.slow_part import FAST_EXAMPLES, sweep

WAVELENGTHS = (300e-9, 900e-9)


def examples(count, fast=FAST_EXAMPLES):
    return sweep(count * int(os.environ.get("OPTICS_EXAMPLES", "1")), fast)


def logarithmic(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


def or_odd(usual):
    """Return a strategy that usually draws values of `usual`, and sometimes values that no user should pass."""
    odd = st.sampled_from([0.0, -1e-6, math.nan, math.inf, -math.inf, 1e-300, 1e-16, 1e16, 1e300])
    return st.one_of(*[usual] * 8, odd)


def only_one_line(error):
    assert str(error)
    assert "\n" not in str(error)
