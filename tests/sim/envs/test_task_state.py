"""Restored worlds have the same future, bit for bit, and the other worlds are not affected."""

import pickle

import numpy as np
import pytest

import sim
from tests.sim.envs.test_task_vec_env import Face


class Pushed(Face):
    """A task with randomness, contacts and a solver: a second body, placed at random, leans on the cart."""

    model = Face.model.replace(
        '<body name="ball"',
        '<body pos="0 .5 .35"><freejoint/><geom type="box" size=".1 .1 .1" mass=".1"/></body><body name="ball"',
    )
    episode_steps = 12

    def reset(self, data, rng):
        super().reset(data, rng)
        data.qpos[2] = rng.uniform(0.3, 0.5)

    def proprioception(self, data):
        return data.qvel[:2]


@pytest.fixture(scope="module")
def env():
    env = sim.make_vec_env(Pushed(), n_envs=4, seed=3, memory=3)
    env.reset()
    return env


def played(env, steps, seed):
    """Return observations, rewards and ends under fixed actions. Some episodes end on the way."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(steps):
        observation, reward, done, infos = env.step(random.uniform(-1, 1, (env.num_envs, 1)))
        found.append((*observation.values(), reward, done, [info.get("episode", {}).get("r") for info in infos]))
    return found


def same(one, other, worlds=slice(None)):
    return all(
        np.array_equal(np.asarray(a)[worlds], np.asarray(b)[worlds], equal_nan=False) if np.asarray(a).dtype != object
        else list(np.asarray(a)[worlds]) == list(np.asarray(b)[worlds])
        for first, second in zip(one, other, strict=True) for a, b in zip(first, second, strict=True)
    )  # fmt: skip


def test_the_same_future_twice(env):
    played(env, 7, 1)
    state = env.get_state()
    first = played(env, 15, 2)
    seen = env.set_state(state)
    assert np.array_equal(seen["eyes"], state["remembered"])
    assert same(first, played(env, 15, 2))
    assert not same(first, played(env, 15, 2)), "time has advanced, so the future differs"


def test_from_disk_in_another_environment(env):
    state = pickle.loads(pickle.dumps(env.get_state()))
    future = played(env, 15, 4)
    other = sim.make_vec_env(Pushed(), n_envs=4, seed=99, memory=3)
    other.reset()
    other.set_state(state)
    assert same(future, played(other, 15, 4))


def test_some_go_back_and_the_others_go_on(env):
    state = env.get_state()
    first = played(env, 15, 5)
    env.set_state(state, worlds=[1, 3])
    second = played(env, 15, 5)
    assert same(first, second, [1, 3])
    assert not same(first, second, [0])


def test_every_entry_counts(env):
    """A state in which one entry comes from an earlier time leads to another future: every entry matters."""
    played(env, 3, 6)
    early = env.get_state()
    played(env, Pushed.episode_steps + 1, 7)  # every world restarts at a random state
    state = env.get_state()
    first = played(env, 15, 8)
    for name in set(state) - {"felt", "action"}:
        env.set_state({**state, name: early[name]})
        assert not same(first, played(env, 15, 8)), name
    seen = env.set_state({**state, "felt": early["felt"], "action": early["action"]})
    assert np.array_equal(seen["feels"], early["felt"])
    assert np.array_equal(seen["previous_action"], early["action"])


class Told(Pushed):
    auxiliary = ("depth", "ids", "flow")


@pytest.mark.parametrize("memory", [1, 2])
def test_what_a_caller_does_to_its_observations_changes_nothing_else(memory):
    touched, left = (sim.make_vec_env(Told(), n_envs=2, seed=3, memory=memory, render_mode="eyes") for _ in range(2))
    for moment in (lambda env: env.reset(), lambda env: env.step(np.full((2, 1), 0.5))[0]):
        observation, expected = moment(touched), moment(left)
        for array in observation.values():
            array -= 5
        np.testing.assert_array_equal(touched.get_images(), left.get_images())
        state = touched.get_state()
        for name, array in left.get_state().items():
            np.testing.assert_array_equal(state[name], array, err_msg=name)
        seen = touched.set_state(state)
        for name, array in expected.items():
            np.testing.assert_array_equal(seen[name], array, err_msg=name)
            seen[name] -= 5
    assert same(played(touched, 3, 1), played(left, 3, 1))


@pytest.mark.parametrize(
    ("change", "worlds", "words"),
    [
        (lambda state: {}, None, "must be the return value of get_state, with the entries physics, chance"),
        (lambda state: {**state, "steps": np.zeros(3, int)}, None, r"steps has shape \(3,\): must be \(4,\)"),
        (lambda state: state, [4], "must be numbers of worlds, from 0 to 3"),
        (lambda state: state, [0.5], "must be numbers of worlds"),
    ],
)
def test_what_is_no_state_is_refused(env, change, worlds, words):
    with pytest.raises(ValueError, match=words):
        env.set_state(change(env.get_state()), worlds)


def test_before_the_first_reset_there_is_none():
    with pytest.raises(RuntimeError, match="call reset first"):
        sim.make_vec_env(Face(), n_envs=1).get_state()


def test_who_sleeps_is_in_no_state():
    task = Pushed()
    task.model = Pushed.model.replace('<option timestep=".02"/>', '<option><flag sleep="enable"/></option>')
    sleepy = sim.make_vec_env(task, n_envs=1)
    sleepy.reset()
    for ask in (sleepy.get_state, lambda: sleepy.set_state({})):
        with pytest.raises(RuntimeError, match="get_state: the model enables <flag sleep>, which no state contains"):
            ask()


def test_environments_are_not_pickled(env):
    with pytest.raises(TypeError, match="EyesVecEnv cannot be pickled or copied, since it contains compiled kernels"):
        pickle.dumps(env)
    with pytest.raises(TypeError, match="EyesVecEnv cannot be pickled"):
        pickle.dumps(sim.make_vec_env("detection", sim.Eyes(n_eyes=1, resolution=(1, 1)), n_envs=1))
