"""Kept values are computed once, and those whose last use is longest ago are dropped."""

import numpy as np
import pytest

from optics.numerics.kept_values import KeptValues, cached_arrays


def test_a_value_is_computed_once():
    kept, computed = KeptValues(2), []
    for _ in range(3):
        assert kept.get("a", lambda: computed.append("a") or 7) == 7
    assert computed == ["a"]


def test_the_least_recently_used_value_is_dropped():
    kept = KeptValues(2)
    for key in "abac":  # drops b
        kept.get(key, lambda key=key: key.upper())
    assert len(kept) == 2
    assert [kept.get(key, lambda: "again") for key in "acb"] == ["A", "C", "again"]


@pytest.fixture
def zeros():
    """Return a cached function of up to 100 bytes, which notes its arguments."""

    @cached_arrays(100, lambda array: array.nbytes)
    def zeros(count):
        zeros.computed.append(count)
        return np.zeros(count)

    zeros.computed = []
    return zeros


def test_latest_results_within_the_limit_are_kept(zeros):
    first = zeros(5)  # 40 bytes
    zeros(6)
    assert zeros(5) is first
    zeros(7)  # 56 bytes, so the result that was not used for longest is dropped
    assert zeros(5) is first
    assert zeros.computed == [5, 6, 7]
    zeros(6)
    assert zeros.computed == [5, 6, 7, 6]


def test_a_result_above_the_limit_is_not_kept_and_drops_no_other(zeros):
    first = zeros(5)
    assert zeros(20).shape == zeros(20).shape == (20,)
    assert zeros(5) is first
    assert zeros.computed == [5, 20, 20]
