"""Several kinds of eyes on one animal: each kind has the signals that it would have alone."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO

import optics
import sim
from sim.tasks.task_fidelity import fidelities_of
from sim.tasks.user_tasks import with_evolved_eyes
from tests.sim.envs.hunt import Predator, Prey
from tests.sim.envs.test_task_vec_env import Face

WIDE = optics.Eye(resolution=(2, 8), fov_deg=100, bands=4, noise_sigma=0.02)
SHARP = optics.Eye(resolution=(9, 9), fov_deg=60, bands=4, noise_sigma=0.001)
SIDES = sim.both_sides([sim.Mount("cart", azimuth_deg=50, offset=(0.2, 0.1, 0.1))])
AHEAD = (sim.Mount("cart", offset=(0.2, 0, 0.1)),)


class Looker(Face):
    """A task with two wide, coarse eyes, and a narrow, sharp one."""

    eye, mounts = {"wide": WIDE, "sharp": SHARP}, {"wide": SIDES, "sharp": AHEAD}
    episode_steps = 6


def alone(name, **more):
    task = Face()
    task.eye, task.mounts, task.episode_steps = Looker.eye[name], Looker.mounts[name], 6
    for what, value in more.items():
        setattr(task, what, value)
    return task


def played(task, n=3, steps=9, **how):
    env = sim.make_vec_env(task, n_envs=n, seed=4, **how)
    seen = [env.reset()]
    last = None
    for k in range(steps):
        observation, _, done, infos = env.step(np.full((n, 1), np.sin(k), np.float32))
        seen.append(observation)
        last = infos[0]["terminal_observation"] if done[0] else last
    return seen, last


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("memory", [1, 2])
def test_each_kind_sees_what_it_would_see_alone(memory):
    """The first kind even has the noise of a task without other kinds. The test continues past the end of an
    episode.
    """
    both, last = played(Looker(), memory=memory)
    wide, wide_last = played(alone("wide"), memory=memory)
    assert [*both[0]] == ["wide", "sharp", "previous_action"]
    for one, other in zip(both, wide, strict=True):
        np.testing.assert_array_equal(one["wide"], other["eyes"])
    np.testing.assert_array_equal(last["wide"], wide_last["eyes"])
    sharp, sharp_last = played(alone("sharp"), memory=memory)
    for one, other in zip([*both, last], [*sharp, sharp_last], strict=True):
        np.testing.assert_allclose(one["sharp"], other["eyes"], atol=8 * 0.001 * 2**0.5)  # both signals have noise
    assert np.abs(both[0]["sharp"] - both[-1]["sharp"]).max() > 0.1


def test_their_noise_is_not_the_same():
    like = {"left": replace(WIDE, noise_sigma=0.05), "right": replace(WIDE, noise_sigma=0.05)}
    task = Looker()
    task.eye, task.mounts = like, {"left": AHEAD, "right": AHEAD}
    seen = played(task)[0]
    apart = np.concatenate([(one["left"] - one["right"]).ravel() for one in seen])
    assert apart.std() == pytest.approx(0.05 * 2**0.5, rel=0.1)
    assert np.abs(seen[1]["right"] - seen[2]["right"]).max() > 0.05


def test_spaces_hold_and_a_learner_takes_them():
    check_env(sim.make_env(Looker()), skip_render_check=True)
    env = sim.make_vec_env(Looker(), n_envs=4)
    space = env.observation_space
    assert {name: one.shape for name, one in space.items()} == {
        "wide": (1, 2, 3, 2, 8),
        "sharp": (1, 1, 3, 9, 9),
        "previous_action": (1,),
    }
    learner = PPO("MultiInputPolicy", env, n_steps=8, batch_size=16, n_epochs=1, seed=0).learn(32)
    assert learner.predict(env.reset())[0].shape == (4, 1)
    assert gymnasium.spaces.flatdim(space) == 2 * 3 * 16 + 3 * 81 + 1


def test_worlds_go_on_from_where_they_stood():
    env = sim.make_vec_env(Looker(), n_envs=2, memory=2)
    env.reset()
    env.step(np.ones((2, 1)))
    held = env.get_state()
    then = [env.step(np.ones((2, 1)))[0] for _ in range(3)]
    env.set_state(held)
    for expected in then:
        found = env.step(np.ones((2, 1)))[0]
        for name in expected:
            np.testing.assert_array_equal(found[name], expected[name])


def test_pictures_show_all_kinds():
    task = Looker()
    env = sim.make_vec_env(task, n_envs=1, render_mode="eyes")
    env.reset()
    rows = []
    for name in ("wide", "sharp"):
        single = sim.make_vec_env(alone(name), n_envs=1, render_mode="eyes")
        single.reset()
        rows.append(single.get_images()[0].shape)
    picture = env.get_images()[0]
    assert picture.shape[1] == max(row[1] for row in rows)
    assert picture.shape[0] > sum(row[0] for row in rows)
    env = sim.make_vec_env(task, n_envs=1, render_mode="rgb_array")
    env.reset()
    both = env.get_images()[0].astype(int)
    one = sim.make_vec_env(alone("wide"), n_envs=1, render_mode="rgb_array")
    one.reset()
    assert np.abs(both - one.get_images()[0]).max() > 50


def test_fidelity_is_each_kinds_own():
    task = Looker()
    task.fidelity = {"wide": sim.Fidelity(1, bands=4), "sharp": sim.Fidelity(9, bands=4)}
    env = sim.make_vec_env(task, n_envs=1)
    rays = {name: sight.renderer.fidelity.rays_per_receptor for name, sight in env.animals.learners[0].sights.items()}
    assert rays == {"wide": 1, "sharp": 9}


@pytest.mark.slow
def test_automatic_fidelity_is_each_kinds_own():
    task = Looker()
    task.fidelity = {"wide": "auto", "sharp": sim.Fidelity(9, bands=4)}
    assert fidelities_of(task)["wide"] == fidelities_of(alone("wide", fidelity="auto"))["eyes"]
    assert fidelities_of(task)["sharp"].rays_per_receptor == 9


def test_an_animal_of_several_kinds_among_others():
    """The other animals' signals, including their noise, stay unchanged."""

    careful = Prey()
    careful.eye = {"back": Prey.eye, "ahead": Prey.eye}
    careful.mounts = {"back": careful.mounts, "ahead": careful.mounts[1:2]}
    seen = []
    for prey in (Prey(), careful):
        env = sim.make_parallel_env(sim.Encounter(prey, Predator()), seed=2)
        env.reset()
        seen.append(env.step({name: np.ones(2, np.float32) for name in env.agents})[0])
    plain, more = seen
    np.testing.assert_array_equal(plain["Predator"]["eyes"], more["Predator"]["eyes"])
    np.testing.assert_array_equal(plain["Prey"]["eyes"], more["Prey"]["back"])
    assert more["Prey"]["ahead"].shape[1] == 1


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"mounts": SIDES}, "Looker: mounts = .*: must have an entry for each kind of eyes"),
        ({"eye": WIDE}, "Looker: eye = .*: must have an entry for each kind of eyes"),
        ({"mounts": {"wide": SIDES, "shrap": AHEAD}}, "eye has kinds 'wide', 'sharp', mounts 'wide', 'shrap': must be"),
        ({"fidelity": {"wide": "auto"}}, "fidelity has kinds 'wide', eye 'wide', 'sharp': must be the same"),
        (
            {"eye": {"feels": WIDE}, "mounts": {"feels": SIDES}},
            "eye: kind 'feels': must be a name such as",
        ),
        ({"eye": {"a.b": WIDE}, "mounts": {"a.b": SIDES}}, "eye: kind 'a.b': must be a name such as"),
        ({"eye": {"wide": 3, "sharp": SHARP}}, r"Looker: eye\['wide'\]"),
        ({"eye": {}}, "Looker: eye = {}: must have an entry"),
        ({"eye": WIDE, "mounts": sim.Mount("cart")}, r"Looker: mounts = .*: must be several of sim\.Mount"),
        ({"eye": WIDE, "mounts": ("cart",)}, r"Looker: mounts = \('cart',\): must be several of sim\.Mount"),
        ({"eye": sim.Eyes(), "mounts": SIDES}, "Looker: eye = .*: must be"),
        ({"mounts": {"wide": SIDES, "sharp": sim.Mount("cart")}}, r"Looker: mounts\['sharp'\] = .*: must be several"),
        ({"fidelity": {"wide": "auto", "sharp": "fine"}}, "fidelity = 'fine': must be a sim.Fidelity, or 'auto'"),
    ],
)
def test_what_does_not_go_together_is_refused(settings, said):
    task = Looker()
    for name, value in settings.items():
        setattr(task, name, value)
    with pytest.raises(ValueError, match=said):
        sim.make_vec_env(task, n_envs=1)


def test_evolution_takes_one_kind():
    with pytest.raises(ValueError, match="Looker: eye and mounts have several kinds of eyes: must have one"):
        with_evolved_eyes(Looker(), sim.Eyes())
