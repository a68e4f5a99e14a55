"""The single environment passes the checkers of Gymnasium and stable-baselines3, and agrees with the batch."""

import dataclasses
import subprocess
import sys
import warnings
from functools import partialmethod

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from gymnasium.wrappers import FlattenObservation
from stable_baselines3.common.env_checker import check_env as sb3_check

import optics
import sim
from sim.envs.field_of_view_overlay import _receptor_rays
from sim.envs.follow_camera import FollowCamera, _follow
from sim.envs.registration import IDS
from sim.envs.retina_images import GAP, shares_of
from sim.eyes.eyes import EYE_HEIGHT
from sim.scene.color import encode_srgb

EYES = sim.Eyes(n_eyes=2, resolution=(3, 4), fov_deg=60)
FINE = {"rays_per_receptor": sim.Fidelity(2, bands=3)}


@pytest.mark.parametrize("id_", IDS)
def test_checkers_are_content(id_):
    """Gymnasium's checker gives no warning. For observations that are neither an image nor a vector,
    stable-baselines3's checker recommends a custom policy; for the flattened vector it gives no warning either.
    """
    env = gymnasium.make(id_, eyes=EYES, rays_per_receptor=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gymnasium_check(env.unwrapped, skip_render_check=True)
        sb3_check(FlattenObservation(env), skip_render_check=True)
        with pytest.warns(UserWarning, match="use a custom policy") as said:
            sb3_check(env.unwrapped, skip_render_check=True)
        assert len(said) == 1
    env.close()


def test_gymnasium_checks_the_pictures_too():
    env = gymnasium.make("rhabdom/Foraging-v0", eyes=EYES, rays_per_receptor=1, render_mode="eyes")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gymnasium_check(env.unwrapped)
    env.close()


@pytest.mark.parametrize("eyes", [EYES, dataclasses.replace(EYES, noise_sigma=0.0, receptors="goldfish")])
def test_observations_stay_within_finite_bounds(eyes):
    """Signals are brightest close to objects and walls. They stay within the bounds, and the bounds are within a factor
    of 20.
    """
    env = sim.make_env("detection", eyes, rays_per_receptor=1)
    space = env.observation_space["eyes"]
    assert np.isfinite([space.low, space.high]).all()
    observation, _ = env.reset(seed=0)
    brightest = 0.0
    for _ in range(60):
        assert env.observation_space.contains(observation)
        brightest = max(brightest, observation["eyes"].max())
        observation, _, terminated, truncated, _ = env.step(np.array([1.0, 0.1]))
        if terminated or truncated:
            observation, _ = env.reset()
    assert space.high.max() < 20 * brightest


def test_ids_are_known_after_importing_sim():
    code = "import gymnasium, sim; print([i for i in gymnasium.registry if i.startswith('rhabdom/')])"
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert child.stdout.strip() == str(list(IDS))


def test_it_is_world_0_of_the_batch():
    env = sim.make_env("detection", EYES, memory=2, rays_per_receptor=1)
    venv = sim.make_vec_env("detection", EYES, 3, seed=5, memory=2, rays_per_receptor=1)
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
    env = sim.make_env("detection", EYES, rays_per_receptor=1, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    assert first.shape == (360, 480, 3)
    assert first.dtype == np.uint8
    env.step(np.array([-1.0, 1.0]))  # the agent turns on the spot: it stays in the image, and the world turns
    second = env.render()
    state, camera = env.state, env._batch._pictures._photographer.camera
    mirror = sim.mirror(camera.world.model, camera._data)
    ids = mirror.render_ids(_follow(state, 0), 480, 360)
    y, x = np.nonzero(ids == mirror.model.geom("agent").id)
    assert len(y) > 50
    assert abs(x.mean() - 239.5) < 1
    assert (np.abs(first.astype(int) - second) > 30).mean() > 0.05


def test_fields_are_drawn_on_the_eyes_level_and_end_where_sight_ends():
    """One eye looks straight ahead at an object 3 m away. The image changes in a wedge up to the object and past it,
    but not behind the object or outside the field.
    """
    eyes = sim.Eyes(n_eyes=1, resolution=(5, 5), fov_deg=40)
    env = sim.make_env("detection", eyes, rays_per_receptor=1, render_mode="rgb_array")
    env.reset(seed=0)
    state = env.state
    objects = state.objects.copy()
    objects[0, :, :2] = [[3.0, 0.0], [-6.0, 0.0], [-6.0, 3.0]]
    state = dataclasses.replace(state, position=np.zeros((1, 2)), heading=np.zeros(1), objects=objects)
    world = env._batch.worlds.world
    bare, drawn = (FollowCamera(world, who).picture(state).astype(int) for who in (None, eyes))
    changed = np.abs(bare - drawn).max(axis=2) > 8

    def at(x, y):
        """Return whether a point on the eyes' level lies in the drawn field."""
        view = _follow(state, 0)
        local = view.rotation.T @ (np.array([x, y, EYE_HEIGHT]) - view.position)
        half = np.tan(np.radians(view.fovy_deg) / 2)
        column, row = (
            240 + 180 * local[0] / -local[2] / half,
            180 - 180 * local[1] / -local[2] / half,
        )
        return changed[int(row), int(column)]

    assert at(1.5, 0.2)
    assert at(1.5, -0.4)
    assert not at(1.5, 0.8)  # tan 20° times 1.3 m is 0.47 m
    assert not at(1.5, -0.8)
    assert not at(5.5, 0.0)  # behind the object
    assert at(6.0, 1.6)  # past the object
    assert not at(-1.0, 0.0)
    assert 0.005 < changed.mean() < 0.3


def test_slow_pictures_are_there_for_the_asking_and_show_the_same_fields():
    """Both cameras draw the same overlay from their own depths. They differ by noise at edges (see
    test_quick_camera.py).
    """
    env = sim.make_env("detection", EYES, rays_per_receptor=1)
    env.reset(seed=0)
    world, state, size = env._batch.worlds.world, env.state, (144, 192)
    quick, slow = (FollowCamera(world, EYES, samples).picture(state, size=size).astype(int) for samples in (None, 12))
    bare = FollowCamera(world).picture(state, size=size).astype(int)
    assert np.abs(quick - slow).mean() < 2
    fields = np.abs(quick - bare).max(axis=2) > 8
    assert fields.mean() > 0.02
    assert np.abs(quick - slow)[fields].mean() < 3
    assert np.abs(bare - slow)[fields].mean() > 10
    with pytest.raises(ValueError, match="samples = 0: must be a whole number, at least 1"):
        FollowCamera(world, samples=0)


@pytest.mark.parametrize("receptors", ["rgb", (500,), "goldfish", "mosaic"])
def test_pictures_of_eyes_show_their_signals(receptors):
    """Each receptor is a square with the grey level of its signal, or the colour of its type. Eyes are in order from
    left to right.
    """
    mosaic = receptors == "mosaic"
    kinds = optics.Receptors((600, 520, 460), mosaic=((0, 1), (1, 2))) if mosaic else receptors
    eyes = dataclasses.replace(EYES, noise_sigma=0.0, receptors=kinds)
    env = sim.make_env("detection", eyes, rays_per_receptor=1, render_mode="eyes")
    observation, _ = env.reset(seed=1)
    picture = env.render()
    assert picture.dtype == np.uint8
    signals = observation["eyes"][-1]
    scale = picture.shape[0] // 3
    assert picture.shape == (3 * scale, 2 * 4 * scale + GAP, 3)
    assert scale >= 50
    middles = picture[scale // 2 :: scale]
    left, right = middles[:, scale // 2 : 4 * scale : scale], middles[:, 4 * scale + GAP + scale // 2 :: scale]
    for image, signal in zip((left, right), signals, strict=True):
        if mosaic:
            kind = np.array([[0, 1, 0, 1], [1, 2, 1, 2], [0, 1, 0, 1]])
            expected = np.where(np.arange(3) == kind[..., None], signal[0][..., None], 0.0)
        elif receptors == "rgb":
            expected = signal.transpose(1, 2, 0)
        else:
            continue
        np.testing.assert_allclose(image, 255 * encode_srgb(np.clip(expected, 0, 1)), atol=0.51)
    if receptors == (500,):
        assert np.ptp(picture.astype(int), axis=2).max() == 0
    assert len(np.unique(picture[..., 0])) > 3


@pytest.mark.parametrize(("mode", "rows", "columns"), [("eyes", 2, 2), ("rgb_array", 2, 1)])
def test_batches_are_shown_as_tiles_of_the_single_worlds_pictures(mode, rows, columns, monkeypatch):
    small = partialmethod(FollowCamera.picture, size=(90, 120))  # enough for the comparison, at a sixteenth of the work
    monkeypatch.setattr(FollowCamera, "picture", small)
    venv = sim.make_vec_env("detection", EYES, rows * columns, 3, rays_per_receptor=1, render_mode=mode)
    env = sim.make_env("detection", EYES, rays_per_receptor=1, render_mode=mode)
    venv.reset()
    env.reset(seed=3)
    tiles, first = venv.render(), env.render()
    height, width, _ = first.shape
    assert tiles.shape == (rows * height, columns * width, 3)
    np.testing.assert_array_equal(tiles[:height, :width], first)
    assert not np.array_equal(tiles[-height:, :width], first)


def test_renders_nothing_before_the_world_has_begun():
    with pytest.raises(RuntimeError, match="call reset first"):
        sim.make_env("detection", EYES, rays_per_receptor=1, render_mode="eyes").render()
    assert sim.make_env("detection", EYES, rays_per_receptor=1).render() is None


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"render_mode": "human"}, "render_mode = 'human': must be one of 'rgb_array', 'eyes' or None"),
        ({"spectra": {"wal": "foliage"}}, "no material or light 'wal'; did you mean 'wall'"),
        ({"memory": 0}, "memory = 0"),
        ({"memory": 1.5}, "memory = 1.5: must be a whole number"),
        ({"episode_steps": 0}, "episode_steps = 0: must be a whole number"),
        (
            {**FINE, "fidelity": sim.Fidelity(3, bands=2)},
            r"rays_per_receptor = Fidelity\(.*: must be left out if a ",
        ),
        ({**FINE, "fidelity": "nonsense"}, "fidelity = 'nonsense': must be a sim.Fidelity, 'auto' or None"),
        ({**FINE, "fidelity": "auto"}, "rays_per_receptor = .*: must be left out if a fidelity is given"),
        ({"seed": 3}, r"seed = 3: must be left out, pass it to reset\(seed=...\)"),
        ({"n_envs": 2}, "n_envs = 2: must be left out, this is one world: make_vec_env has several"),
        ({"world_seed": 1.5}, "world_seed = 1.5: must be a whole number"),
    ],
)
def test_bad_options_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        sim.make_env("detection", EYES, **options)


