"""A user task with evolving eyes: a cart on a rail moves to the ball that it sees.

    evolve run examples/find_ball.py:FindBall --preset quick

The genome determines the eyes. By default `place` fans them out from the first mount; override it for another
arrangement. Run as a script, the file prints how often carts with random actions find the ball.
"""

import numpy as np

from rhabdom import sim


class FindBall(sim.Task):
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

    def reset(self, data, rng):
        data.mocap_pos[0, 1] = rng.uniform(-2, 2)

    def rewards(self, data):
        return {"near": -abs(data.mocap_pos[0, 1] - data.qpos[0]) / 10}

    def succeeded(self, data):
        return abs(data.mocap_pos[0, 1] - data.qpos[0]) < 0.3

    def proprioception(self, data):
        return data.qvel


if __name__ == "__main__":
    random = np.random.default_rng(0)
    worlds = sim.make_vec_env(FindBall(), n_envs=32, seed=0)
    worlds.reset()
    for _ in range(FindBall.episode_steps):
        _, _, _, infos = worlds.step(random.uniform(-1, 1, (32, 1)))
    found = np.mean([info["is_success"] for info in infos])
    print(f"carts with random actions end in front of the ball in {found:.0%} of their episodes")
