"""Worlds of equal content: what depends on the world alone is computed once, and follows changes of the model."""

import copy

import mujoco
import numpy as np
import pytest

import optics
from sim.scene.coincident import coincidences
from sim.tracing.model_scene import ModelScene
from sim.tracing.walls import walls_of
from sim.worlds.world import build_world

EYE = optics.Eye(resolution=(4, 4), fov_deg=45)


def parts(model):
    """Return the walls of a model, and coincidences of its geoms."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    static = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] == 0]
    return walls_of(model, static, np.array([0.1])), coincidences(data, static)


def test_equal_worlds_share_what_depends_on_the_world_alone():
    first, again, other = (build_world("maze", seed=seed) for seed in (4, 4, 5))
    assert first.model is not again.model
    assert first.alone.model is again.alone.model
    for one, same, different in zip(*(parts(world.model) for world in (first, again, other)), strict=True):
        assert one is same
        assert one is not different


def test_a_changed_model_has_its_own_walls():
    world = build_world("maze", seed=4)
    before, _ = parts(world.model)
    changed = copy.copy(world.model)
    (geom,) = before.geoms[:1]
    changed.geom_size[geom, 0] *= 0.5
    after, _ = parts(changed)
    assert after.upper[0, 0] - after.lower[0, 0] == pytest.approx(0.5 * (before.upper[0, 0] - before.lower[0, 0]))
    assert not world.alone.stands_for(changed)
    with pytest.raises(ValueError, match="read-only"):
        before.top[0] = 0


def test_walls_follow_the_height_of_the_eyes():
    model = build_world("maze", seed=4).model
    static = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] == 0]
    top = walls_of(model, static, np.array([0.1])).top.min()
    with pytest.raises(ValueError, match="ends below the eyes"):
        walls_of(model, static, np.array([0.1, top]))
    with pytest.raises(ValueError, match="not above the floor"):
        walls_of(model, static, np.array([0.0, 0.1]))


MOVABLE = """
<mujoco>
  <worldbody>
    <geom type="box" size=".1 .1 .1"/>
    <body mocap="true" pos="1 0 0"><geom type="box" size=".1 .1 .1"/></body>
  </worldbody>
</mujoco>
"""


def test_geoms_that_move_to_the_same_place_coincide_there():
    model = mujoco.MjModel.from_xml_string(MOVABLE)
    found = []
    for place in (1.0, 0.0, 1.0):
        data = mujoco.MjData(model)
        data.mocap_pos[0, 0] = place
        mujoco.mj_forward(model, data)
        found.append(coincidences(data, [0, 1]).pairs)
    assert found == [(), ((0, 1),), ()]


SURFACES = """
<mujoco>
  <asset>
    <texture name="t" type="2d" builtin="checker" width="8" height="8" rgb1="1 0 0" rgb2="0 1 0"/>
    <material name="t" texture="t" texuniform="true"/><material name="u" texture="t" rgba=".5 1 1 1"/>
    <texture name="v" type="2d" builtin="checker" width="8" height="8" rgb1="0 0 1" rgb2="0 1 0"/>
    <material name="v" texture="v" texuniform="true"/>
    <texture name="w" type="cube" builtin="checker" width="8" height="8" rgb1="0 0 1" rgb2="0 1 0"/>
    <material name="w" texture="w"/>
    <mesh name="tetrahedron" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
  </asset>
  <worldbody>
    <light dir="0 0 -1"/>
    <geom name="floor" type="plane" size="4 4 .1" material="t"/>
    <geom name="wide floor" type="plane" size="8 4 .1" pos="0 0 -1" material="t"/>
    <geom name="box" type="box" size=".1 .2 .3" material="t"/>
    <geom name="large box" type="box" size=".4 .5 .6" pos="2 0 1" material="t"/>
    <geom name="blue box" type="box" size=".1 .2 .3" pos="-2 0 1" material="t" rgba="0 0 1 1"/>
    <geom name="other box" type="box" size=".1 .2 .3" pos="-2 0 1" material="u"/>
    <geom name="box of another material" type="box" size=".1 .2 .3" pos="-4 0 1" material="v"/>
    <geom name="red wall" type="plane" size="1 1 .1" pos="6 0 1" rgba="1 0 0 1"/>
    <geom name="red box" type="box" size=".1 .2 .3" pos="8 0 1" rgba="1 0 0 1"/>
    <geom name="plane without its cube texture" type="plane" size="1 1 .1" pos="10 0 1" material="w"/>
    <geom name="mesh with a cube texture" type="mesh" mesh="tetrahedron" pos="12 0 1" material="w"/>
    <geom name="grey" type="sphere" size=".1" pos="0 2 1"/>
    <geom name="small grey" type="sphere" size=".05" pos="0 3 1"/>
    <geom name="painted grey" type="sphere" size=".1" pos="0 4 1"/>
  </worldbody>
</mujoco>
"""


def test_equal_surfaces_share_a_bsdf():
    model = mujoco.MjModel.from_xml_string(SURFACES)
    scene = ModelScene(model, EYE, varied=("painted grey",))
    bsdfs = {model.geom(look.geom).name: bsdf for look, bsdf in scene.bsdfs.items()}
    assert bsdfs["box"] is bsdfs["large box"]
    assert bsdfs["grey"] is bsdfs["small grey"]
    shared = {"large box", "small grey"}  # a plane and a box of one colour differ, because a plane is open
    assert len({id(bsdf) for name, bsdf in bsdfs.items() if name not in shared}) == len(bsdfs) - len(shared)


def test_a_maze_has_a_bsdf_for_each_kind_of_surface():
    model = build_world("maze", seed=4, mazes=3).model
    scene = ModelScene(model, EYE)
    assert len(scene.bsdfs) > 100
    assert len({id(bsdf) for bsdf in scene.bsdfs.values()}) < 10
