"""Receptor noise is normal, independent, and separate for each world."""

import numpy as np
import pytest
from scipy import stats

import optics
import sim
from sim.render.receptor_noise import NoiseModel, Normals

SHAPE = (2, 3, 5, 7)  # 210 numbers, which is not a multiple of four


def keys(n, seed=0):
    return np.random.default_rng(seed).integers(0, 2**64, n, dtype=np.uint64)


@pytest.fixture(scope="module")
def frames():
    noise = Normals(keys(12), SHAPE)
    return np.array([noise.launch(np.arange(12)).wait() for _ in range(200)])


def test_it_is_standard_normal(frames):
    """The Kolmogorov-Smirnov test of 504,000 numbers rejects a standard deviation that is off by 1 %."""
    assert stats.kstest(frames.ravel(), "norm").pvalue > 1e-3
    assert stats.kstest(1.01 * frames.ravel(), "norm").pvalue < 1e-3


@pytest.mark.parametrize("axis", [0, 1, 2, 3, 4, 5])
def test_neighbours_are_independent(frames, axis):
    """Frames, worlds, eyes, channels and receptors have the correlation of independent pairs in the same number
    (4 σ).
    """
    first, second = (
        np.take(frames, index, axis).ravel() for index in (range(frames.shape[axis] - 1), range(1, frames.shape[axis]))
    )
    assert abs(np.mean(first * second)) < 4 / np.sqrt(len(first))


def test_no_frame_comes_twice(frames):
    assert len(np.unique(frames[:, :, 0, 0, 0, 0])) == frames.shape[0] * frames.shape[1]


def test_a_worlds_noise_does_not_depend_on_its_neighbours(frames):
    few = Normals(keys(12)[:3], SHAPE)
    np.testing.assert_array_equal([few.launch(np.arange(3)).wait() for _ in range(4)], frames[:4, :3])


def test_some_worlds_alone_draw_their_own_next_frames(frames):
    noise = Normals(keys(12), SHAPE)
    np.testing.assert_array_equal(noise.launch(np.array([7, 3])).wait(), frames[0, [7, 3]])
    after = noise.launch(np.arange(12)).wait()
    np.testing.assert_array_equal(after[[3, 7]], frames[1, [3, 7]])
    np.testing.assert_array_equal(after[[0, 11]], frames[0, [0, 11]])


def test_restart_begins_anew(frames):
    noise = Normals(keys(12, seed=1), SHAPE)
    assert not np.array_equal(noise.launch(np.arange(12)).wait(), frames[0])
    noise.restart(keys(12))
    np.testing.assert_array_equal(noise.launch(np.arange(12)).wait(), frames[0])


def test_gaussian_noise_adds_with_its_standard_deviation():
    signals = np.array([[1.0, 2.0]], np.float32)
    np.testing.assert_allclose(NoiseModel(0.1)(signals, np.array([[1.0, -2.0]], np.float32)), [[1.1, 1.8]], rtol=1e-6)


@pytest.mark.parametrize("photons", [20.0, 300.0, 1e5])
def test_shot_noise_has_poissons_moments(photons):
    """300,000 draws of a signal of 0.5, with Gaussian noise of equal variance added: mean, variance and third cumulant
    are within 5 of their standard errors. With few photons, a Gaussian of the same variance has a wrong third cumulant.
    """
    sigma, signal, n = np.sqrt(0.5 / photons), 0.5, 300_000
    z = np.random.default_rng(0).standard_normal((1, 1, 1, 1, n), dtype=np.float32)
    noise = NoiseModel(float(sigma), np.full((1, 1, 1), photons, np.float32))
    drawn = noise(np.full_like(z, signal), z.copy()).astype(np.float64).ravel()
    variance, third = sigma**2 + signal / photons, signal / photons**2
    assert abs(drawn.mean() - signal) < 5 * np.sqrt(variance / n)
    assert drawn.var() == pytest.approx(variance, rel=5 * np.sqrt(2 / n) + 2 * third**2 / variance**3)
    error = 5 * np.sqrt(15 / n) * variance**1.5
    assert abs(((drawn - drawn.mean()) ** 3).mean() - third) < error
    gaussian = (signal + np.sqrt(variance) * z).astype(np.float64).ravel()
    assert photons > 100 or abs(((gaussian - gaussian.mean()) ** 3).mean() - third) > error


def test_dim_light_is_noisy_light():
    """A hundredth of the light has ten times the shot noise, relative to the signal. The photon numbers come from
    `optics.Eye`.
    """
    sun, dusk = (
        sim.Eyes(resolution=(4, 5), noise_sigma=0.0, photon_budget=optics.PhotonBudget(illuminance=lx))
        for lx in (1e4, 1e2)
    )
    seen = []
    for eyes in (sun, dusk):
        worlds = sim.make_vec_env("detection", eyes, 16, seed=3)
        noisy, clean = worlds.reset()["eyes"][:, 0], worlds.renderer.signals(worlds.state)
        lit = clean > 0
        expected = np.sqrt(clean / eyes.eye().photons[:, None, None])[lit]
        assert np.std((noisy - clean)[lit] / expected) == pytest.approx(1, rel=0.06)  # 1920 numbers: ± 1.6 %
        seen.append(np.std(noisy - clean))
        worlds.close()
    assert seen[1] / seen[0] == pytest.approx(10, rel=0.05)


def test_photon_budgets_are_checked():
    with pytest.raises(ValueError, match=r"photon_budget = 3: must be an optics\.PhotonBudget or None"):
        sim.Eyes(photon_budget=3)


def test_the_largest_noise_is_that_of_the_receptors_with_fewest_photons_in_the_brightest_light():
    """Shot noise has the variance signal / photons, here for a signal of 2 * 0.5."""
    photons = np.array([20.0, 300.0], np.float32).reshape(2, 1, 1)
    assert NoiseModel(0.1, photons).largest(0.5) == pytest.approx(np.sqrt(0.01 + 1.0 / 20))
    assert NoiseModel(0.1).largest(0.5) == pytest.approx(0.1)
    z = np.random.default_rng(0).standard_normal((2, 1, 100_000)).astype(np.float32)
    drawn = NoiseModel(0.1, photons)(np.full_like(z, 1.0), z.copy())
    assert drawn.std(axis=-1).max() == pytest.approx(NoiseModel(0.1, photons).largest(0.5), rel=0.02)
