"""Gymnasium's interface to the batched environment."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import sim
from sim.envs.vector_env import EyesVectorEnv
from tests.sim.envs.hunt import hunt
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


class Leaving(Face):
    """A task that ends when the cart has left the middle, and differs from episode to episode."""

    episode_steps, vary = 6, {"light": (0.5, 2.0)}

    def terminated(self, data):
        return data.qpos[0] > 0.1


def form(info):
    """Return the keys and masks of an info, and the types and shapes of its arrays."""
    return {
        key: form(value)
        if isinstance(value, dict)
        else value.tolist()
        if key[0] == "_"
        else (value.dtype.kind, value.shape)
        for key, value in info.items()
    }


def of_first_world(info):
    """Return the info of the first world without its observations. A key is included only if its mask is set."""
    return {
        key: of_first_world(value) if isinstance(value, dict) else value[0]
        for key, value in info.items()
        if key[0] != "_" and key != "final_obs" and info[f"_{key}"][0]
    }


@pytest.mark.parametrize(
    ("task", "options", "actions"),
    [
        (Leaving(), {}, [[1], [-1]]),
        (Leaving(), {}, [[-1], [1]]),
        ("detection", {"vary": {"light": (0.1, 1.0)}, "episode_steps": 3, **OPTIONS}, [[0.5, 0.1], [1, 0]]),
    ],
)
def test_what_is_said_of_ended_episodes_is_where_gymnasium_has_it(task, options, actions):
    """World 0 is the same in both environments."""
    env = EyesVectorEnv(2, task=task, **options)
    single = SyncVectorEnv([lambda: sim.make_env(task, **options)] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
    assert form(env.reset(seed=3)[1]) == form(single.reset(seed=3)[1])
    ends = 0
    for _ in range(7):
        *here, info = env.step(np.array(actions, np.float32))
        *there, expected = single.step(np.array(actions, np.float32))
        assert form(info) == form(expected)
        assert of_first_world(info) == of_first_world(expected)
        np.testing.assert_array_equal(here[0]["eyes"][0], there[0]["eyes"][0])
        assert [array[0] for array in here[2:]] == [array[0] for array in there[2:]]
        ends += "final_info" in info
    assert ends > 1


@pytest.mark.parametrize("steps", [3, 300])
def test_episodes_last_as_long_as_gymnasium_is_told(steps):
    """`max_episode_steps` sets the length of an episode, below and above the task's 256 actions."""
    how = {"max_episode_steps": steps, "mode": "evaluation", **OPTIONS}
    assert lengths("rhabdom/Detection-v0", [-1, 0], 301, **how) == [steps, steps]


def lengths(id_, action, most, **how):
    """Return the number of actions in the first episode of a single world and of a batch of two, up to `most`; None if
    it is longer.
    """
    one, two = gymnasium.make(id_, **how), gymnasium.make_vec(id_, num_envs=2, **how)
    one.reset(seed=0)
    two.reset(seed=0)
    acts = ((one, np.float32(action)), (two, np.tile(np.float32(action), (2, 1))))
    return [next((k + 1 for k in range(most) if np.all(env.step(taken)[3])), None) for env, taken in acts]


@pytest.mark.parametrize(
    ("how", "steps"), [({}, 256), ({"max_episode_steps": -1}, None)], ids=["as the task has it", "without end"]
)
def test_who_says_no_length_gets_the_tasks(how, steps):
    assert lengths("rhabdom/Detection-v0", [-1, 0], 260, mode="evaluation", **how, **OPTIONS) == [steps, steps]
    assert gymnasium.spec("rhabdom/Detection-v0").max_episode_steps == 256


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("told", "steps"), [(None, 128), (90, 90), (300, 128)])
def test_a_course_keeps_its_own_length(told, steps):
    how = {} if told is None else {"max_episode_steps": told}
    assert lengths("rhabdom/Navigation-v0", [-1, 0], 130, course="long", **how, **OPTIONS) == [steps, steps]


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("task", [Face, Face()], ids=["class", "task"])
@pytest.mark.parametrize(("told", "steps"), [(None, 40), (3, 3), (50, 50)])
def test_tasks_of_ones_own_have_ids_too(task, told, steps):
    sim.register_task("Face-v0", task, memory=2)
    how = {} if told is None else {"max_episode_steps": told}
    assert lengths("Face-v0", [0], 60, **how) == [steps, steps]
    assert gymnasium.make("Face-v0").observation_space["eyes"].shape[0] == 2
    batch = sim.make_vec_env(Face(), n_envs=1, episode_steps=steps)
    batch.reset()
    assert [bool(batch.step(np.zeros((1, 1)))[2][0]) for _ in range(steps)] == [False] * (steps - 1) + [True]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: gymnasium.make("rhabdom/Maze-v0", episode_steps=9), "episode_steps = 9: must be left out if Gymn"),
        (lambda: gymnasium.make_vec("rhabdom/Maze-v0", episode_steps=9), "episode_steps = 9: must be left out if"),
        (lambda: gymnasium.make_vec("rhabdom/Maze-v0", max_episode_steps=0), "max_episode_steps = 0: must be a whole"),
        (lambda: sim.make_vec_env(Face(), episode_steps=0), "episode_steps = 0: must be a whole number"),
        (lambda: sim.register_task("Face-v0", "detection"), "task = 'detection': must be a sim.Task, or its class"),
    ],
)
def test_bad_lengths_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_several_animals_of_a_world_are_no_vector_of_worlds():
    with pytest.raises(ValueError, match=r"several animals learn in a sim\.Encounter: pass the result of `alone`"):
        EyesVectorEnv(4, task=hunt())


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
    with pytest.raises(ValueError, match=r"reset: options = .*: must be left out"):
        sim.make_env(Face()).reset(options={"light": 2})


