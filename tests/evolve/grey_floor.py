"""A user task with a floor of the grey level 128, from a PNG without a colour chunk."""

import mujoco
import numpy as np

import sim
from tests.sim.scene.png import flat

WORLD = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <asset><texture name="grey" type="2d" file="grey.png"/><material name="grey" texture="grey"/></asset>
  <worldbody>
    <light type="directional" dir="0 0 -1" diffuse="1 1 1"/>
    <geom type="plane" size="9 9 .1" material="grey"/>
    <body name="cart" pos="0 0 .2">
      <joint name="slide" type="slide" axis="0 1 0" damping="1"/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
  <actuator><velocity joint="slide" kv="10" ctrlrange="-2 2"/></actuator>
</mujoco>"""
FILES = {"grey.png": flat([128])}


class GreyFloor(sim.Task):
    """A cart with an eye that looks down on the floor."""

    model = mujoco.MjSpec.from_string(WORLD, assets=FILES)
    mounts = (sim.Mount("cart", offset=(0.3, 0, 0.3), elevation_deg=-80),)
    fidelity = sim.Fidelity(2, bands=4)
    episode_steps = 4

    def reset(self, data, rng):
        data.qpos[0] = rng.uniform(-1, 1)

    def rewards(self, data):
        return {"still": -float(np.abs(data.qvel[0]))}


class CompiledFloor(GreyFloor):
    """The same task with a compiled model."""

    model = mujoco.MjModel.from_xml_string(WORLD, FILES)
