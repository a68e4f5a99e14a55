"""The largest difference between the signals of two kernels for one scene."""

import numpy as np
import pytest

from optics.eye.kernel_interpolation import worst_difference

S = 2  # samples per receptor


def test_a_signal_too_dark_is_as_wrong_as_one_too_bright():
    kernel = np.zeros((1, 5, 5))
    kernel[0, 2, 1:4] = 0.25, 0.5, 0.25
    for terms in ([(1, kernel)], [(-1, kernel)], [(-3, kernel), (2, kernel)]):
        assert worst_difference(terms, S) == pytest.approx(1)
    moved = np.roll(kernel, 1, axis=2)
    there, back = worst_difference([(1, kernel), (-1, moved)], S), worst_difference([(-1, kernel), (1, moved)], S)
    assert there == pytest.approx(back)
    assert 0.1 < there < 1
