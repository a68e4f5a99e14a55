"""Sums within circles: the weights of single circles, their derivatives, and work that does not grow with the radii."""

import time

import drjit as dr
import numpy as np
import pytest

import optics
from optics.apertures.circular import disk_profile
from optics.apertures.soft_edge import SoftEdge
from optics.point_spread.circle_sums import SoftCircles, sums_of_cells
from tests.optics.device_types import Float64

RIPPLE = 1e-5


def near_and_far(rng, count):
    """Return distances from a random centre, and radii from 0 on, in units of 1/cutoff."""
    x, y = rng.uniform(-12, 12, (2, count)) - rng.uniform(-1, 1, (2, 1))
    return np.hypot(x, y), np.concatenate([[0.0, 1e-9, 0.03], rng.uniform(0, 9, 20)])


@pytest.mark.parametrize("seed", range(4))
def test_all_circles_weigh_samples_as_each_does(seed):
    """The reference for the weights is a quadrature for one soft disk at a time."""
    rng = np.random.default_rng(seed)
    distance, radii = near_and_far(rng, 60)
    kernel = SoftEdge(1.0, rng.uniform(1.5, 6), RIPPLE)
    found = SoftCircles.around(distance, radii, kernel).evaluate(np.eye(60)).T
    for radius, row in zip(radii[1:], found[1:], strict=True):
        np.testing.assert_allclose(row, disk_profile(kernel, radius, distance), atol=RIPPLE)
    assert found[0] == pytest.approx(np.zeros(60), abs=1e-12)


def test_the_adjoint_is_the_transpose():
    rng = np.random.default_rng(5)
    distance, radii = near_and_far(rng, 40)
    circles = SoftCircles.around(distance, radii, SoftEdge(1.0, 2.0, RIPPLE))
    v, u = rng.normal(size=(3, 40)), rng.normal(size=(3, len(radii)))
    assert (circles.evaluate(v) * u).sum() == pytest.approx((circles.transposed(u) * v).sum())


def test_cells_count_with_the_share_that_lies_within():
    rng = np.random.default_rng(6)
    distance, radii = near_and_far(rng, 50)
    values, weights = rng.random(100), rng.random(2 * len(radii))
    shares = np.clip((radii[:, None] - distance) / 0.7 + 0.5, 0, 1) * (radii[:, None] > 0)
    given = Float64(values)
    dr.enable_grad(given)
    found = sums_of_cells(given, distance, radii, 0.7)
    np.testing.assert_allclose(found.numpy(), (values.reshape(2, 50) @ shares.T).ravel(), atol=1e-12)
    dr.backward(dr.sum(found * Float64(weights)))
    np.testing.assert_allclose(given.grad.numpy(), (weights.reshape(2, -1) @ shares).ravel(), atol=1e-12)


def test_many_radii_take_no_more_work_than_some():
    """Earlier versions evaluated the edge of each circle separately, so that 1000 circles took 1000 times as long."""
    pupil = optics.Pupil(1e-3, thin_lens_focal_length=12.5e-3)
    blurred = optics.psf(pupil, sensor_distance=12.8e-3, dx=1.1e-6, shape=(129, 129))
    optics.encircled_energy(blurred, 30e-6)

    def seconds(radii):
        start = time.process_time()
        optics.encircled_energy(blurred, radii)
        return time.process_time() - start

    few, many = (min(seconds(np.linspace(1e-6, 40e-6, n)) for _ in range(2)) for n in (5, 400))
    assert many < 8 * few
