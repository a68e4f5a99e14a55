"""Rooms with an object whose shape, size and colour may vary, seen by a cart on a rail."""

from tests.sim.envs.rail import OnRail

SHAPES = {
    "sphere": 'size=".3"',
    "capsule": 'fromto="0 -.2 0 0 .2 .1" size=".15"',
    "cylinder": 'size=".2 .3" euler="30 40 0"',
    "ellipsoid": 'size=".3 .3 .2"',
    "box": 'size=".2 .3 .1" euler="20 0 30"',
}
ROOM = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <option timestep=".01"/>
  <asset>
    <texture name="stripes" type="2d" builtin="checker" rgb1=".9 .9 .9" rgb2=".2 .2 .2" width="32" height="32"/>
    <material name="stripes" texture="stripes" texrepeat="4 4"/>
  </asset>
  <worldbody>
    <light type="directional" dir="-.3 -.4 -1" diffuse=".9 .9 .9"/>
    <geom name="floor" type="plane" size="6 3 .1" {floor}/>
    <geom name="post" type="box" size=".1 .1 .4" pos="3 1 .4" rgba=".2 .6 .3 1"/>
    <body name="cart" pos="0 0 .4">
      <joint name="rail" type="slide" axis="0 1 0" damping="1"/>
      <geom type="box" size=".15 .2 .1" rgba=".2 .4 .8 1" mass="1"/>
    </body>
    <body name="thing" pos="2 0 .6"><freejoint name="flight"/>
      <geom name="thing" type="{kind}" {shape} rgba="{rgb} 1"/></body>
    <body name="lamp" mocap="true" pos="1 2 .3"><geom size=".1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><velocity joint="rail" kv="10" ctrlrange="-2 2"/></actuator>
</mujoco>"""
FLOOR, RED = 'rgba=".3 .3 .3 1"', ".9 .2 .1"


def room(kind="sphere", shape=SHAPES["sphere"], rgb=RED, floor=FLOOR):
    return ROOM.format(kind=kind, shape=shape, rgb=rgb, floor=floor)


class Room(OnRail):
    model = room()


def with_ranges(vary, model=None):
    task = Room()
    task.vary, task.model = vary, room() if model is None else model
    return task