def test_actions_of_another_shape_are_named():
    env = sim.make_env("detection", EYES, rays_per_receptor=1)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action has shape \(3,\): must be \(2,\)"):
        env.step(np.zeros(3))


def test_gymnasiums_own_statistics_can_be_wrapped_around():
    """Gymnasium's wrapper writes `episode` into the info itself."""
    env = gymnasium.wrappers.RecordEpisodeStatistics(sim.make_env("detection", EYES, rays_per_receptor=1))
    env.reset(seed=0)
    total, done = 0.0, False
    while not done:
        _, reward, terminated, truncated, info = env.step(np.array([1.0, 0.1]))
        total, done = total + reward, terminated or truncated
    assert info["episode"]["r"] == pytest.approx(total)


def test_eyes_and_seeds_of_another_kind_are_named():
    with pytest.raises(ValueError, match=r"eyes = 'x': must be sim.Eyes"):
        sim.make_env("detection", "x")
    with pytest.raises(ValueError, match="seed = -1: must be a whole number, at least 0"):
        sim.make_vec_env("detection", EYES, 1, seed=-1)
    with pytest.raises(ValueError, match=r"optics = 'lens': must be an optics.Pupil or None"):
        sim.Eyes(optics="lens")


def test_a_perfect_lens_tells_how_many_rays_it_has():
    renderer = sim.make_vec_env("detection", EYES, 1, rays_per_receptor=1.6).renderer
    assert renderer.fidelity.rays_per_receptor == renderer.sensor.rays_per_receptor == 2


