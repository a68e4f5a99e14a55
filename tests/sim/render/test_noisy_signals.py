"""Looks that are begun early and waited for late are the looks they would have been one after the other."""

import numpy as np
import pytest

import sim
from sim.render.batched_renderer import BatchedRenderer
from sim.render.noisy_signals import NoisySignals
from sim.render.receptor_noise import FEW
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds.world import build_world

EYES = sim.Eyes(n_eyes=2, resolution=(3, 5), fov_deg=60, placement_range_deg=60)
N = 3 * FEW


@pytest.fixture(scope="module")
def before_and_after():
    """A renderer of N worlds, and two different states of them."""
    world = build_world("detection")
    states = [Simulation(task_of(world), N, seed).reset() for seed in (0, 1)]
    return BatchedRenderer(world, EYES, N, sim.Fidelity(4, EYES.bands)), *states


def noisy_signals(renderer):
    return NoisySignals(renderer, np.arange(N, dtype=np.uint64))


@pytest.mark.parametrize("worlds", [[4], [7, 2, 19], list(range(1, N, 2))], ids=["one", "a few", "many"])
def test_all_and_some_at_once(before_and_after, worlds):
    renderer, old, new = before_and_after
    worlds = np.array(worlds)
    patient, hasty = noisy_signals(renderer), noisy_signals(renderer)
    expected = patient.begin(new).wait(), patient.begin_some(old, worlds).wait()
    every = hasty.begin(new)
    some = hasty.begin_some(old, worlds)
    np.testing.assert_array_equal(every.wait(), expected[0])
    np.testing.assert_array_equal(some.wait(), expected[1])
    assert not np.array_equal(expected[0][worlds], expected[1])


def test_some_see_what_they_see_among_all(before_and_after):
    renderer, state, _ = before_and_after
    worlds = np.array([5, 17])
    among_all = noisy_signals(renderer).begin(state).wait()[worlds]
    np.testing.assert_array_equal(noisy_signals(renderer).begin_some(state, worlds).wait(), among_all)


def test_noise_goes_on_and_begins_anew(before_and_after):
    renderer, state, _ = before_and_after
    eyes = noisy_signals(renderer)
    first, second = eyes.begin(state).wait(), eyes.begin(state).wait()
    spread = (second - first).std()
    assert spread == pytest.approx(np.sqrt(2) * EYES.noise_sigma, rel=0.1)  # of 720 receptors: 3 % to chance
    eyes.restart(np.arange(N, dtype=np.uint64))
    np.testing.assert_array_equal(eyes.begin(state).wait(), first)


def test_looks_begun_one_after_the_other_keep_apart(before_and_after):
    """Both use the renderer's one buffer of poses, and are waited for the other way round."""
    renderer, old, new = before_and_after
    expected = [renderer.signals(state) for state in (old, new)]
    first, second = renderer.begin(old), renderer.begin(new)
    np.testing.assert_array_equal(second.wait(), expected[1])
    np.testing.assert_array_equal(first.wait(), expected[0])
    with pytest.raises(RuntimeError, match="waited for before"):
        first.wait()
