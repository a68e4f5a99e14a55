"""Worlds of user tasks that break down: their episodes end, and the other worlds are not affected."""

import numpy as np
import pytest

import sim
from tests.sim.envs.hunt import Predator, Prey, hunt
from tests.sim.envs.test_task_vec_env import CART, Face


class Unmended(Face):
    """A task in which MuJoCo does not reset the world when it becomes unstable."""

    model = CART.replace('<option timestep=".02"/>', '<option timestep=".02"><flag autoreset="disable"/></option>')


class Nowhere(Face):
    """A task in which an action of 1 sets the ball's position to NaN, which MuJoCo accepts."""

    def act(self, data, action):
        super().act(data, action)
        if action[0] == 1:
            data.mocap_pos[0] = np.nan


class Lost(Face):
    """A task in which an action of 1 gives a NaN control and one of 0.9 a huge control; MuJoCo then ignores all
    motors.
    """

    def act(self, data, action):
        super().act(data, action)
        data.ctrl[0] = {1: np.nan, 0.9: 1e11}.get(round(float(action[0]), 6), data.ctrl[0])


def moved_off(env):
    env.worlds.datas[1].qvel[:] = np.nan


@pytest.mark.parametrize(
    ("task", "break_down", "words"),
    [
        (Face, moved_off, "physics is unstable: positions, speeds"),
        (Unmended, moved_off, "physics is unstable: positions, speeds"),
        (Lost, lambda env: None, "controls are huge or not finite: `act` must write numbers"),
        (Nowhere, lambda env: None, "physics is unstable: positions of bodies are not finite; `act` must write"),
    ],
)
def test_a_world_that_breaks_down_ends_alone_and_for_good(task, break_down, words):
    broken, well = (sim.make_vec_env(task(), n_envs=3, seed=4) for _ in range(2))
    broken.reset()
    well.reset()
    break_down(broken)
    with pytest.warns(UserWarning, match=words):
        found, reward, done, infos = broken.step(np.array([[0.5], [1], [-0.5]]))
    expected, paid, *_ = well.step(np.array([[0.5], [0], [-0.5]]))
    np.testing.assert_array_equal(done, [False, True, False])
    assert infos[1]["failure"].startswith(words)
    assert infos[1]["TimeLimit.truncated"] is False
    assert reward[1] == 0
    assert np.isfinite(infos[1]["terminal_observation"]["eyes"]).all()
    for _ in range(3):
        np.testing.assert_array_equal(found["eyes"][[0, 2]], expected["eyes"][[0, 2]])
        np.testing.assert_array_equal(reward[[0, 2]], paid[[0, 2]])
        assert broken.observation_space["eyes"].contains(found["eyes"][1])
        (found, reward, done, _), (expected, paid, *_) = (env.step(np.full((3, 1), 0.2)) for env in (broken, well))
        assert not done.any()


def test_the_only_world_ends_so_too():
    env = sim.make_env(Nowhere())
    env.reset(seed=1)
    with pytest.warns(UserWarning, match="its episode ends here"):
        observation, _, terminated, truncated, info = env.step(np.array([1.0]))
    assert (terminated, truncated) == (True, False)
    assert "failure" in info
    assert np.isfinite(observation["eyes"]).all()


@pytest.mark.parametrize("worth", [0.0, -50.0])
def test_a_broken_world_is_worth_what_the_task_says(worth):
    """A failed step earns `failure_reward`. If rewards are negative costs, the default of 0 is better than any normal
    step.
    """
    task = Nowhere()
    task.failure_reward = worth
    env = sim.make_vec_env(task, n_envs=2)
    env.reset()
    with pytest.warns(UserWarning, match="its episode ends here"):
        _, reward, done, infos = env.step(np.array([[0.2], [1.0]]))
    assert done.tolist() == [False, True]
    assert reward[1] == worth == sum(infos[1]["reward_terms"].values())
    assert "failure" not in infos[0]["reward_terms"]


def test_huge_controls_end_an_episode_too():
    task = Lost()
    task.model = CART.replace(' ctrlrange="-2 2"', "")  # MuJoCo would clip the control to a range
    env = sim.make_vec_env(task, n_envs=2)
    env.reset()
    with pytest.warns(UserWarning, match="Lost: controls are huge"):
        *_, done, infos = env.step(np.array([[0.9], [0.8]]))
    assert done.tolist() == [True, False]
    assert "failure" not in infos[1]


def lost(encounter):
    """Return the results of a step for both animals when the prey's velocity is NaN."""
    env = sim.make_parallel_env(encounter, seed=1)
    env.reset()
    env._animals.simulation.physics.datas[0].qvel[0] = np.nan
    return env.step({name: np.zeros(2) for name in env.agents})


def test_an_encounter_that_breaks_down_ends_for_all():
    _, _, terminated, truncated, infos = lost(hunt())
    assert terminated == {"Prey": True, "Predator": True}
    assert truncated == {"Prey": False, "Predator": False}
    assert all(info["failure"].startswith("physics is unstable") for info in infos.values())


def test_whose_other_animal_fails_has_no_more_to_come():
    class Clumsy(Predator):
        def act(self, data, action):
            raise ArithmeticError("no leg to stand on")

    env = sim.make_vec_env(sim.Encounter(Prey(), Clumsy()).alone("Prey", {}), n_envs=2)
    env.reset()
    with pytest.warns(UserWarning, match="no leg to stand on"):
        *_, done, infos = env.step(np.zeros((2, 2)))
    assert done.all()
    assert not any(info["TimeLimit.truncated"] for info in infos)
