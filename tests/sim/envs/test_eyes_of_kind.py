"""Frames that are launched early and awaited late equal frames that are computed one after the other."""

import numpy as np
import pytest

import sim
from sim.envs.eyes_of_kind import EyesOfKind
from sim.render.receptor_noise import FEW

EYES = sim.Eyes(n_eyes=2, resolution=(3, 5), fov_deg=60, placement_range_deg=60)
N = 3 * FEW
KEYS = np.arange(N, dtype=np.uint64)


@pytest.fixture(scope="module")
def before_and_after():
    """Return an environment of N worlds and two different snapshots of them."""
    env = sim.make_vec_env("detection", EYES, N, fidelity=sim.Fidelity(4, EYES.bands))
    poses = []
    for seed in (0, 1):
        env.seed(seed)
        env.reset()
        poses.append(env.simulation.poses())
    return env, *poses


def eyes_of(env):
    return EyesOfKind(env.simulation, env.renderer, KEYS, memory=1)


@pytest.mark.parametrize("worlds", [[4], [7, 2, 19], list(range(1, N, 2))], ids=["one", "a few", "many"])
def test_all_and_some_at_once(before_and_after, worlds):
    env, old, new = before_and_after
    worlds = np.array(worlds)
    patient, hasty = eyes_of(env), eyes_of(env)
    expected = patient.launch(new).wait(), patient.launch(old, worlds).wait()
    every = hasty.launch(new)
    some = hasty.launch(old, worlds)
    np.testing.assert_array_equal(every.wait(), expected[0])
    np.testing.assert_array_equal(some.wait(), expected[1])
    assert not np.array_equal(expected[0][worlds], expected[1])


def test_some_see_what_they_see_among_all(before_and_after):
    env, state, _ = before_and_after
    worlds = np.array([5, 17])
    among_all = eyes_of(env).launch(state).wait()[worlds]
    np.testing.assert_array_equal(eyes_of(env).launch(state, worlds).wait(), among_all)


def test_noise_goes_on_and_begins_anew(before_and_after):
    env, state, _ = before_and_after
    eyes = eyes_of(env)
    first, second = eyes.launch(state).wait(), eyes.launch(state).wait()
    spread = (second - first).std()
    assert spread == pytest.approx(np.sqrt(2) * EYES.noise_sigma, rel=0.1)  # 720 receptors estimate it to 3 %
    eyes.restart(KEYS)
    np.testing.assert_array_equal(eyes.launch(state).wait(), first)


def test_looks_begun_one_after_the_other_keep_apart(before_and_after):
    """Both frames use the renderer's single buffer of poses, and are awaited in reverse order."""
    env, old, new = before_and_after
    expected = [env.renderer.launch(state).wait() for state in (old, new)]
    first, second = env.renderer.launch(old), env.renderer.launch(new)
    np.testing.assert_array_equal(second.wait(), expected[1])
    np.testing.assert_array_equal(first.wait(), expected[0])
    with pytest.raises(RuntimeError, match="waited for before"):
        first.wait()
