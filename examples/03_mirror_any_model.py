"""Spectral rendering of any MuJoCo model: its camera, materials and sky in Mitsuba 3.

python examples/03_mirror_any_model.py [MODEL.xml] [--camera NAME] [--out picture.png]
"""

import argparse
import warnings

import mujoco
import numpy as np

from rhabdom import sim
from rhabdom.sim.scene.cameras import Viewpoint
from rhabdom.sim.scene.color import preview
from rhabdom.sim.scene.mirror import MirrorWarning

MODEL = """
<mujoco>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".7 .8 .95" rgb2=".3 .45 .7" width="64" height="384"/>
    <texture name="tiles" type="2d" builtin="checker" rgb1=".3 .35 .4" rgb2=".6 .6 .55" width="64" height="64"/>
    <texture name="die" type="cube" builtin="flat" mark="cross" rgb1=".8 .2 .15" markrgb="1 1 1" width="64"
      height="64"/>
    <material name="tiles" texture="tiles" texrepeat="1 1" texuniform="true" reflectance=".15"/>
    <material name="die" texture="die"/>
    <material name="glaze" rgba=".1 .35 .3 1" specular="1" shininess=".9"/>
    <material name="brass" rgba=".9 .75 .4 1" metallic="1" roughness=".25"/>
    <hfield name="dune" nrow="20" ncol="20" size="1.5 1.5 .6 .1"/>
  </asset>
  <worldbody>
    <light type="directional" dir="-.4 .5 -.8" diffuse=".8 .8 .8"/>
    <geom type="plane" size="0 0 1" material="tiles"/>
    <geom type="hfield" hfield="dune" pos="-1.5 2.5 0" rgba=".75 .65 .45 1"/>
    <geom type="box" size=".4 .4 .4" pos="-.9 0 .4" euler="0 0 30" material="die"/>
    <geom type="ellipsoid" size=".5 .3 .6" pos=".3 .6 .6" material="glaze"/>
    <geom type="cylinder" size=".25 .35" pos="1.2 .1 .35" material="brass"/>
    <camera name="view" pos=".3 -3.6 1.7" xyaxes="1 0 0 0 .3 1" fovy="45"/>
  </worldbody>
</mujoco>
"""

parser = argparse.ArgumentParser()
parser.add_argument("model", nargs="?", help="an MJCF, URDF or MJB file; default: a small still life")
parser.add_argument("--camera", help="a camera of the model; default: its first, or a view of the whole model")
parser.add_argument("--out", help="save the image to this file")
options = parser.parse_args()

with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always", MirrorWarning)
    spec = mujoco.MjSpec.from_string(MODEL)
    dune = spec.hfield("dune")
    hills = np.hypot(*np.meshgrid(np.linspace(-2, 2, 20), np.linspace(-2, 2, 20)))
    dune.userdata = np.exp(-(hills**2)).ravel().tolist()
    mirror = sim.mirror(options.model or spec)
for warning in said:
    print(warning.message)

camera = options.camera or (0 if mirror.model.ncam else None)
if camera is None:
    centre, extent = mirror.model.stat.center, mirror.model.stat.extent
    camera = Viewpoint.looking_at(centre + extent * np.array([0.6, -1.2, 0.7]), centre)

width, height = (480, 360) if options.out else (64, 48)
ids = mirror.render_ids(camera, width, height)
wavelengths = np.linspace(430e-9, 660e-9, 8)
radiance = mirror.render(camera, width, height, "path", spp=64 if options.out else 4, wavelengths=wavelengths)
for geom in np.unique(ids[ids >= 0]):
    name = mirror.model.geom(geom).name or f"geom {geom}"
    spectrum = radiance[:, ids == geom].mean(axis=1)
    print(f"{name:<16} {np.mean(ids == geom):6.1%} of the image, radiance " + " ".join(f"{r:.3f}" for r in spectrum))

if options.out:
    from matplotlib.image import imsave

    from rhabdom.sim.scene.color import encode_srgb

    imsave(options.out, encode_srgb(np.clip(preview(radiance, wavelengths * 1e9), 0, 1)))
    print(f"drawn to         {options.out}")
