"""The fittest animal at each price, against sums that are worked out by hand."""

import numpy as np
import pytest

from evolve.config.costs import CostsConfig
from experiments.eye_factors_design import CAMERA, COMPOUND
from experiments.eye_prices import fittest, probability_of_finer

FREE = CostsConfig()


def returns(compound, camera):
    return {COMPOUND: np.array(compound), CAMERA: np.array(camera)}


def test_prices_decide_between_many_coarse_and_few_fine_eyes():
    """Ten eyes of 4 x 4 have 480 receptors of three types, and two of 15 x 15 have 1350."""
    equal = returns([50.0, 52.0], [60.0, 62.0])
    assert fittest(equal, FREE) == CAMERA
    dearer = 10 / (1350 - 480)
    assert fittest(equal, CostsConfig(per_receptor=0.99 * dearer)) == CAMERA
    assert fittest(equal, CostsConfig(per_receptor=1.01 * dearer)) == COMPOUND
    assert fittest(returns([60.0, 62.0], [50.0, 52.0]), CostsConfig(per_eye=1.3)) == CAMERA  # 8 eyes more cost 10.4


def test_probability_of_divergence_follows_the_scatter_of_runs():
    rng = np.random.default_rng(1)
    sure = probability_of_finer(returns([1.0, 2.0], [8.0, 9.0]), returns([8.0, 9.0], [1.0, 2.0]), FREE, rng)
    assert sure == (1.0, 0.0)
    same = returns([1.0, 9.0], [2.0, 8.0])
    finer, coarser = probability_of_finer(same, same, FREE, rng)
    # The means are 1, 5, 5, 9 and 2, 5, 5, 8: fine eyes win in 6 of 16 cases, and coarse eyes win ties.
    assert finer == pytest.approx(6 / 16 * 10 / 16, abs=0.03)
    assert coarser == pytest.approx(6 / 16 * 10 / 16, abs=0.03)
