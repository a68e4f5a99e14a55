"""Compound eyes in environments: observations, noise, images, and files."""

import pickle

import numpy as np
import pytest
from gymnasium import spaces

import optics
import sim
from sim.envs.hexagon_images import _projected, _unprojected, hexagon_map
from sim.envs.ommatidia_space import OmmatidiaBox
from sim.envs.retina_images import BETWEEN

OMMATIDIUM = optics.Ommatidium(optics.FacetLens(16e-6, 12e-6), optics.Waveguide(1.9e-6))
ROBOT = """
<mujoco><visual><headlight active="0"/></visual>
  <worldbody>
    <light type="directional" dir=".6 .3 -1" diffuse=".9 .9 .9"/>
    <geom type="plane" size="4 4 .1" rgba=".6 .6 .6 1"/>
    <geom type="sphere" size=".5" pos="1 .7 .5" rgba=".9 .2 .1 1"/>
    <body name="robot" pos="0 0 .5"><joint name="turn" axis="0 0 1"/><geom size=".1"/></body>
  </worldbody>
  <actuator><velocity joint="turn" kv="5"/></actuator>
</mujoco>"""


class Turning(sim.Task):
    """A robot that turns."""

    model = ROBOT
    eye = sim.CompoundEye(sim.hexagonal_patch(2, 8.0, 40.0, -10.0), OMMATIDIUM, noise_sigma=0.0).with_mirror_image()
    mounts = (sim.Mount("robot", offset=(0, 0, 0.2)),)
    fidelity = sim.Fidelity(8, 4)
    substeps, episode_steps = 20, 4

    def rewards(self, data):
        return {"none": 0.0}


def test_observations_are_the_renderers_signals_by_ommatidium():
    env = sim.make_vec_env(Turning(), n_envs=3, memory=2, render_mode="eyes")
    found = env.reset()["eyes"]
    assert env.observation_space["eyes"].shape == (2, 38, 3)
    assert found.shape == (3, 2, 38, 3)
    signals = env.renderer.signals(env.simulation.poses())  # (world, eye, channel, 1, ommatidium)
    assert found[:, -1] == pytest.approx(np.moveaxis(signals[:, 0, :, 0], 1, -1))
    after = [env.step(np.ones((3, 1)))[0]["eyes"] for _ in range(5)]  # into the next episode
    assert np.abs(after[0][:, 1] - found[:, 1]).max() > 1e-3
    assert after[0][:, 0] == pytest.approx(found[:, 1])
    assert env.observation_space["eyes"].contains(after[-1][0])
    (image, *_) = env.get_images()
    assert image.tolist() == hexagon_map(after[-1][0, -1], Turning.eye).tolist()
    env.close()


def test_the_space_survives_storage_and_differs_with_the_directions():
    env = sim.make_vec_env(Turning(), n_envs=1)
    space = env.observation_space["eyes"]
    assert pickle.loads(pickle.dumps(space)) == space
    other = OmmatidiaBox(space.low.min(), space.high.max(), space.shape, -space.directions)
    assert other != space
    env.close()


def test_a_frozen_policy_gets_as_many_frames_of_ommatidia_as_its_space_has():
    class Policy:
        observation_space = spaces.Dict({"eyes": OmmatidiaBox(0.0, 1.0, (3, 38, 3), np.eye(3)[[0] * 38])})

        def predict(self, observation, deterministic):
            return np.zeros((len(observation["eyes"]), 1)), None

    assert sim.Frozen(Turning(), Policy()).memory == 3


def test_two_mounts_follow_each_other_in_an_observation():
    class Twice(Turning):
        mounts = (sim.Mount("robot", offset=(0, 0, 0.2)), sim.Mount("robot", azimuth_deg=90.0, offset=(0, 0, 0.2)))

    env = sim.make_vec_env(Twice(), n_envs=1)
    found = env.reset()["eyes"]
    assert found.shape == (1, 1, 76, 3)
    signals = env.renderer.signals(env.simulation.poses())[0]
    assert found[0, 0] == pytest.approx(np.concatenate([signals[0, :, 0].T, signals[1, :, 0].T]))
    ways, own = env.observation_space["eyes"].directions, Twice.eye.directions
    assert ways[:38] == pytest.approx(own)
    assert ways[38:] == pytest.approx(own[:, [1, 0, 2]] * [-1, 1, 1])  # ahead of the second mount is left
    env.close()


def test_noise_has_the_variance_of_each_ommatidiums_photons():
    """A robot that stands still sees the same signals s in every frame: the variance is σ² + s/N."""

    class Dim(Turning):
        eye = sim.CompoundEye(
            sim.hexagonal_patch(1, 12.0, 20.0, -10.0),
            OMMATIDIUM,
            (540,),
            noise_sigma=0.02,
            photon_budget=optics.PhotonBudget(20.0),
        )
        episode_steps = 1000

    env = sim.make_vec_env(Dim(), n_envs=50)
    env.reset()
    signals = env.renderer.signals(env.simulation.poses())[0, 0, 0, 0]
    frames = np.concatenate([env.step(np.zeros((50, 1)))[0]["eyes"][:, 0, :, 0] for _ in range(40)])
    expected = 0.02**2 + np.maximum(signals, 0) / Dim.eye.photons[0]
    assert expected.max() > 1.5 * 0.02**2
    assert frames.mean(axis=0) == pytest.approx(signals, abs=4e-3)
    assert frames.var(axis=0) == pytest.approx(expected, rel=0.15)
    correlation = np.corrcoef(frames.T) - np.eye(7)
    assert np.abs(correlation).max() < 0.1
    env.close()


