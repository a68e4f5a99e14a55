"""A robot with the compound eyes of a fly, and an image of their signals.

python examples/06_compound_eye.py [--out compound_eyes.png]

Each eye has 721 ommatidia, like an eye of Drosophila. Lenses are wider in an acute zone that looks ahead.
"""

import argparse

import numpy as np

from rhabdom import optics, sim

WORLD = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" width="64" height="384" rgb1=".25 .45 .8" rgb2=".8 .85 .9"/>
    <texture name="tiles" type="2d" builtin="checker" width="64" height="64" rgb1=".75 .7 .6" rgb2=".35 .4 .35"/>
    <material name="tiles" texture="tiles" texrepeat="1 1" texuniform="true"/>
  </asset>
  <worldbody>
    <light type="directional" dir=".5 .4 -1" diffuse=".9 .9 .9"/>
    <geom type="plane" size="12 12 .1" material="tiles"/>
    <geom type="cylinder" size=".25 1" pos="2 1.2 1" rgba=".9 .2 .1 1"/>
    <geom type="cylinder" size=".25 1" pos="2 -.8 1" rgba=".1 .3 .9 1"/>
    <geom type="box" size=".6 .3 .5" pos=".6 2 .5" rgba=".9 .8 .2 1"/>
    <geom type="sphere" size=".5" pos=".5 -1.8 .5" rgba=".2 .7 .3 1"/>
    <body name="robot" pos="0 0 .15">
      <joint name="turn" axis="0 0 1"/>
      <geom type="ellipsoid" size=".3 .15 .1"/>
      <geom type="capsule" fromto=".1 .1 0 .25 .35 -.1" size=".03"/>
      <geom type="capsule" fromto=".1 -.1 0 .25 -.35 -.1" size=".03"/>
    </body>
  </worldbody>
  <actuator><velocity joint="turn" kv="5"/></actuator>
</mujoco>"""


def fly_eyes(rings: int = 15, interommatidial_deg: float = 5.0) -> sim.CompoundEye:
    """Return the left eye and its mirror image, with an acute zone within 30 degrees of straight ahead."""
    directions = sim.hexagonal_patch(rings, interommatidial_deg, azimuth_deg=70.0, elevation_deg=0.0)
    rhabdom = optics.Waveguide(1.9e-6)
    normal = optics.Ommatidium(optics.FacetLens(16e-6, radius_front=12e-6), rhabdom)
    acute = optics.Ommatidium(optics.FacetLens(24e-6, radius_front=18e-6), rhabdom)
    ahead = directions[:, 0] > np.cos(np.radians(30))
    ommatidia = [acute if is_ahead else normal for is_ahead in ahead]
    return sim.CompoundEye(directions, ommatidia, photon_budget=optics.PhotonBudget(1e3)).with_mirror_image()


class Fly(sim.Task):
    """A robot that turns on the spot."""

    model = WORLD
    eye = fly_eyes()
    mounts = (sim.Mount("robot", offset=(0.3, 0, 0.1)),)
    fidelity = sim.Fidelity(16, bands=4, light="bounce")

    def rewards(self, data):
        """Return no terms, because this task only shows the eyes."""
        return {"none": 0.0}


parser = argparse.ArgumentParser()
parser.add_argument("--out", help="save the image of the eyes to this file")
out = parser.parse_args().out

worlds = sim.make_vec_env(Fly(), n_envs=2, seed=0, render_mode="eyes")
signals = worlds.reset()["eyes"]
print(f"observation (world, memory, ommatidium, channel): {signals.shape}")
for kind in Fly.eye.kinds[0]:
    width = np.degrees(kind.acceptance_angle(550e-9))
    print(f"facets of {1e6 * kind.lens.diameter:.0f} µm: acceptance angle {width:.1f} degrees at 550 nm")
photons = Fly.eye.photons
print(f"photons for white in the green channel: {photons[1].min():.0f} to {photons[1].max():.0f}")
if out:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.image

    matplotlib.image.imsave(out, worlds.get_images()[0])
    print(f"drawn to {out}")
worlds.close()
