"""A cache that is limited by memory."""

import numpy as np

from optics.numerics.array_cache import cached_arrays


def test_latest_results_within_the_limit_are_kept():
    computed = []

    @cached_arrays(100, lambda array: array.nbytes)
    def zeros(count):
        computed.append(count)
        return np.zeros(count)

    first = zeros(5)  # 40 bytes
    zeros(6)
    assert zeros(5) is first
    zeros(7)  # 56 bytes, so the result that was not used for longest is removed
    assert zeros(5) is first
    assert computed == [5, 6, 7]
    zeros(6)
    assert computed == [5, 6, 7, 6]


def test_results_above_the_limit_are_not_kept():
    computed = []

    @cached_arrays(100, lambda array: array.nbytes)
    def zeros(count):
        computed.append(count)
        return np.zeros(count)

    assert zeros(20).shape == zeros(20).shape == (20,)
    assert computed == [20, 20]
