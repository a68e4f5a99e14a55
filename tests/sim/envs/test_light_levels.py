"""Light levels that differ between episodes of built-in tasks: signals scale with the level, and noise does not."""

import gymnasium
import numpy as np
import pytest

import sim

EYES = sim.Eyes(resolution=(4, 6), noise_sigma=0.0, bands=2)
OPTIONS = {"rays_per_receptor": 4, "n_envs": 12, "seed": 7}


def played(steps=6, eyes=EYES, **more):
    """Return signals and light levels over episodes of three actions. All worlds restart at the same time."""
    env = sim.make_vec_env("detection", eyes, episode_steps=3, **{**OPTIONS, **more})
    seen, levels = [env.reset()["eyes"]], [[i.get("varied", {}).get("light") for i in env.reset_infos]]
    last = None
    for _ in range(steps):
        observation, _, done, infos = env.step(np.tile(np.float32([0.2, 0.3]), (env.num_envs, 1)))
        seen.append(observation["eyes"])
        levels.append([info.get("varied", {}).get("light") for info in infos])
        if done[0]:
            last = infos[0]["terminal_observation"]["eyes"]
    return np.array(seen), np.array(levels), last


def test_signals_are_as_large_a_share_in_every_episode():
    plain, none, plain_last = played()
    dim, levels, last = played(vary={"light": (0.05, 1.0)})
    assert none.tolist() == [[None] * 12] * 7
    shares = dim.sum(axis=(2, 3, 4, 5, 6)) / plain.sum(axis=(2, 3, 4, 5, 6))
    np.testing.assert_allclose(dim, plain * shares[..., None, None, None, None, None], rtol=1e-4, atol=1e-6)
    # The observation after an episode's last action is in the light of the next episode. Its info holds the level of
    # the last one.
    np.testing.assert_allclose(shares[:3], levels[[0, 1, 2]], rtol=1e-4)
    np.testing.assert_allclose(shares[3:6], levels[[4, 4, 5]], rtol=1e-4)
    assert (levels[0] == levels[3]).all()
    assert len(np.unique(levels)) == 24
    np.testing.assert_allclose(last, plain_last * levels[5, 0], rtol=1e-4, atol=1e-6)
    assert levels.min() >= 0.05
    assert levels.max() <= 1
    assert np.log(levels).std() > 0.5


def test_a_world_that_begins_anew_is_lit_anew_and_others_stay_as_they_were():
    """Episodes end by `least_return`, and so at different times."""
    seen, told = {}, {}
    for vary in (None, {"light": (0.05, 1.0)}):
        env = sim.make_vec_env("detection", EYES, vary=vary, least_return=-1.0, **OPTIONS)
        env.reset()
        random, looks, levels, ended = np.random.default_rng(3), [], [], []
        for _ in range(80):
            observation, _, done, infos = env.step(random.uniform(0, 1, (env.num_envs, 2)).astype(np.float32))
            looks.append(observation["eyes"].sum(axis=(1, 2, 3, 4, 5)))
            levels.append([info.get("varied", {}).get("light") for info in infos])
            ended.append(done)
        seen[vary is None], told = np.array(looks), np.array(levels)
    assert any(0 < done.sum() < 6 for done in ended), "only a few worlds restart at once"
    # The info holds the light level of the action; the observation that comes with it already belongs to the next
    # episode.
    np.testing.assert_allclose(seen[False][:-1], seen[True][:-1] * told[1:].astype(float), rtol=1e-4)


def test_light_depends_on_the_world_and_the_seed_alone():
    few = played(vary={"light": (0.05, 1.0)}, n_envs=1)[0]
    many = played(vary={"light": (0.05, 1.0)}, n_envs=12)[0]
    np.testing.assert_array_equal(few[:, 0], many[:, 0])
    again = played(vary={"light": (0.05, 1.0)}, seed=8)[1]
    assert (again != played(vary={"light": (0.05, 1.0)})[1]).all()


def test_noise_is_added_after_the_light():
    eyes = sim.Eyes(resolution=(4, 6), noise_sigma=0.05, bands=2)
    dark = played(eyes=eyes, vary={"light": (1e-6, 1e-6)})[0]
    assert dark.std() == pytest.approx(0.05, rel=0.05)
    assert abs(dark.mean()) < 0.005


def test_gymnasium_takes_it_too():
    env = gymnasium.make("rhabdom/Detection-v0", eyes=EYES, rays_per_receptor=1, vary={"light": (0.5, 0.5)})
    assert env.reset(seed=0)[1]["varied"] == {"light": pytest.approx(0.5)}


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        ({"wall_east.size": (0.5, 2)}, "vary: wall_east.size: agents touch 'wall_east', which all worlds share"),
        ({"goal.start": ((0, 0, 0), (1, 1, 0))}, "vary: goal.start: must be left out, the task itself places"),
        ({"size": (1, 2)}, "vary: 'size': must be one of"),
    ],
)
def test_bad_ranges_are_refused(vary, said):
    with pytest.raises(ValueError, match=said):
        sim.make_vec_env("detection", EYES, vary=vary, **OPTIONS)
