"""PettingZoo's own tests, and tests of behaviour that they do not cover."""

import sys
import warnings
from unittest import mock

import numpy as np
import pytest

import sim
from tests.sim.envs.hunt import Predator, Prey, hunt


@pytest.fixture
def env():
    return sim.make_parallel_env(hunt(), seed=1)


def test_pettingzoo_is_content():
    from pettingzoo.test import parallel_api_test, parallel_seed_test

    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        parallel_api_test(sim.make_parallel_env(hunt(), memory=2), num_cycles=20)
        parallel_seed_test(lambda: sim.make_parallel_env(hunt(), seed=None), num_cycles=10)


def test_everybody_acts_and_sees_with_its_own_eyes(env):
    observations, infos = env.reset(seed=3)
    assert env.agents == env.possible_agents == ["Prey", "Predator"]
    assert observations["Prey"]["eyes"].shape == (1, 3, 3, 2, 8)
    assert observations["Predator"]["eyes"].shape == (1, 2, 3, 1, 12)
    assert infos["Prey"] == {"reward_terms": {}, "is_success": False}
    before = env._animals.simulation.physics.datas[0].qpos.copy()
    observations, rewards, *_ = env.step({"Predator": np.array([0, 1]), "Prey": np.array([1, 0])})
    moved = env._animals.simulation.physics.datas[0].qpos - before
    assert moved[[0, 3]].min() > 0.04
    assert np.abs(moved[[1, 2]]).max() < 1e-6
    np.testing.assert_array_equal(observations["Predator"]["previous_action"], [0, 1])
    assert rewards["Prey"] == -rewards["Predator"] > 0
    assert all(env.observation_space(name).contains(observations[name]) for name in env.agents)


def test_everybody_is_told_how_the_world_differs():
    class Dusk(Prey):
        name, vary = "Prey", {"light": (0.1, 10)}

    env = sim.make_parallel_env(sim.Encounter(Dusk(), Predator()), seed=1)
    *_, infos = env.reset()
    *_, later = env.step({name: np.zeros(2) for name in env.agents})
    level = env._animals.simulation.varied["light"][0]
    assert all(info["varied"] == {"light": level} for info in (*infos.values(), *later.values()))


def test_it_is_the_world_that_one_of_them_learns_in(env):
    """The learner has the same observations, bit for bit, as in the environment for one learner with the same seed and
    actions.
    """
    env.reset(seed=5)
    alone = sim.make_vec_env(hunt().alone("Prey", {"Predator": lambda seen: np.array([[0.3, -0.4]])}), n_envs=1, seed=5)
    alone.reset()
    for _ in range(4):
        here = env.step({"Prey": np.array([0.5, 0.1]), "Predator": np.array([0.3, -0.4])})
        there = alone.step(np.array([[0.5, 0.1]]))
        np.testing.assert_array_equal(here[0]["Prey"]["eyes"], there[0]["eyes"][0])
        assert here[1]["Prey"] == pytest.approx(there[1][0])


def test_an_episode_ends_for_all():
    class Brave(Prey):
        name = "Prey"

        def terminated(self, data):
            return False

    env = sim.make_parallel_env(sim.Encounter(Brave(), Predator()), seed=1)
    env.reset()
    while env.agents:
        data = env._animals.simulation.physics.datas[0]
        towards = np.sign(data.qpos[:2] - data.qpos[2:])
        _, _, terminated, truncated, infos = env.step({"Prey": np.zeros(2), "Predator": towards})
    assert terminated == {"Prey": False, "Predator": True}
    assert truncated == {"Prey": True, "Predator": False}
    assert infos["Predator"]["is_success"]
    assert env.step({}) == ({}, {}, {}, {}, {})
    env.reset()
    assert env.agents == ["Prey", "Predator"]


def test_pictures():
    env = sim.make_parallel_env(hunt(), render_mode="rgb_array")
    env.reset()
    assert env.render().shape == (360, 480, 3)
    eyes = sim.make_parallel_env(hunt(), render_mode="eyes")
    eyes.reset()
    assert len(eyes.render()) == 2
    assert sim.make_parallel_env(hunt()).render() is None


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        ({"Prey": np.zeros(2)}, "actions: 'Predator' has none: must have one for each of Prey, Predator"),
        ({"Prey": np.zeros(2), "Predater": np.zeros(2)}, "actions: no animal 'Predater'; did you mean 'Predator'"),
        ({"Prey": np.zeros(2), "Predator": np.zeros(3)}, r"action of 'Predator' has shape \(3,\): must be \(2,\)"),
    ],
)
def test_bad_actions_are_refused(env, actions, words):
    with pytest.raises(RuntimeError, match="the worlds have not begun: call reset first"):
        env.step(actions)
    env.reset()
    with pytest.raises(ValueError, match=words):
        env.step(actions)


def test_without_pettingzoo_one_line_says_what_to_install():
    with (
        mock.patch.dict(sys.modules, {"pettingzoo": None}),
        pytest.raises(ImportError, match=r"^make_parallel_env needs PettingZoo: pip install 'rhabdom\[pettingzoo\]'$"),
    ):
        sim.make_parallel_env(hunt())
