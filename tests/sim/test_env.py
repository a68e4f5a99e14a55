"""The single environment: Gymnasium's and stable-baselines3's own checkers, and agreement with the batch."""

import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from stable_baselines3.common.env_checker import check_env as sb3_check

import sim
from sim.picture import _follow
from sim.registration import IDS

EYES = sim.Eyes(n_eyes=2, resolution=(3, 4), fov_deg=60)


@pytest.mark.parametrize("id_", IDS)
def test_checkers_are_content(id_):
    """Two warnings are known: a receptor's Gaussian noise has no bound, and an observation of many eyes and frames
    is neither an image nor a vector."""
    env = gymnasium.make(id_, eyes=EYES, rays_per_receptor=1, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*(infinity|-inf).*")
        warnings.filterwarnings("ignore", message=".*unconventional shape.*")
        gymnasium_check(env.unwrapped, skip_render_check=True)
        sb3_check(env.unwrapped, skip_render_check=True)
    env.close()


def test_ids_are_known_after_importing_sim():
    code = "import gymnasium, sim; print([i for i in gymnasium.registry if i.startswith('rhabdom/')])"
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert child.stdout.strip() == str(list(IDS))


def test_it_is_world_0_of_the_batch():
    env = sim.make_env("detection", EYES, memory=2)
    venv = sim.make_vec_env("detection", EYES, 3, seed=5, memory=2)
    (one, _), many = env.reset(seed=5), venv.reset()
    rng = np.random.default_rng(0)
    for _ in range(10):
        np.testing.assert_array_equal(one["eyes"], many["eyes"][0])
        action = rng.uniform(-1, 1, 2)
        one, reward, terminated, truncated, info = env.step(action)
        many, rewards, _, infos = venv.step(np.tile(action, (3, 1)))
        assert reward == pytest.approx(rewards[0], abs=1e-6)
        assert info["position"] == infos[0]["position"]
        assert not terminated
        assert not truncated


def test_picture_follows_the_agent():
    env = sim.make_env("detection", EYES, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    assert first.shape == (360, 480, 3)
    assert first.dtype == np.uint8
    env.step(np.array([-1.0, 1.0]))  # turns on the spot: the body stays, the world turns
    second = env.render()
    state, mirror = env.state, env._onlooker._mirror
    ids = mirror.render_ids(_follow(state, 0), 480, 360)
    y, x = np.nonzero(ids == mirror.model.geom("agent").id)
    assert len(y) > 50
    assert abs(x.mean() - 239.5) < 1
    assert (np.abs(first.astype(int) - second) > 30).mean() > 0.05


def test_unknown_render_mode_is_named():
    with pytest.raises(ValueError, match="render_mode"):
        sim.make_env("detection", EYES, render_mode="human")