@pytest.mark.slow
def test_gymnasium_finds_it_by_the_name_of_the_module():
    code = (
        "import gymnasium; print(type(gymnasium.make_vec('sim:rhabdom/Navigation-v0', rays_per_receptor=1).unwrapped))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "RegisteredVectorEnv" in found.stdout


@pytest.mark.parametrize(
    ("task", "options"),
    [
        (Leaving(), {"memory": 2}),
        ("tracking", {"vary": {"light": (0.1, 1.0)}, "episode_steps": 3, **OPTIONS}),
        ("maze", {"mazes": 3, "episode_steps": 3, **OPTIONS}),
    ],
)
def test_a_list_of_seeds_gives_every_world_the_episodes_of_its_seed(task, options):
    """Gymnasium's own vector of single environments is the reference: equal to the last bit, also after a restart."""
    rng = np.random.default_rng()
    seeds = rng.integers(10**6, size=3).tolist()
    seeds[2] = seeds[0]
    env = EyesVectorEnv(3, task=task, **options)
    single = SyncVectorEnv([lambda: sim.make_env(task, **options)] * 3, autoreset_mode=AutoresetMode.SAME_STEP)
    for given in (seeds, seeds[::-1]):
        here, there = env.reset(seed=given)[0], single.reset(seed=given)[0]
        ends = 0
        for _ in range(7):
            for name, array in there.items():
                np.testing.assert_array_equal(here[name], array, f"{name}, seeds {given}")
            actions = np.tile(rng.uniform(-1, 1, env.single_action_space.shape).astype(np.float32), (3, 1))
            here, reward, *ended, _ = env.step(actions)
            there, expected, *endings, _ = single.step(actions)
            np.testing.assert_allclose(reward, expected, rtol=1e-6)  # float32 here
            np.testing.assert_array_equal(ended, endings)
            ends += np.any(ended)
        assert ends
        np.testing.assert_array_equal(here["eyes"][0], here["eyes"][2])  # equal seeds
        assert not np.array_equal(here["eyes"][0], here["eyes"][1])


def test_none_continues_a_worlds_own_random_numbers():
    def starts(*resets):
        env = EyesVectorEnv(2, task="detection", **OPTIONS)
        return [env.reset(seed=seed)[0]["eyes"] for seed in resets]

    first, second = starts([3, 4], [5, None])
    again = starts([3, 4], [5, None])
    np.testing.assert_array_equal(second, again[1])  # the same history gives the same episodes
    assert not np.array_equal(first[1], second[1])
    np.testing.assert_array_equal(second[0], starts([5, 6])[0][0])
    other = starts([3, 8], [5, None])
    np.testing.assert_array_equal(second[0], other[1][0])
    assert not np.array_equal(second[1], other[1][1])


@pytest.mark.parametrize(
    ("seed", "says"),
    [
        ([1], r"seed has 1 numbers: must have one for each of 2 worlds"),
        ([1, -1], r"seed\[1\] = -1: must be a whole number, at least 0, or None"),
        ([1, 2.5], r"seed\[1\] = 2.5: must be"),
        ([True, 2], r"seed\[0\] = True: must be"),
    ],
)
def test_bad_lists_of_seeds_are_refused(seed, says):
    env = EyesVectorEnv(2, task=Face())
    with pytest.raises(ValueError, match=says):
        env.reset(seed=seed)
