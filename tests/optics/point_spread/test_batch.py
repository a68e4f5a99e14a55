"""Many PSFs at once equal the PSFs one by one."""

import math

import numpy as np
import pytest

import optics
from optics import BSplineRelief, Pupil

WAVELENGTHS, DEPTHS = (450e-9, 600e-9), (1e-3, 5e-3, math.inf)
VIEW = {"dx": 1e-6, "shape": (21, 17), "tolerance": 1e-3}


def pupils(radius=12e-6):
    relief = BSplineRelief(np.random.default_rng(0).random((4, 4)) * 2e-6)
    return [Pupil(radius, thin_lens_focal_length=150e-6), Pupil(radius, relief)]


def test_equals_one_by_one():
    batch = optics.psf_batch(pupils(), WAVELENGTHS, 150e-6, DEPTHS, **VIEW)
    assert batch.psf.shape == (2, 3, 2, 21, 17)
    for i, pupil in enumerate(pupils()):
        for j, depth in enumerate(DEPTHS):
            one = optics.psf(pupil, WAVELENGTHS, 150e-6, depth, **VIEW)
            np.testing.assert_allclose(batch.psf[i, j], one.psf, rtol=1e-6)  # stacks round sums differently
            assert [plan.method for plan in one.plans] == [plan.method for plan in batch.plans[6 * i + 2 * j :][:2]]


def test_carries_derivatives():
    import drjit as dr

    from optics.numerics.precision import precision

    def total(radius):
        batch = optics.psf_batch(
            pupils(radius), WAVELENGTHS, 150e-6, DEPTHS[:2], **{**VIEW, "tolerance": 1e-8}, dtype="float64"
        )
        weight = np.random.default_rng(1).random(batch.tensor.shape).ravel()
        return dr.sum(batch.tensor.array * precision("float64").Float(weight))

    radius = precision("float64").Float(12e-6)
    dr.enable_grad(radius)
    dr.backward(total(radius))
    step = 1e-10
    high, low = (float(total(12e-6 + sign * step).numpy()[0]) for sign in (1, -1))
    assert float(dr.grad(radius).numpy()[0]) == pytest.approx((high - low) / (2 * step), rel=1e-4)


@pytest.mark.parametrize("name", ["pupils", "wavelengths", "source_distances"])
def test_must_not_be_empty(name):
    arguments = {"pupils": pupils(), "wavelengths": WAVELENGTHS, "source_distances": DEPTHS, name: ()}
    with pytest.raises(ValueError, match=f"{name} = .*: must be a sequence of at least one"):
        optics.psf_batch(**arguments, **VIEW)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_each_has_the_measures_of_one(tolerance):
    """Measures agree whether the PSFs come from one common plan or from separate plans."""
    view = {**VIEW, "shape": (65, 65), "tolerance": tolerance}
    batch = optics.psf_batch(pupils(), WAVELENGTHS, 150e-6, DEPTHS, **view)
    for i, pupil in enumerate(pupils()):
        for j, depth in enumerate(DEPTHS):
            mine, one = batch.result(np.int64(i), np.int64(j)), optics.psf(pupil, WAVELENGTHS, 150e-6, depth, **view)
            np.testing.assert_array_equal(mine.psf, batch.psf[i, j])
            np.testing.assert_array_equal(mine.x, batch.x)
            (strehl, error), (other, its) = (optics.strehl_ratio(seen, with_error=True) for seen in (mine, one))
            np.testing.assert_array_less(np.abs(strehl - other), error + its)
            assert mine.can_recompute
    with pytest.raises(ValueError, match=r"eye = 2: must be a whole number in \[0, 1\]"):
        batch.result(2)
