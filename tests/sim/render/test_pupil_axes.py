"""A half-open pupil in front of a myopic wavefront, on a MuJoCo model: the open half blurs towards its own side.

The owner's left is the side at which an observer in front of the eye sees +x. By ray optics, light through the upper
half crosses the axis, hits the retina below it, and appears above (`tests/optics/eye/test_axes.py`).
"""

import math

import mujoco
import numpy as np
import pytest

import optics
import sim

BALL = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <worldbody>
    <light type="directional" dir="1 0 0" diffuse="1 1 1"/>
    <geom type="sphere" size=".12" pos="3 0 0" rgba="1 1 1 1"/>
    <body name="head"/>
  </worldbody>
</mujoco>
"""
FOCAL = 200e-6 / (2 * math.tan(math.radians(30)))


@pytest.fixture(scope="module")
def scene():
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def shift(scene, closed, **others):
    """Return the centre of the ball's image (right, up) [receptors]. closed: centre of the closed half."""
    model, data = scene
    half = optics.difference(optics.Circle(), optics.Oblong(2.0, 2.0, closed))
    myopic = optics.Zernike({(2, 0): 1.8})
    pupil = optics.Pupil(40e-6, thin_lens_focal_length=FOCAL, aperture=half, wavefront=myopic)
    eye = optics.Eye(pupil, (15, 15), 60.0, bands=3, **others)
    renderer = sim.ModelRenderer(model, eye, (sim.Mount("head"),), 1, sim.Fidelity(32, bands=3))
    image = np.asarray(renderer.signals([data])).reshape(-1, 15, 15).sum(axis=0)
    place = (np.arange(15) - 7) / image.sum()
    return image.sum(axis=0) @ place, -image.sum(axis=1) @ place


@pytest.mark.parametrize(
    ("closed", "expected"),
    [((0, -1), (0, 2)), ((0, 1), (0, -2)), ((-1, 0), (-2, 0)), ((1, 0), (2, 0))],
    ids=["top open", "bottom open", "observer's right open", "observer's left open"],
)
def test_the_open_half_blurs_towards_its_own_side(scene, closed, expected):
    """2 receptors are the mean of the half disk. The rays' samples have an error of about 0.1."""
    assert shift(scene, closed) == pytest.approx(expected, abs=0.3)


def test_turned_pupils_blur_to_the_other_side(scene):
    assert shift(scene, (0, -1), pupil_turned=True) == pytest.approx((0, -2), abs=0.3)
