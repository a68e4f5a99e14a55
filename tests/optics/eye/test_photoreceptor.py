"""Noise statistics and spectral weighting."""

import numpy as np
import pytest

from optics.eye.photoreceptor import gaussian_noise, photon_noise, quantum_catch, throughput
from optics.numerics.precision import precision


def test_throughput_is_the_area():
    assert throughput(0.5) == 0.25
    assert throughput(0.5, 0.75) == 0.1875
    assert throughput(1 + 1e-12) == 1  # rounding
    with pytest.raises(ValueError, match=r"relative_aperture = 1\.1"):
        throughput(1.1)


def test_quantum_catch_is_the_weighted_sum_over_bands():
    types = precision("float64")
    light = np.random.default_rng(0).random((4, 2, 3))
    weights = np.random.default_rng(1).random((3, 4))
    expected = 0.25 * sum(weights[:, b, None, None] * light[b] for b in range(4))
    np.testing.assert_allclose(quantum_catch(types.Tensor(light), weights, 0.25, types).numpy(), expected)


def test_gaussian_noise_is_the_same_in_the_dark():
    rng = np.random.default_rng(0)
    for level in (0.0, 1.0):
        noisy = gaussian_noise(np.full(40000, level), 0.05, rng)
        assert noisy.mean() == pytest.approx(level, abs=1e-3)
        assert noisy.std() == pytest.approx(0.05, rel=0.02)


def test_photon_noise_grows_with_the_root_of_the_light():
    rng = np.random.default_rng(0)
    for level in (0.01, 1.0):
        noisy = photon_noise(np.full(40000, level), 1000, rng)
        assert noisy.mean() == pytest.approx(level, rel=0.01)
        assert noisy.std() == pytest.approx(np.sqrt(level / 1000), rel=0.02)
    assert photon_noise(np.zeros(5), 1000, rng).max() == 0


def test_photons_of_each_channel():
    noisy = photon_noise(np.ones((2, 100, 100)), np.array([100, 10000]), np.random.default_rng(0))
    np.testing.assert_allclose(noisy.std(axis=(1, 2)), [0.1, 0.01], rtol=0.03)


@pytest.mark.parametrize(
    "call",
    [
        lambda r: gaussian_noise(np.ones(2), -1, r),
        lambda r: photon_noise(-np.ones(2), 10, r),
        lambda r: photon_noise(np.full(2, np.nan), 10, r),
        lambda r: photon_noise(np.ones(2), 0, r),
        lambda r: photon_noise(np.full(2, 1e6), 1e15, r),
    ],
)
def test_bad_noise(call):
    with pytest.raises(ValueError, match="must"):
        call(np.random.default_rng(0))
