"""Gymnasium's own face of the batched environment."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import sim
from sim.envs.vector_env import EyesVectorEnv
from tests.sim.envs.test_task_vec_env import Face

EYES = sim.Eyes(resolution=(2, 3), bands=2)
OPTIONS = {"eyes": EYES, "rays_per_receptor": 1}


def test_all_worlds_are_one_kernel_that_sees_what_stable_baselines_does():
    env = gymnasium.make_vec("rhabdom/Detection-v0", num_envs=3, **OPTIONS)
    assert isinstance(env.unwrapped, EyesVectorEnv)
    assert env.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    other = sim.make_vec_env("detection", n_envs=3, seed=5, **OPTIONS)
    observation, info = env.reset(seed=5)
    expected = other.reset()
    assert info["is_success"].shape == (3,)
    rng = np.random.default_rng(0)
    for _ in range(3):
        for name, array in expected.items():
            np.testing.assert_array_equal(observation[name], array)
        actions = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(actions)
        expected, paid, _, infos = other.step(actions)
        np.testing.assert_array_equal(reward, paid)
        assert not (terminated | truncated).any()
        np.testing.assert_allclose(
            info["reward_terms"]["progress"], [one["reward_terms"]["progress"] for one in infos], rtol=1e-12
        )
    assert env.observation_space.contains(observation)


def test_worlds_start_anew_in_the_step_that_ends_them():
    env = EyesVectorEnv(2, task=Face())
    env.reset(seed=0)
    for k in range(Face.episode_steps):
        observation, _, terminated, truncated, info = env.step(np.zeros((2, 1), np.float32))
        assert truncated.all() == (k == Face.episode_steps - 1)
    assert not terminated.any()
    assert np.abs(info["final_obs"][0]["eyes"] - observation["eyes"][0]).max() > 0.05
    assert env.single_observation_space.contains(info["final_obs"][1])


@pytest.mark.parametrize("steps", [3, 300])
def test_episodes_last_as_long_as_gymnasium_is_told(steps):
    """Shorter than the task's 256 actions, and longer; in one world, `episode_steps` says so."""
    env = gymnasium.make_vec("rhabdom/Detection-v0", num_envs=2, max_episode_steps=steps, mode="evaluation", **OPTIONS)
    env.reset(seed=0)
    ended = [env.step(np.tile(np.float32([-1, 0]), (2, 1)))[3].all() for _ in range(steps)]
    assert ended == [False] * (steps - 1) + [True]
    one = gymnasium.make("rhabdom/Detection-v0", episode_steps=steps, mode="evaluation", **OPTIONS)
    one.reset(seed=0)
    ended = [one.step(np.float32([-1, 0]))[3] for _ in range(steps)]
    assert ended == [False] * (steps - 1) + [True]


def test_pictures_of_all_worlds():
    env = gymnasium.make_vec("rhabdom/Detection-v0", num_envs=2, render_mode="eyes", **OPTIONS)
    env.reset()
    first, second = env.render()
    assert first.shape == second.shape
    env.close()


def test_what_is_not_done_is_refused():
    env = EyesVectorEnv(2, task=Face())
    with pytest.raises(ValueError, match=r"reset: options = .*: must be left out"):
        env.reset(options={"light": 2})
    with pytest.raises(ValueError, match="reset: seed: must be one number"):
        env.reset(seed=[1, 2])
    with pytest.raises(ValueError, match=r"reset: options = .*: must be left out"):
        sim.make_env(Face()).reset(options={"light": 2})


def test_gymnasium_finds_it_by_the_name_of_the_module():
    code = (
        "import gymnasium; print(type(gymnasium.make_vec('sim:rhabdom/Navigation-v0', rays_per_receptor=1).unwrapped))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "EyesVectorEnv" in found.stdout
