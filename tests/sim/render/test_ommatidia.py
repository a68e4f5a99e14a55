"""Rendered signals of compound eyes, compared with the same eye made of mounts and with integrals of radiance."""

import dataclasses

import mujoco
import numpy as np
import pytest

import optics
import sim
from optics.spectra.spectrum import daylight
from sim.render.receptor_noise import NoiseModel

OMMATIDIUM = optics.Ommatidium(optics.FacetLens(16e-6, 12e-6), optics.Waveguide(1.9e-6))
WORLD = """
<mujoco><visual><headlight active="0"/></visual>
  <asset>
    <texture name="t" type="2d" builtin="checker" width="32" height="32" rgb1=".9 .3 .1" rgb2=".1 .3 .8"/>
    <material name="t" texture="t" texrepeat="2 2" texuniform="true"/>
  </asset>
  <worldbody>
    <light type="directional" dir="-.3 .5 -1" diffuse=".9 .9 .9"/>
    <geom type="plane" size="4 4 .1" material="t"/>
    <geom type="box" size=".4 .3 .5" pos="1 .4 .5" rgba=".8 .7 .2 1"/>
    <body name="head" pos="-1 0 1"><freejoint/><geom size=".1" group="4"/></body>
    <body pos="1 -.5 .8"><joint axis="0 0 1"/><geom type="ellipsoid" size=".2 .3 .25" rgba=".7 .2 .6 1"/></body>
  </worldbody>
</mujoco>"""
HEAD = (sim.Mount("head", azimuth_deg=5.0, roll_deg=20.0),)
DEGREES = np.array([[0.0, -20.0], [12.0, -8.0], [-15.0, -5.0], [80.0, -40.0]])


@pytest.fixture(scope="module")
def world():
    model = mujoco.MjModel.from_xml_string(WORLD)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def signals(world, eye, mounts=HEAD, rays=2048):
    model, data = world
    return sim.ModelRenderer(model, eye, mounts, 1, sim.Fidelity(rays, eye.bands)).signals(data)[0]


def as_mount(ommatidium):
    """The ommatidium as an eye with one receptor, and the signal of each type for white."""
    guide, lens = ommatidium.rhabdom, ommatidium.pupil
    fov = np.degrees(2 * np.arctan(guide.diameter / 2 / ommatidium.rhabdom_distance * lens.index(550e-9) if False else 0))
    raise NotImplementedError
