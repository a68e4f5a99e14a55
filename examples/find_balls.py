"""Vectorised form of the task in `find_ball.py`, which is faster for 16 worlds or more.

    evolve run examples/find_balls.py:FindBalls --preset quick

Both classes produce the same episodes, rewards and animals, bit for bit. docs/tutorial/batch_task.md explains the
methods.
"""

import numpy as np

from rhabdom import sim


class FindBalls(sim.BatchTask):
    """A ball stands in front of a rail. The cart on the rail sees the ball and senses its own speed."""

    model = """
    <mujoco>
      <visual><headlight active="0"/></visual>
      <option timestep=".02"/>
      <worldbody>
        <light type="directional" dir="-.3 -.4 -1" diffuse=".9 .9 .9"/>
        <geom type="plane" size="6 3 .1" rgba=".3 .3 .3 1"/>
        <body name="cart" pos="0 0 .2">
          <joint name="slide" type="slide" axis="0 1 0" damping="1"/>
          <geom type="box" size=".15 .2 .1" rgba=".2 .4 .8 1" mass="1"/>
        </body>
        <body mocap="true" pos="2 0 .3"><geom size=".3" rgba=".9 .2 .1 1" contype="0" conaffinity="0"/></body>
      </worldbody>
      <actuator><velocity joint="slide" kv="10" ctrlrange="-2 2"/></actuator>
    </mujoco>"""
    mounts = (sim.Mount("cart", offset=(0.26, 0, 0.12)),)
    fidelity = sim.Fidelity(2, bands=4)
    episode_steps = 20  # of 5 x 0.02 s

    def reset(self, worlds, chosen, rngs):
        worlds.mocap_pos[chosen, 0, 1] = [rng.uniform(-2, 2) for rng in rngs]

    def rewards(self, worlds):
        return {"near": -self.distance(worlds) / 10}

    def succeeded(self, worlds):
        return self.distance(worlds) < 0.3

    def proprioception(self, worlds):
        return worlds.qvel

    def distance(self, worlds):
        return np.abs(worlds.mocap_pos[:, 0, 1] - worlds.qpos[:, 0])


if __name__ == "__main__":
    sim.check_batch_task(FindBalls())
    print("the task follows the protocol of sim.BatchTask")
