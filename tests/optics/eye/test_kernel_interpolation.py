"""The largest difference between the signals of two kernels for one scene, and the error of interpolated kernels."""

import itertools

import numpy as np
import pytest

from optics import AccuracyError
from optics.eye.kernel_interpolation import NodeChoice, checks, nodes, worst_difference
from optics.numerics.interpolation import linear_weights

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


def _steps(counts):
    """Return the offsets from the middle of a cell of nodes to its four corners."""
    return list(itertools.product(*((-1 / (n - 1), 1 / (n - 1)) for n in counts)))


class TestNodeChoice:
    @pytest.mark.parametrize("counts", [(1,), (3,), (9,), (1, 1), (3, 3), (3, 5), (9, 9), (1, 5)])
    def test_checks_lie_between_nodes(self, counts):
        places = checks(counts)
        assert 1 <= len(places) <= 8
        assert len(set(places)) == len(places)
        assert all(-1 <= at <= 1 for place in places for at in place)

    def test_linear_weights_sum_to_one(self):
        at = np.linspace(-1.5, 1.5, 31)
        for count in (1, 2, 3, 5):
            np.testing.assert_allclose(linear_weights(at, nodes(count)).sum(axis=0), 1)

    def test_the_worst_scene_reaches_the_worst_difference(self):
        """The difference is largest for a scene with light only where the second kernel exceeds the first."""
        rng = np.random.default_rng(0)
        a, b = rng.random((1, 5, 5)), rng.random((1, 7, 7))
        padded = b - np.pad(a, ((0, 0), (1, 1), (1, 1)))
        box = np.zeros((8, 8))
        for i, j in np.ndindex(2, 2):
            box[i : i + 7, j : j + 7] += padded[0] / 4
        expected = max(box[box > 0].sum(), -box[box < 0].sum())
        assert worst_difference([(1, b), (-1, a)], 2) == pytest.approx(expected)

    @pytest.mark.parametrize("counts", [(5, 5), (9, 5), (9, 9)])
    @pytest.mark.parametrize("corner", [(-1, -1), (-1, 1), (1, -1), (1, 1)])
    def test_an_error_in_one_corner_of_the_field_is_seen(self, counts, corner):
        """The curvature grows from the opposite corner to this one, so the largest error is beside this corner."""

        def kernel(at):
            near = sum(there * side for there, side in zip(at, corner, strict=True)) / 2 + 1
            return np.full((1, 1, 1), near**8)

        choice = NodeChoice("test", kernel, [counts], 1)
        beside = tuple(side * (1 - 1 / (n - 1)) for side, n in zip(corner, counts, strict=True))
        around = [tuple(x - s * d for x, s, d in zip(beside, corner, step, strict=True)) for step in _steps(counts)]
        expected = np.mean([kernel(at) for at in around]) - kernel(beside).item()
        assert choice.error(counts) == pytest.approx(expected)

    def test_a_quadratic_family_errs_as_predicted(self):
        """Linear interpolation of t² between nodes at the distance h has an error of h²/4."""
        choice = NodeChoice("test", lambda at: np.full((1, 1, 1), at[0] ** 2), [(3,), (5,), (9,)], 1)
        assert [choice.error((n,)) for n in (3, 5, 9)] == pytest.approx([1 / 4, 1 / 16, 1 / 64])
        assert choice.choose(0.1).counts == (5,)
        with pytest.raises(AccuracyError, match=r"9 test nodes leave 2\.0e-02"):
            choice.choose(0.001)
