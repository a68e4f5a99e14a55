"""Spotlights and lamps against MuJoCo's formulas. The tests detect a missing exponent and ignored attenuation."""

import warnings

import mujoco
import numpy as np
import pytest

import sim
from sim.scene.cameras import Viewpoint
from sim.scene.mirror import MirrorWarning


def profile(light, places):
    """Return the radiance at 560 nm of a white floor at positions x under a light at height 2 [m]."""
    xml = f"""<mujoco><visual><headlight active="0"/></visual><statistic center="0 0 0"/><worldbody>
    <light pos="0 0 2" dir="0 0 -1" diffuse="1 1 1" {light}/><geom type="plane" size="9 9 1" rgba="1 1 1 1"/>
    </worldbody></mujoco>"""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)
        mirror = sim.mirror(xml)
    views = [Viewpoint.looking_at(np.array([x, -1.0, 1.0]), np.array([x, 0, 0.0]), 0.05) for x in places]
    return np.array([float(mirror.render(view, 1, 1, spp=4, wavelengths=[560e-9])[0, 0, 0]) for view in views])


@pytest.mark.parametrize(("cutoff", "exponent"), [(45, 10), (30, 0), (60, 3), (100, 1)])
def test_spots_fall_off_as_their_exponent_says(cutoff, exponent):
    """Inside the cone, radiance is cosᵉ θ times the floor's cosine and the inverse square of the distance 2 / cos θ."""
    angles = np.radians([0.0, 10, 20, 29, 44, 58])
    cos = np.cos(angles)
    expected = np.where(np.degrees(angles) < cutoff, cos**exponent * cos**3, 0)
    # The projected image is bilinear between samples 1/513 of the cone apart, which is coarsest for the widest cone.
    np.testing.assert_allclose(
        profile(f'cutoff="{cutoff}" exponent="{exponent}"', 2 * np.tan(angles)), expected, atol=6e-3
    )


@pytest.mark.parametrize(("attenuation", "level"), [("1 0 0", 1.0), ("0 0 1", 0.25), ("1 1 0", 1 / 3)])
def test_lamps_are_as_bright_at_the_models_centre_as_their_attenuation_says(attenuation, level):
    """The level is 1 / (a + b d + c d²) at d = 2 m, and falls from there with the inverse square."""
    found = profile(f'type="point" attenuation="{attenuation}"', [0.0, 2.0])
    # 2 m aside, the square of the distance doubles, and the light arrives at 45°.
    np.testing.assert_allclose(found, [level, level / 2 * np.cos(np.pi / 4)], rtol=5e-3)


def test_quadratic_attenuation_is_mirrored_without_a_word():
    xml = """<mujoco><visual><headlight active="0"/></visual><worldbody><light type="point" pos="0 0 2"
    attenuation="0 0 1"/><geom size="1"/></worldbody></mujoco>"""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sim.mirror(xml)


def test_tracking_lights_and_cameras_follow():
    """A light that targets a body, and a camera that tracks it, follow the body's movement."""
    xml = """<mujoco><visual><headlight active="0"/></visual><worldbody>
    <light name="spot" pos="0 0 4" mode="targetbody" target="ball" cutoff="5" exponent="0" diffuse="1 1 1"
    attenuation="0 0 1"/>
    <geom type="plane" size="9 9 1" rgba="1 1 1 1"/>
    <body name="ball" mocap="true" pos="0 0 0.1"><geom name="ball" size="0.1"/>
    <camera name="follows" pos="0 -1 1" xyaxes="1 0 0 0 1 1" mode="track" fovy="20"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mirror = sim.mirror(model, data)
    data.mocap_pos[0] = [2.0, 1, 0.1]
    mujoco.mj_forward(model, data)
    mirror.sync(data)
    ids = mirror.render_ids("follows", 40, 40)
    assert ids[20, 20] == model.geom("ball").id
    assert 0.02 < np.mean(ids == model.geom("ball").id) < 0.5
    view = Viewpoint.looking_at(np.array([2.2, 1.0, 3.0]), np.array([2.2, 1.0, 0.0]), 0.1)
    away = Viewpoint.looking_at(np.array([0.2, 0.0, 3.0]), np.array([0.2, 0.0, 0.0]), 0.1)
    lit, dark = (mirror.render(v, 1, 1, spp=4, wavelengths=[560e-9])[0, 0, 0] for v in (view, away))
    assert lit > 0.02
    assert dark == 0