def test_hexagons_have_their_ommatidiums_colours():
    """One ommatidium is white, another red; left is on the left, up is at the top."""
    eye = sim.CompoundEye(sim.hexagonal_patch(2, 8.0), OMMATIDIUM)
    frame = np.zeros((19, 3), np.float32)
    leftmost, topmost = int(eye.directions[:, 1].argmax()), int(eye.directions[:, 2].argmax())
    frame[leftmost], frame[topmost] = 1, [1, 0, 0]
    image = hexagon_map(frame, eye)
    white = np.argwhere((image > 250).all(axis=-1))
    red = np.argwhere((image[..., 0] > 250) & (image[..., 1] < 5))
    black = np.count_nonzero((image < 5).all(axis=-1))
    height, width = image.shape[:2]
    assert white[:, 1].max() < width / 3
    assert white[:, 0].mean() == pytest.approx(height / 2, abs=3)
    assert red[:, 0].max() < height / 3
    assert np.count_nonzero((image == BETWEEN).all(axis=-1)) > 0.05 * height * width
    # All hexagons have the same area, in an equal-area projection of a lattice of equal solid angles.
    assert len(white) == pytest.approx(black / 17, rel=0.15)
    assert len(red) == pytest.approx(black / 17, rel=0.15)


def test_a_mosaic_is_drawn_in_the_colours_of_its_types():
    eye = sim.CompoundEye([[20.0, 0.0], [-20.0, 0.0]], OMMATIDIUM, types=[[0], [2]])
    image = hexagon_map(np.ones((2, 1), np.float32), eye)
    half = image.shape[1] // 2
    assert [255, 0, 0] in image[:, :half].reshape(-1, 3).tolist()
    assert [0, 0, 255] in image[:, half:].reshape(-1, 3).tolist()


def test_a_pale_and_a_yellow_ommatidium_are_white_in_white_light():
    eye = sim.CompoundEye([[20.0, 0.0], [-20.0, 0.0]], OMMATIDIUM, (600, 520, 460), types=[[0, 2], [1, 2]])
    image = hexagon_map(np.ones((2, 2), np.float32), eye)
    assert set(map(tuple, image.reshape(-1, 3).tolist())) == {(255, 255, 255), (BETWEEN,) * 3}


def test_exr_files_hold_signals_and_directions(tmp_path):
    eye = Turning.eye
    frame = np.random.default_rng(0).random((len(eye), 3)).astype(np.float32)
    sim.write_exr(tmp_path / "eyes.exr", [sim.View.from_ommatidia("head", eye, frame, attributes={"step": 3})])
    (view,) = sim.read_exr(tmp_path / "eyes.exr")
    signals, directions = view.receptors[:, 0].T, view.directions[:, 0].T
    assert signals == pytest.approx(frame)
    assert directions == pytest.approx(eye.directions, abs=1e-7)
    assert view.attributes == {"step": 3}
    assert list(view.peaks_nm) == [600, 520, 460]


def test_views_of_another_shape_are_refused():
    with pytest.raises(
        ValueError, match=r"frame has shape \(37, 3\): must be an array \(ommatidium, channel\), \(38, 3"
    ):
        sim.View.from_ommatidia("head", Turning.eye, np.zeros((37, 3)))
    with pytest.raises(ValueError, match=r"directions has shape \(3, 1, 4\): must be an array \(3, 1, 5\)"):
        sim.View("head", receptors=np.zeros((1, 1, 5)), directions=np.zeros((3, 1, 4)))


def test_auxiliary_entries_are_refused():
    class Deep(Turning):
        auxiliary = ("depth",)

    with pytest.raises(ValueError, match="Deep: depth, ids and flow: are defined on a flat retina"):
        sim.make_vec_env(Deep(), n_envs=1)


def test_the_map_is_hammers_projection():
    """The projection keeps areas, and its inverse leads back. Its rim is an ellipse with half-axes 2√2 and √2."""
    rng = np.random.default_rng(4)
    ways = rng.normal(size=(200, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    places = _projected(ways)
    back, inside = _unprojected(*places.T)
    assert inside.all()
    np.testing.assert_allclose(back, ways, atol=1e-9)
    known = {(1, 0, 0): (0, 0), (0, 0, 1): (0, 2**0.5), (0, 0, -1): (0, -(2**0.5)), (-1, -1e-12, 0): (2 * 2**0.5, 0)}
    np.testing.assert_allclose(_projected(np.array(list(known), float)), list(known.values()), atol=1e-6)
    assert _projected(np.array([[0.8, 0.6, 0]]))[0, 0] < 0, "left is on the left"
    step = 1e-5
    x, y = places[np.hypot(places[:, 0] / 2, places[:, 1]) < 1.3].T
    along_x = (_unprojected(x + step, y)[0] - _unprojected(x - step, y)[0]) / (2 * step)
    along_y = (_unprojected(x, y + step)[0] - _unprojected(x, y - step)[0]) / (2 * step)
    np.testing.assert_allclose(np.linalg.norm(np.cross(along_x, along_y), axis=1), 1, atol=1e-6)
    for scale, expected in ((0.999, True), (1.001, False)):
        assert _unprojected(*(scale * 2**0.5 * np.array([2 * np.cos(0.7), np.sin(0.7)])))[1] == expected
