"""The contract of the VecEnv: seeds, up-to-date observations, endings, memory and noise; and learners that use it."""

import dataclasses

import numpy as np
import pytest

import optics
import sim
from sim.envs.observation import Memory
from sim.physics.sliding_agents import MAX_TURN
from sim.render.receptor_noise import FEW
from sim.worlds.catalog import EPISODE_STEPS

EYES = sim.Eyes(n_eyes=2, resolution=(4, 5), fov_deg=60, noise_sigma=0.05)
QUIET = dataclasses.replace(EYES, noise_sigma=0.0)


def make(n_envs, *, seed=0, eyes=EYES, task="detection", **options):
    return sim.make_vec_env(task, eyes, n_envs, seed, rays_per_receptor=2, **options)


def actions(n, step):
    """Return actions that depend only on world and step."""
    return np.stack([np.random.default_rng([i, step]).uniform(-1, 1, 2) for i in range(n)])


def seeking(venv, step):
    """Return actions that bring every agent to one of its objects sooner or later, so that episodes end."""
    random, state = actions(venv.num_envs, step), venv.state
    if not state.objects.shape[1]:
        return random
    towards = state.objects[np.arange(state.n), np.arange(state.n) % 3, :2] - state.position
    error = np.arctan2(towards[:, 1], towards[:, 0]) - state.heading
    turn = (error + np.pi) % (2 * np.pi) - np.pi
    return np.stack([random[:, 0], np.clip(turn / MAX_TURN, -1, 1)], axis=-1)


def played(venv, steps):
    """Return the first observation and a list of (observation, reward, done, info) for each step."""
    first = venv.reset()
    return first, [venv.step(seeking(venv, step)) for step in range(steps)]


BEES = dataclasses.replace(EYES, receptors=optics.receptors_of("honeybee").arranged(((0, 1), (1, 2))), bands=6)
LENS = dataclasses.replace(EYES, optics=optics.Pupil(aperture_radius=40e-6, thin_lens_focal_length=170e-6))


@pytest.mark.parametrize(
    ("task", "eyes"),
    [
        ("detection", EYES),
        ("foraging", BEES),
        ("tracking", EYES),
        ("maze", EYES),
        ("navigation", EYES),
        ("detection", LENS),
    ],
)
def test_episodes_do_not_depend_on_the_number_of_worlds(task, eyes):
    """Episodes are bit-identical across restarts, noise and moving objects."""
    few, many = (played(make(n, task=task, eyes=eyes, memory=2), 50) for n in (2, 19))
    ends = 0
    for name in few[0]:
        np.testing.assert_array_equal(few[0][name], many[0][name][:2])
    for a, b in zip(few[1], many[1], strict=True):
        for name in a[0]:
            np.testing.assert_array_equal(a[0][name], b[0][name][:2])
        np.testing.assert_array_equal(a[1], b[1][:2])
        np.testing.assert_array_equal(a[2], b[2][:2])
        for world in np.flatnonzero(a[2]):
            ends += 1
            for name, array in a[3][world]["terminal_observation"].items():
                np.testing.assert_array_equal(array, b[3][world]["terminal_observation"][name])
    assert ends or task in ("maze", "navigation")


def test_seed_repeats_and_another_seed_differs():
    venv = make(3)
    first = venv.reset()["eyes"]
    assert not np.array_equal(venv.reset()["eyes"], first)
    venv.seed(0)
    np.testing.assert_array_equal(venv.reset()["eyes"], first)
    venv.seed(1)
    assert not np.array_equal(venv.reset()["eyes"], first)


def test_observations_are_those_of_the_state_they_come_with():
    """Observations match the state after a reset, after a step and after an ending, without a delay of one frame."""
    venv = make(6, eyes=QUIET)
    observation = venv.reset()
    ends = 0
    for step in range(60):
        np.testing.assert_array_equal(observation["eyes"][:, -1], venv.renderer.signals(venv.state))
        observation, _, done, _ = venv.step(seeking(venv, step))
        assert (venv.state.steps[done] == 0).all()
        ends += done.sum()
    assert ends


