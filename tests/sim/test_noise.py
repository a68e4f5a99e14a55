"""Receptor noise: normal, independent, and each world's own."""

import numpy as np
import pytest
from scipy import stats

from sim.noise import ReceptorNoise, add_noise

SHAPE = (2, 3, 5, 7)  # 210 numbers, no multiple of four


def keys(n, seed=0):
    return np.random.default_rng(seed).integers(0, 2**64, n, dtype=np.uint64)


@pytest.fixture(scope="module")
def frames():
    noise = ReceptorNoise(keys(12), SHAPE)
    return np.array([noise.begin().values() for _ in range(200)])


def test_it_is_standard_normal(frames):
    """504,000 numbers: Kolmogorov-Smirnov rejects a standard deviation that is off by 1 %."""
    assert stats.kstest(frames.ravel(), "norm").pvalue > 1e-3
    assert stats.kstest(1.01 * frames.ravel(), "norm").pvalue < 1e-3


@pytest.mark.parametrize("axis", [0, 1, 2, 3, 4, 5])
def test_neighbours_are_independent(frames, axis):
    """Frames, worlds, eyes, channels, receptors: their correlation is that of so many independent pairs (4 σ)."""
    first, second = (
        np.take(frames, index, axis).ravel() for index in (range(frames.shape[axis] - 1), range(1, frames.shape[axis]))
    )
    assert abs(np.mean(first * second)) < 4 / np.sqrt(len(first))


def test_no_frame_comes_twice(frames):
    assert len(np.unique(frames[:, :, 0, 0, 0, 0])) == frames.shape[0] * frames.shape[1]


def test_a_worlds_noise_does_not_depend_on_its_neighbours(frames):
    few = ReceptorNoise(keys(12)[:3], SHAPE)
    np.testing.assert_array_equal([few.begin().values() for _ in range(4)], frames[:4, :3])


def test_some_worlds_alone_draw_their_own_next_frames(frames):
    noise = ReceptorNoise(keys(12), SHAPE)
    np.testing.assert_array_equal(noise.of(np.array([7, 3])), frames[0, [7, 3]])
    after = noise.begin().values()
    np.testing.assert_array_equal(after[[3, 7]], frames[1, [3, 7]])
    np.testing.assert_array_equal(after[[0, 11]], frames[0, [0, 11]])


def test_restart_begins_anew(frames):
    noise = ReceptorNoise(keys(12, seed=1), SHAPE)
    assert not np.array_equal(noise.begin().values(), frames[0])
    noise.restart(keys(12))
    np.testing.assert_array_equal(noise.begin().values(), frames[0])


def test_noise_adds_with_its_standard_deviation():
    signals = np.array([[1.0, 2.0]], np.float32)
    np.testing.assert_allclose(add_noise(signals, 0.1, np.array([[1.0, -2.0]], np.float32)), [[1.1, 1.8]], rtol=1e-6)