def test_a_fidelity_by_either_name_is_the_same():
    """`rays_per_receptor` also accepts a fidelity. The eyes then have its number of bands."""
    fidelity = sim.Fidelity(2, bands=3, light="bounce")
    for named in ({"fidelity": fidelity}, {"rays_per_receptor": fidelity}):
        renderer = sim.make_vec_env("detection", EYES, 1, **named).renderer
        assert renderer.fidelity == fidelity
        assert renderer.eyes.bands == 3
    chosen = [sim.make_vec_env("detection", EYES, 1, **how).renderer.fidelity for how in ({}, {"fidelity": "auto"})]
    assert chosen[0] == chosen[1]
    assert chosen[0].levels


def test_an_eyes_columns_of_receptors_are_drawn_where_they_look():
    """Receptors are equally wide on the retina: for a field of 90°, five columns look along arctan 0, ±0.4 and ±0.8."""
    eyes = sim.Eyes(n_eyes=1, resolution=(1, 5), fov_deg=90)
    np.testing.assert_allclose(_receptor_rays(eyes), np.arctan([0.8, 0.4, 0.0, -0.4, -0.8]), atol=1e-12)
    narrow = sim.Eyes(n_eyes=1, resolution=(1, 2), fov_deg=40)
    np.testing.assert_allclose(np.tan(_receptor_rays(narrow)), np.tan(np.radians(20)) * np.array([0.5, -0.5]))
    assert 1 < len(_receptor_rays(sim.Eyes(n_eyes=1, resolution=(1, 500), fov_deg=90))) < 100


def test_pictures_of_signals_are_white_where_all_receptors_see_white():
    """The shares of each primary add up to one. A primary that no type contributes to is shared by all types."""
    shares = shares_of(np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]))
    np.testing.assert_allclose(shares, [[0.5, 0.0, 0.5], [0.5, 1.0, 0.5]])
