"""Derivatives of the light that arrives on a plane, by the adjoint of its sum, against differences of the sum."""

import drjit as dr
import numpy as np
import pytest

import optics
from optics.point_spread.arriving import _summed
from tests.optics.point_spread.test_derivatives import asking, difference, number

CHANCE = np.random.default_rng(0)
HEIGHTS, BRIGHT = 0.4e-6 * CHANCE.random((8, 8)), 0.5 + 0.5 * CHANCE.random((8, 8))
VALUES = {"radius": 3e-6, "n": 1.5, "height": 1.0, "waist": 2e-6, "focal_length": 9e-6}


def arriving(values, **others):
    """Return the fraction of light that is not evanescent, for a rough relief, a mask and a fast lens."""
    pupil = optics.Pupil(
        values["radius"],
        height=optics.HeightMap(values["height"] * optics_array(HEIGHTS)),
        n=values["n"],
        thin_lens_focal_length=values["focal_length"],
        mask=optics.GaussianMask(values["waist"]),
    )
    result = optics.psf(pupil, [550e-9], 9e-6, dx=0.4e-6, shape=(9, 9), tolerance=1e-2, **others)
    return dr.sum(_summed(result.requests[0]))


def optics_array(heights):
    from drjit.auto.ad import TensorXf64

    return TensorXf64(heights)


@pytest.mark.parametrize("name", VALUES)
def test_derivatives_of_the_light_that_arrives(name):
    expected = difference(lambda values: number(arriving(values)), VALUES, name)
    x = asking(VALUES[name])
    dr.backward(arriving({**VALUES, name: x}))
    assert number(dr.grad(x)) == pytest.approx(expected, rel=1e-4)
    assert expected != 0
