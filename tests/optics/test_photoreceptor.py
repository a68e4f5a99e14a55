"""Noise statistics and spectral weighting."""

import numpy as np
import pytest

from optics.photoreceptor import gaussian_noise, photon_noise, quantum_catch, throughput


def test_throughput_is_the_area():
    assert throughput(0.5) == 0.25
    with pytest.raises(ValueError, match=r"relative_aperture = 1\.1"):
        throughput(1.1)


def test_quantum_catch_is_the_weighted_sum_over_bands():
    light = np.random.default_rng(0).random((4, 2, 3))
    weights = np.random.default_rng(1).random((3, 4))
    expected = sum(weights[:, b, None, None] * light[b] for b in range(4))
    np.testing.assert_allclose(quantum_catch(light, weights), expected)


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


@pytest.mark.parametrize(
    "call", [lambda r: gaussian_noise(np.ones(2), -1, r), lambda r: photon_noise(-np.ones(2), 10, r)]
)
def test_bad_noise(call):
    with pytest.raises(ValueError, match="must"):
        call(np.random.default_rng(0))