def test_terminal_observation_shows_the_final_state(monkeypatch):
    """A few endings at once (small renderer) and many (whole renderer) give the same signals."""
    venv = make(FEW + 2, eyes=QUIET, memory=3)
    # a separate renderer, because the environment's own is busy at this point
    whole = venv.renderer.resized(venv.num_envs)
    seen = {}
    judge = venv.simulation.judge

    def watched(moved):
        result = judge(moved)
        seen["signals"], seen["done"] = whole.signals(result.state), result.done
        return result

    monkeypatch.setattr(venv.simulation, "judge", watched)
    before = venv.reset()["eyes"]
    ends = 0
    for i in range(60):
        after, _, done, infos = venv.step(seeking(venv, i))
        for world in np.flatnonzero(done):
            terminal = infos[world]["terminal_observation"]["eyes"]
            np.testing.assert_array_equal(terminal[-1], seen["signals"][world])
            np.testing.assert_array_equal(terminal[:-1], before[world, 1:])
            ends += 1
        before = after["eyes"]
    assert ends


@pytest.mark.parametrize("mode", ["training", "evaluation"])
def test_eyes_see_worlds_as_they_are_after_fresh_starts_and_respawns(mode):
    """Most of an observation is launched before rewards are computed. Changes made by the rewards must still be visible
    in it.
    """
    venv = make(FEW + 2, eyes=QUIET, mode=mode)
    whole = venv.renderer.resized(venv.num_envs)
    venv.reset()
    changes = 0
    for i in range(60):
        objects = venv.state.objects.copy()
        seen = venv.step(seeking(venv, i))[0]["eyes"][:, -1]
        np.testing.assert_array_equal(seen, whole.signals(venv.state))
        changes += int((objects != venv.state.objects).any(axis=(1, 2)).sum())
    assert changes


def test_memory_holds_newest_last_and_starts_with_the_first_frame():
    memory = Memory(3)
    fresh, going = np.array([0, 1]), np.array([], int)

    def frame(value):
        return np.full((2, 1), value, np.float32)

    assert memory.remember(frame(1), fresh)[:, :, 0].tolist() == [[1, 1, 1]] * 2
    assert memory.remember(frame(2), going)[:, :, 0].tolist() == [[1, 1, 2]] * 2
    kept = memory.remember(frame(3), np.array([1]))
    assert kept[:, :, 0].tolist() == [[1, 2, 3], [3, 3, 3]]
    assert memory.preview(frame(9)[:1], np.array([0]))[:, :, 0].tolist() == [[2, 3, 9]]
    memory.remember(frame(4), fresh)
    assert kept[:, :, 0].tolist() == [[1, 2, 3], [3, 3, 3]]


def test_noise_has_its_sigma_and_is_white():
    loud, quiet = make(64, eyes=dataclasses.replace(EYES, noise_sigma=0.2)), make(64, eyes=QUIET)
    noise = (loud.reset()["eyes"] - quiet.reset()["eyes"])[:, 0]
    n = noise.size  # 7680: the sample's sigma has a relative error of 1/sqrt(2 n) = 0.8 %
    assert noise.std() == pytest.approx(0.2, rel=4 / np.sqrt(2 * n))
    assert abs(noise.mean()) < 4 * 0.2 / np.sqrt(n)
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 4 / np.sqrt(noise[0].size)


def test_time_limit_is_truncation_with_episode_statistics():
    venv = make(2, task="navigation")
    venv.reset()
    total = np.zeros(2)
    stay = np.tile([-1.0, 0.3], (2, 1))
    for step in range(EPISODE_STEPS):
        _, reward, done, infos = venv.step(stay)
        total += reward
        assert done.all() == (step == EPISODE_STEPS - 1)
    assert all(info["TimeLimit.truncated"] for info in infos)
    assert [info["episode"]["l"] for info in infos] == [EPISODE_STEPS] * 2
    np.testing.assert_allclose([info["episode"]["r"] for info in infos], total, rtol=1e-5)
    np.testing.assert_array_equal(infos[0]["terminal_observation"]["previous_action"], np.float32([-1.0, 0.3]))


