"""The skybox: positions of its faces against MuJoCo's renderer, and its brightness.

Every face shows its own grey ramp, and images are compared pixel by pixel with MuJoCo's renderer. The tests detect
these errors, each tried separately: F and B swapped, U and D swapped, R and L swapped.
"""

import warnings

import mujoco
import numpy as np
import pytest

import sim
from optics.spectra.spectrum import daylight
from sim.scene.cameras import Viewpoint
from sim.scene.color import encode_srgb
from sim.scene.mirror import MirrorWarning

from .drawn import draw
from .models import add_camera

TEXELS, WIDTH, HEIGHT = 64, 64, 48
NM = np.array([400.0, 470.0, 560.0, 700.0])
# Two of these views show the inside of one face each; the others show edges and corners.
TOWARDS = (
    [1, 0.1, 0.2],
    [-1, 0.2, -0.1],
    [0.1, 1, 0.2],
    [0.2, -1, 0.1],
    [0.1, 0.2, 1],
    [-0.2, 0.1, -1],
    [1, 1, 1],
    [-1, -1, 0.2],
)


def world(towards):
    spec = mujoco.MjSpec()
    spec.visual.headlight.active = 0
    spec.visual.quality.offsamples = 0
    texture = spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=TEXELS, height=6 * TEXELS, nchannel=3
    )
    face, row, column = np.indices((6, TEXELS, TEXELS))
    grey = (30 + 30 * face + row // 3 + column // 2).astype(np.uint8).reshape(-1, TEXELS)
    texture.data = np.repeat(grey[..., None], 3, axis=2).tobytes()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0, 0], pos=[0, 0, -50])
    add_camera(spec, [0, 0, 0.0], np.array(towards, float), fovy=60)
    return spec.compile()


def mirrored(model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)
        return sim.mirror(model)


def test_sky_is_where_mujoco_draws_it():
    models = [world(towards) for towards in TOWARDS]
    pictures = draw(models, WIDTH, HEIGHT)
    if pictures is None:
        pytest.skip("no OpenGL context")
    for model, drawn in zip(models, pictures[0], strict=True):
        assert np.ptp(drawn) > 20
        seen = mirrored(model).render("camera", WIDTH, HEIGHT, spp=16, wavelengths=[560e-9])[0]
        error = np.abs(255 * encode_srgb(np.clip(seen, 0, 1)) - drawn[..., 0])
        # Neighbouring texels differ by at most 1; at the edges of faces they differ by any amount.
        assert np.median(error) < 1
        assert np.mean(error < 3) > 0.95


def test_white_sky_has_the_radiance_of_daylight_and_lights_as_such():
    """A white Lambertian surface that faces only the sky is as bright as the sky."""
    xml = """<mujoco><visual><headlight active="0"/></visual><asset>
    <texture type="skybox" builtin="flat" rgb1="1 1 1" width="8" height="48"/></asset>
    <worldbody><geom type="plane" size="1 1 1" rgba="1 1 1 1"/></worldbody></mujoco>"""
    mirror = mirrored(xml)
    up = Viewpoint.looking_at(np.array([0, 0, 0.5]), np.array([1.0, 0, 3]), 1.0)
    down = Viewpoint.looking_at(np.array([0, 0, 0.5]), np.array([0.1, 0, 0]), 1.0)
    np.testing.assert_allclose(
        mirror.render(up, 1, 1, spp=1, wavelengths=NM * 1e-9)[:, 0, 0], daylight(NM * 1e-9), rtol=1e-3
    )
    lit = mirror.render(down, 2, 2, spp=4096, wavelengths=NM * 1e-9).mean((1, 2))
    np.testing.assert_allclose(lit, daylight(NM * 1e-9), rtol=0.02)


def test_one_image_on_all_sides_and_a_black_sky():
    xml = """<mujoco><visual><headlight active="0"/></visual><asset>
    <texture type="skybox" builtin="flat" rgb1="{0} {0} {0}" width="8" height="8"/></asset>
    <worldbody><geom size="0.1"/></worldbody></mujoco>"""
    up = Viewpoint.looking_at(np.array([0, 0, 0.5]), np.array([1.0, 0, 3]), 1.0)
    for grey in (0.0, 0.5):
        seen = mirrored(xml.format(grey)).render(up, 1, 1, spp=1, wavelengths=[560e-9])
        assert encode_srgb(seen)[0, 0, 0] == pytest.approx(grey, abs=0.004)
