"""Quick renderings against Mitsuba's `direct` integrator with many samples, for built-in worlds and a model with many
kinds of geoms.
"""

import mujoco
import numpy as np
import pytest

import sim
from optics.spectra.spectrum import daylight
from sim.pictures import camera_rays, quick_camera
from sim.pictures.quick_camera import QuickCamera
from sim.scene.cameras import Viewpoint
from sim.scene.color import encode_srgb, preview

WAVELENGTHS = np.linspace(430e-9, 660e-9, 8)
SIZE = (144, 192)
SPP = 64
# Allowed mean difference of pixels, in levels of 255. The five samples of a pixel at an edge give its coverage to about
# 0.1. The dense stripes of the maze put a fifth of the pixels at edges, with a contrast of about 100.
NOISE = 2.5
# Allowed difference of the image's mean. The display curve is concave, so that noise in linear light darkens the mean
# by half the curvature times the variance, here 0.3 to 0.5.
BIAS = 0.6

MIXTURE = """
<mujoco>
  <asset>
    <texture name="t" type="2d" builtin="checker" width="32" height="32" rgb1=".9 .3 .1" rgb2=".1 .3 .8"/>
    <material name="t" texture="t" texrepeat="4 4"/>
    <material name="gloss" rgba=".2 .7 .3 1" specular="1" shininess=".3"/>
  </asset>
  <worldbody>
    <light type="directional" dir="-.3 .5 -1" diffuse=".6 .6 .6"/>
    <light type="point" pos="1 -1 3" diffuse=".4 .4 .4" attenuation="1 0 0"/>
    <geom type="plane" size="4 4 .1" material="t"/>
    <geom type="box" size=".4 .3 .5" pos="-1 .4 .5" rgba=".8 .7 .2 1"/>
    <body name="arm" pos=".3 0 .8">
      <joint name="turn" axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 .8 0 .2" size=".12" material="gloss"/>
      <geom type="ellipsoid" size=".2 .3 .25" pos=".9 0 .3" rgba=".7 .2 .6 1"/>
    </body>
    <camera name="side" pos="0 -4 2.5" xyaxes="1 0 0 0 .5 1" fovy="45"/>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def mixture():
    model = mujoco.MjModel.from_xml_string(MIXTURE)
    with pytest.warns(sim.MirrorWarning):
        return model, QuickCamera(model), sim.mirror(model)


def _posed(model, angle=0.0):
    data = mujoco.MjData(model)
    if model.njnt:
        data.qpos[-1] = angle
    mujoco.mj_forward(model, data)
    return data


def _slow(mirror, data, camera):
    mirror.sync(data)
    radiance = mirror.render(camera, SIZE[1], SIZE[0], spp=SPP, wavelengths=WAVELENGTHS, sampler="multijitter")
    return 255 * encode_srgb(np.clip(preview(radiance, WAVELENGTHS * 1e9), 0, 1))


def _agree(quick, slow, noise=NOISE, bias=BIAS):
    difference = quick.astype(float) - slow
    return np.abs(difference).mean() < noise and np.abs(difference.mean(axis=(0, 1))).max() < bias


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("task", ["detection", "maze", "foraging"])
def test_worlds_look_as_in_slow_pictures(task, monkeypatch):
    world = sim.build_world(task)
    quick, data = QuickCamera(world.model, world.spectra), _posed(world.model)
    x, y = data.body("agent").xpos[:2]
    view = Viewpoint.looking_at(np.array([x - 4, y - 1, 5.0]), np.array([x + 3, y, 0.0]), 50.0)
    slow = _slow(sim.mirror(world.model, spectra=world.spectra), data, view)
    picture = quick.picture(data, view, SIZE[1], SIZE[0])
    assert _agree(picture, slow)
    gamma = np.rint(255 * (np.arange(quick_camera.LEVELS) / (quick_camera.LEVELS - 1)) ** (1 / 1.8)).astype(np.uint8)
    monkeypatch.setattr(quick_camera, "_DISPLAYED", gamma)
    assert not _agree(quick.picture(data, view, SIZE[1], SIZE[0]), slow)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_lights_from_elsewhere_do_not_agree(task):
    world = sim.build_world(task)
    data = _posed(world.model)
    x, y = data.body("agent").xpos[:2]
    view = Viewpoint.looking_at(np.array([x - 4, y - 1, 5.0]), np.array([x + 3, y, 0.0]), 50.0)
    slow = _slow(sim.mirror(world.model), data, view)
    world.model.light_dir[:, :2] *= -1
    turned = _posed(world.model)
    assert not _agree(QuickCamera(world.model).picture(turned, view, SIZE[1], SIZE[0]), slow)


def test_other_models_look_as_in_slow_pictures_wherever_their_parts_are(mixture):
    """The quick camera has four bands and the reference eight. This changes linear light by 2e-2 in the mean of all
    colours: 3 levels in bright areas and 20 in dark ones. New poses do not cause new recordings.
    """
    model, quick, mirror = mixture
    pictures = []
    for angle in (0.0, 1.5):
        data = _posed(model, angle)
        pictures.append(quick.picture(data, "side", SIZE[1], SIZE[0]))
        assert _agree(pictures[-1], _slow(mirror, data, "side"), noise=8, bias=8)
    assert np.abs(pictures[0].astype(int) - pictures[1]).mean() > 2
    assert quick._rays.recordings <= 2


def test_nearness_is_the_mirrors(mixture):
    """Interpolation between rays is exact on planes. The reference depth is float32."""
    model, quick, mirror = mixture
    data = _posed(model)
    look = quick.render(data, "side", SIZE[1], SIZE[0])
    depth = mirror.render_depth("side", SIZE[1], SIZE[0])
    ids = mirror.render_ids("side", SIZE[1], SIZE[0])
    nearness = look.inverse_distance(np.arange(depth.size)).reshape(SIZE)
    flat = (ids == 0) | (ids == 1)
    wrong = np.abs(nearness[flat] * depth[flat] - 1) > 1e-4
    assert flat.mean() > 0.4
    assert wrong.mean() < 0.05  # near shadows as black as the unlit side of the box
    assert (nearness[ids < 0] == 0).mean() > 0.95


@pytest.mark.slow
def test_a_camera_inside_of_a_body_looks_out_of_it():
    model = mujoco.MjModel.from_xml_string("""
        <mujoco><visual><headlight active="0"/></visual><worldbody><light type="directional" dir="0 0 -1"/>
        <geom type="plane" size="5 5 .1" rgba=".8 .2 .2 1"/><geom type="sphere" size=".3" pos="0 0 1"/>
        <camera name="within" pos="0 0 1" fovy="40"/></worldbody></mujoco>""")
    picture = QuickCamera(model).picture(_posed(model), "within", SIZE[1], SIZE[0])
    mirror = sim.mirror(model)
    assert _agree(picture, _slow(mirror, _posed(model), "within"), noise=8, bias=8)  # four bands render a saturated red


def test_white_in_daylight_is_white():
    """White is within 1e-3, a quarter of a level."""
    white = camera_rays.SRGB @ daylight(np.array(camera_rays.WAVELENGTHS_NM) * 1e-9)
    np.testing.assert_allclose(white, 1, atol=1e-3)