def test_info_names_every_reward_term():
    venv = make(3)
    venv.reset()
    for step in range(5):
        _, reward, _, infos = venv.step(actions(3, step))
        for r, info in zip(reward, infos, strict=True):
            assert set(info["reward_terms"]) == {"progress", "goal", "adversary", "contact"}
            assert sum(info["reward_terms"].values()) == pytest.approx(r, abs=1e-6)
            assert {"is_success", "position", "heading"} <= info.keys()


def test_a_broken_world_restarts_and_says_why():
    venv = make(3)
    venv.reset()
    state = venv.state
    velocity = state.velocity.copy()
    velocity[1] = np.nan
    venv.simulation.state = dataclasses.replace(state, velocity=velocity)
    observation, reward, done, infos = venv.step(actions(3, 0))
    assert done.tolist() == [False, True, False]
    assert infos[1]["failure"] == "unstable physics"
    assert "failure" not in infos[0]
    assert np.isfinite(reward).all()
    assert np.isfinite(observation["eyes"]).all()
    assert np.isfinite(infos[1]["terminal_observation"]["eyes"]).all()


@pytest.mark.parametrize("broken", ["heading", "position", "objects"])
def test_worlds_that_hold_nan_end_and_the_others_go_on_as_if_alone(broken):
    """The observations and rewards of the other worlds are the same bit for bit as without the broken world."""
    venvs = [make(3, memory=2) for _ in range(2)]
    for venv in venvs:
        venv.reset()
    damaged = getattr(venvs[0].state, broken).copy()
    damaged[1] = np.nan
    venvs[0].simulation.state = dataclasses.replace(venvs[0].state, **{broken: damaged})
    (ours, reward, done, infos), (theirs, other, _, _) = (venv.step(actions(3, 0)) for venv in venvs)
    assert done.tolist() == [False, True, False]
    assert infos[1]["failure"] == "unstable physics"
    for world in (0, 2):
        assert "failure" not in infos[world]
        assert np.array_equal(ours["eyes"][world], theirs["eyes"][world])
        assert reward[world] == other[world]
    assert np.isfinite(reward).all()
    for array in (*ours.values(), *infos[1]["terminal_observation"].values()):
        assert np.isfinite(array).all()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_action_that_is_no_number_ends_its_episode_alone(value):
    venv = make(3)
    venv.reset()
    bad = actions(3, 0)
    bad[2, 1] = value
    observation, reward, done, infos = venv.step(bad)
    assert done.tolist() == [False, False, True]
    assert infos[2]["failure"] == "action is not finite"
    assert not infos[2]["TimeLimit.truncated"]
    assert np.isfinite(reward).all()
    for array in (*observation.values(), *infos[2]["terminal_observation"].values()):
        assert np.isfinite(array).all()
    assert venv.observation_space.contains(infos[2]["terminal_observation"])


def test_observations_lie_in_their_space():
    venv = make(2, memory=4)
    observation = venv.reset()
    one = {name: array[0] for name, array in observation.items()}
    assert venv.observation_space.contains(one)
    assert one["eyes"].shape == (4, 2, 3, 4, 5)
    assert one["previous_action"].tolist() == [-1, 0]


def test_ppo_runs_on_it():
    from stable_baselines3 import PPO

    venv = make(4, eyes=sim.Eyes(n_eyes=1, resolution=(2, 2)))
    model = PPO("MultiInputPolicy", venv, n_steps=16, batch_size=32, n_epochs=1, seed=0)
    model.learn(128)
    assert model.num_timesteps == 128


def test_attributes_reach_the_one_environment():
    venv = make(3)
    assert venv.get_attr("eyes") == [EYES] * 3
    assert venv.env_is_wrapped(object) == [False] * 3
    with pytest.raises(ValueError, match="share one environment"):
        venv.set_attr("anything", 1, indices=[0])


@pytest.mark.parametrize(
    ("arguments", "named"),
    [({"memory": 0}, "memory"), ({"mode": "exam"}, "mode"), ({"task": "chess"}, "chess")],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(ValueError, match=named):
        make(2, **arguments)


def test_no_worlds_is_refused():
    with pytest.raises(ValueError, match="n_envs"):
        make(0)
