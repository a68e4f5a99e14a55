"""Small scenes with lights, as MuJoCo's XML, and the radiance of their mirrors."""

import mujoco
import numpy as np

import sim
from sim.scene.cameras import Viewpoint

NM = np.array([420.0, 505.0, 560.0, 631.0, 700.0])
LIGHT = '<light name="sun" type="directional" dir="0 0 -1" diffuse="1 1 1"/>'
WHITE = '<geom type="plane" size="5 5 1" rgba="1 1 1 1"/>'


def xml_of(lights, geoms, headlight=False):
    return f"""<mujoco><visual><headlight active="{int(headlight)}" ambient="0 0 0"/></visual>
    <worldbody>{lights}{geoms}</worldbody></mujoco>"""


def radiance(xml, origin=(0, 0, 5.0), target=(0, 0, 0), spp=4):
    """Return the radiance at NM around `target`."""
    mirror = sim.mirror(mujoco.MjModel.from_xml_string(xml))
    view = Viewpoint.looking_at(np.array(origin), np.array(target), fovy_deg=1.0)
    return mirror.render(view, 2, 2, spp=spp, wavelengths=NM * 1e-9).mean((1, 2))
