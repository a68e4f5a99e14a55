"""Glowing geoms with a different colour in each world look, and light other geoms, as in a model that is compiled with
this colour.
"""

import copy

import mujoco
import numpy as np
import pytest

import sim
from optics import Eye

MODEL = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <asset>
    <texture name="t" type="2d" builtin="checker" rgb1="1 1 1" rgb2=".2 .2 .2" width="64" height="64"/>
    <material name="plain" emission="1.5"/><material name="checked" emission="1.5" texture="t"/>
  </asset>
  <worldbody>
    <geom name="lamp" type="box" size=".1 1 1" pos="2 1 0" material="{material}" rgba="{rgba}"/>
    <geom type="box" size="2 .1 2" pos="1 -1.5 0" rgba=".8 .8 .8 1"/>
    <body name="eye"><joint name="turn" type="hinge"/><geom size=".01" pos="0 0 -5"/></body>
  </worldbody>
  <actuator><motor joint="turn"/></actuator>
</mujoco>"""
EYE = Eye(resolution=(3, 9), fov_deg=120, bands=4)
MOUNTS = (sim.Mount("eye"),)
COLORS = [(0.9, 0.6, 0.2), (0.5, 0.2, 0.1), (0.3, 0.3, 0.3), (0.2, 0.7, 1.0)]


def built(color, material="plain"):
    return MODEL.format(material=material, rgba=" ".join(map(str, (*color, 1))))


def seen(model, light, worlds, varied=()):
    """Return signals (world, channel, height, width). worlds: their models"""
    renderer = sim.ModelRenderer(model, EYE, MOUNTS, len(worlds), sim.Fidelity(8, bands=4, light=light), varied=varied)
    datas = [mujoco.MjData(world) for world in worlds]
    for world, data in zip(worlds, datas, strict=True):
        mujoco.mj_forward(world, data)
    return renderer.signals(datas)[:, 0]


@pytest.mark.filterwarnings("ignore:eyes do not see")
@pytest.mark.parametrize("light", ["direct", "bounce"])
def test_every_world_has_its_own_glow(light):
    """The glow agrees to the tables' steps of 5 nm. In bounced light of the same rays it also illuminates the wall next
    to it.
    """
    model = mujoco.MjModel.from_xml_string(built((1, 1, 1)))
    worlds = [copy.copy(model) for _ in COLORS]
    for world, color in zip(worlds, COLORS, strict=True):
        world.geom("lamp").rgba[:3] = color
    found = seen(model, light, worlds, ["lamp"])
    for color, here in zip(COLORS, found, strict=True):
        own = mujoco.MjModel.from_xml_string(built(color))
        np.testing.assert_allclose(here, seen(own, light, [own])[0], rtol=1e-2, atol=1e-4)
    wall = found[:, :, :, -3:]
    assert (wall.max() > 0.01) == (light == "bounce")


@pytest.mark.filterwarnings("ignore:eyes do not see")
@pytest.mark.parametrize("material", ["plain", "checked"])
def test_who_may_differ_and_does_not_glows_as_ever(material):
    model = mujoco.MjModel.from_xml_string(built((0.9, 0.6, 0.2), material))
    same, plain = (seen(model, "direct", [model], varied) for varied in (["lamp"], []))
    np.testing.assert_allclose(same, plain, rtol=1e-2, atol=5e-3)  # the hues of dark pixels are not products of hues
    assert plain.max() > 0.3


@pytest.mark.filterwarnings("ignore:eyes do not see")
def test_a_task_draws_it():
    class Glowing(sim.Task):
        model, eye, mounts, fidelity = built((1, 1, 1)), EYE, MOUNTS, sim.Fidelity(8, bands=4)
        vary = {"lamp.color": ((0.9, 0.6, 0.2), (0.9, 0.6, 0.2))}  # noqa: RUF012

        def rewards(self, data):
            return {}

    env = sim.make_vec_env(Glowing(), n_envs=2)
    env.reset()
    own = mujoco.MjModel.from_xml_string(built((0.9, 0.6, 0.2)))
    found = env.renderer.signals(env.worlds.datas)[:, 0]
    np.testing.assert_allclose(found, [seen(own, "direct", [own])[0]] * 2, rtol=1e-2, atol=1e-4)
