"""A task of your own, whose eyes evolve: a cart on a rail moves to where it sees a ball.

    evolve run examples/find_ball.py:FindBall --preset quick

The eyes come from the genome. By default `place` fans them out from the first mount; a method of your own may put them
anywhere. Run as a script, the file shows how far carts come that roll about at random.
"""

import numpy as np

import sim


class FindBall(sim.Task):
    """A ball stands before a rail. The cart on it sees, and feels how fast it is."""

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

    def feels(self, data):
        return data.qvel


if __name__ == "__main__":
    random = np.random.default_rng(0)
    worlds = sim.make_vec_env(FindBall(), n_envs=32, seed=0)
    worlds.reset()
    for _ in range(FindBall.episode_steps):
        _, _, _, infos = worlds.step(random.uniform(-1, 1, (32, 1)))
    found = np.mean([info["is_success"] for info in infos])
    print(f"carts that roll about at random end before the ball in {found:.0%} of their episodes")
