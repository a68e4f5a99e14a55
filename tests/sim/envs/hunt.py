"""Prey and predator on a floor, for tests of several animals. Both slide, and each has eyes all round."""

import numpy as np

import optics
import sim

FIELD = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <option timestep=".05" gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0" mass="1"/><velocity kv="10" ctrlrange="-1 1"/></default>
  <worldbody>
    <light type="directional" dir="1 .2 -.5" diffuse=".8 .8 .8"/>
    <light type="directional" dir="-.7 .9 -.5" diffuse=".8 .8 .8"/>
    <light type="directional" dir="-.4 -1 -.5" diffuse=".8 .8 .8"/>
    <geom type="plane" size="20 20 .1" rgba=".3 .3 .3 1"/>
    <body name="prey" pos="0 0 .3">
      <joint name="prey_x" type="slide" axis="1 0 0"/><joint name="prey_y" type="slide" axis="0 1 0"/>
      <geom size=".2" rgba=".1 .2 .9 1"/>
    </body>
    <body name="predator" pos="2 0 .3">
      <joint name="predator_x" type="slide" axis="1 0 0" ref="2"/><joint name="predator_y" type="slide" axis="0 1 0"/>
      <geom size=".25" rgba=".9 .1 .1 1"/>
    </body>
  </worldbody>
  <actuator>
    <velocity name="prey_x" joint="prey_x"/><velocity name="prey_y" joint="prey_y"/>
    <velocity name="predator_x" joint="predator_x"/><velocity name="predator_y" joint="predator_y"/>
  </actuator>
</mujoco>"""


class Animal(sim.Task):
    model = FIELD
    fidelity = sim.Fidelity(2, bands=4)
    substeps, episode_steps = 2, 20

    def __init__(self):
        body = self.body
        self.actuators = (f"{body}_x", f"{body}_y")
        self.mounts = sim.ring(body, self.n_eyes, 180 if self.n_eyes == 2 else 240, radius=0.26)

    def terminated(self, data):
        return distance(data) < 0.4


class Prey(Animal):
    """An animal with three eyes that is rewarded for distance from the predator."""

    body, n_eyes, eye = "prey", 3, optics.Eye(resolution=(2, 8), fov_deg=120, bands=4)

    def reset(self, data, rng):
        data.qpos[:2] = rng.uniform(-0.3, 0.3, 2)

    def rewards(self, data):
        return {"far": distance(data) / 20}

    def proprioception(self, data):
        return data.qvel[:2]


class Predator(Animal):
    """An animal with two eyes of another kind that is rewarded for proximity to the prey."""

    body, n_eyes, eye = "predator", 2, optics.Eye(resolution=(1, 12), fov_deg=140, bands=4)

    def reset(self, data, rng):
        bearing = rng.uniform(-np.pi, np.pi)
        data.qpos[2:] = 1.3 * np.array([np.cos(bearing), np.sin(bearing)])

    def rewards(self, data):
        return {"near": -distance(data) / 20}

    def succeeded(self, data):
        return distance(data) < 0.4


class Twin(Animal):
    """One of two identical animals that are rewarded for proximity to each other."""

    n_eyes, eye = 3, optics.Eye(resolution=(1, 6), fov_deg=100, bands=4)

    def __init__(self, name):
        self.name, self.actuators = name, (f"{name}_x", f"{name}_y")
        self.mounts = sim.ring(name, self.n_eyes, 240, radius=0.26)

    def reset(self, data, rng):
        if self.name == "predator":
            data.qpos[2:] = rng.uniform(-2, 2, 2)

    def rewards(self, data):
        return {"near": -distance(data) / 20}


def distance(data):
    return float(np.hypot(*(data.qpos[:2] - data.qpos[2:])))


def hunt():
    return sim.Encounter(Prey(), Predator())


def still(observation):
    """Return zero actions: a policy that does nothing."""
    return np.zeros((len(observation["previous_action"]), 2))
