"""Labels of each receptor: the geom that it sees, its optic flow, and their export as tensors.

The references are MuJoCo's own rays for the geoms, and closed forms for the motion on the retina.
"""

import mujoco
import numpy as np
import pytest
import torch

import optics
import sim
from sim.eyes.tangent_plane import directions_of
from sim.render.optic_flow import receptor_centres
from tests.sim.render.test_model_renderer import MODEL, posed

EYE = optics.Eye(resolution=(17, 21), fov_deg=60, bands=3)
ONE_RAY = sim.Fidelity(1, bands=3)
MOUNTS = (sim.Mount("side"), sim.Mount("side", azimuth_deg=15, elevation_deg=5))
WALL = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <worldbody>
    <light type="directional" dir="1 0 -1"/>
    <geom name="wall" type="plane" size="50 50 .1" pos="{far} 0 0" zaxis="-1 0 0"/>
    <body name="eye"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
      <joint type="hinge" axis="0 0 1"/><geom size=".01" pos="-1 0 0"/></body>
    <body name="ball" pos="1.2 0 0"><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="1 0 0"/>
      <geom name="ball" size=".15"/></body>
  </worldbody>
</mujoco>"""
FAR = 2.0


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(MODEL)


def test_ids_are_those_that_mujocos_rays_meet(model):
    datas = [posed(model, angle) for angle in (0.0, 1.5, 3.0)]
    renderer = sim.ModelRenderer(model, EYE, MOUNTS, 3, ONE_RAY)
    found = renderer.ids(datas)
    assert found.shape == (3, 2, *EYE.resolution)
    assert found.dtype == np.int32
    pupils, frames = renderer.eye_frames(sim.Poses.from_data(datas))
    geom, expected = np.zeros(1, np.int32), np.empty(found.shape, int)
    centres = directions_of(EYE, receptor_centres(EYE))
    for w, e, r in np.ndindex(3, 2, len(centres)):
        mujoco.mj_ray(model, datas[w], pupils[w, e], (frames[w, e] @ centres[r]).astype(float), None, 1, -1, geom)
        expected[w, e].ravel()[r] = geom[0]
    assert len(np.unique(expected)) >= 8
    assert -1 in expected
    assert (found == expected).mean() > 0.999
    np.testing.assert_array_equal(found < 0, ~np.isfinite(renderer.depth(datas)))


def test_ids_where_nothing_stands_still_and_where_nothing_moves():
    lit = '<visual><headlight active="0"/></visual><worldbody><light type="directional" dir="0 0 -1"/>'
    free = f"<mujoco>{lit}{{}}</worldbody></mujoco>"
    ball = '<body name="b"><freejoint/><geom size=".1" pos="1 0 0"/><geom size=".1" pos="1 .3 0"/></body>'
    post = '<body name="b"/><geom type="box" size=".1 .1 .1" pos="1 0 0"/><geom size=".1" pos="1 .3 0"/>'
    for text in (ball, post):
        one = mujoco.MjModel.from_xml_string(free.format(text))
        data = mujoco.MjData(one)
        mujoco.mj_forward(one, data)
        seen = sim.ModelRenderer(one, EYE, [sim.Mount("b")], 1, ONE_RAY).ids([data])[0, 0]
        assert seen[8, 10] == 0
        assert set(np.unique(seen)) == {-1, 0, 1}
        assert np.argwhere(seen == 1)[:, 1].max() < 10  # to the left


def at(model, ahead=0.0, left=0.0, turned=0.0, ball=0.0, spin=0.0):
    data = mujoco.MjData(model)
    data.qpos[:] = ahead, left, turned, ball, spin
    mujoco.mj_forward(model, data)
    return data


@pytest.fixture(scope="module")
def wall():
    model = mujoco.MjModel.from_xml_string(WALL.format(far=FAR))
    return model, sim.ModelRenderer(model, EYE, [sim.Mount("eye")], 1, ONE_RAY)


def closed_form(where, there):
    """Return the displacements (2, height, width) [receptors] on the retina of points (right, down, ahead) between two
    states.
    """
    side = EYE.receptor_pitch / EYE.sensor_distance
    x, y = np.moveaxis(receptor_centres(EYE).reshape(*EYE.resolution, 2) * side, -1, 0)
    moved = np.array(there(where * x, where * y, where * np.ones_like(x)))
    return (moved[:2] / moved[2] - [x, y]) / side


@pytest.mark.parametrize(
    ("later", "there"),
    [
        ({"ahead": 0.25}, lambda x, y, z: (x, y, z - 0.25)),
        ({"left": 0.1}, lambda x, y, z: (x + 0.1, y, z)),
        (
            {"turned": 0.1},
            lambda x, y, z: (x * np.cos(0.1) + z * np.sin(0.1), y, z * np.cos(0.1) - x * np.sin(0.1)),
        ),
    ],
    ids=["towards the wall", "along it", "turning"],
)
def test_flow_before_a_wall_is_the_closed_form(wall, later, there):
    model, renderer = wall
    before, after = at(model), at(model, **later)
    found, onto_wall = renderer.flow([before], [after])[0, 0], renderer.ids([before])[0, 0] == model.geom("wall").id
    assert 0.8 < onto_wall.mean() < 1  # the rest is the ball
    expected = closed_form(FAR, there)
    np.testing.assert_allclose(found[:, onto_wall], expected[:, onto_wall], atol=2e-3)
    assert np.abs(expected).max() > 0.5


def test_what_moves_by_itself_is_carried_along(wall):
    model, renderer = wall
    before, after = at(model), at(model, ball=0.2)
    found, on_ball = renderer.flow([before], [after])[0, 0], renderer.ids([before])[0, 0] == model.geom("ball").id
    side = EYE.receptor_pitch / EYE.sensor_distance
    expected = -0.2 / renderer.depth([before])[0, 0][on_ball] / side  # up
    np.testing.assert_allclose(found[1][on_ball], expected, rtol=1e-3)
    assert on_ball.sum() > 20
    np.testing.assert_allclose(found[:, ~on_ball], 0, atol=1e-4)


def test_what_spins_goes_round(wall):
    """A ball in front of the eye rotates about the eye's own axis."""
    model, renderer = wall
    before, after = at(model), at(model, spin=-0.4)
    found, on_ball = renderer.flow([before], [after])[0, 0], renderer.ids([before])[0, 0] == model.geom("ball").id
    x, y = receptor_centres(EYE).T.reshape(2, *EYE.resolution)
    c, s = np.cos(0.4), np.sin(0.4)
    expected = np.array([c * x + s * y - x, c * y - s * x - y])
    np.testing.assert_allclose(found[:, on_ball], expected[:, on_ball], atol=1e-3)
    assert np.abs(expected[:, on_ball]).max() > 0.5


def test_there_is_no_flow_of_nothing_or_behind(wall, model):
    walled, renderer = wall
    assert np.isnan(renderer.flow([at(walled)], [at(walled, turned=np.pi)])).all()
    datas = [posed(model, 0.0), posed(model, 0.1)]
    renderer = sim.ModelRenderer(model, EYE, MOUNTS, 1, ONE_RAY)
    flow = renderer.flow(datas[:1], datas[1:])
    np.testing.assert_array_equal(np.isnan(flow[:, :, 0]), renderer.ids(datas[:1]) < 0)
    with pytest.raises(ValueError, match="poses of 2 worlds"):
        renderer.flow(datas[:1], datas)


TERRAIN = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <asset><hfield name="hills" nrow="9" ncol="13" size="2 1.5 .8 .2"/></asset>
  <worldbody>
    <light type="directional" dir="0 0 -1"/>
    <geom name="still" type="hfield" hfield="hills" pos="3 0 -.5"/>
    <body name="raft" pos="3 3 -.5"><joint type="hinge" axis="0 0 1"/><joint type="slide" axis="0 1 .3"/>
      <geom name="raft" type="hfield" hfield="hills"/></body>
    <body name="eye" pos="0 1 .8"/>
  </worldbody>
</mujoco>"""


def test_height_fields_are_met_where_mujocos_rays_meet_them():
    """One height field is static and one moves, in three poses."""
    model = mujoco.MjModel.from_xml_string(TERRAIN)
    model.hfield_data[:] = np.random.default_rng(0).uniform(0, 1, model.hfield_data.shape)
    datas = []
    for turn in (0.0, 0.7, 2.0):
        datas.append(mujoco.MjData(model))
        datas[-1].qpos[:] = turn, turn / 3
        mujoco.mj_forward(model, datas[-1])
    eye = optics.Eye(resolution=(40, 60), fov_deg=100, bands=3)
    renderer = sim.ModelRenderer(model, eye, [sim.Mount("eye", azimuth_deg=10, elevation_deg=-12)], 3, ONE_RAY)
    ids, depth = renderer.ids(datas), renderer.depth(datas)
    pupils, frames = renderer.eye_frames(sim.Poses.from_data(datas))
    geom, centres, right = np.zeros(1, np.int32), directions_of(eye, receptor_centres(eye)), []
    for w, r in np.ndindex(3, len(centres)):
        far = mujoco.mj_ray(model, datas[w], pupils[w, 0], (frames[w, 0] @ centres[r]).astype(float), None, 1, -1, geom)
        near = np.isinf(depth[w, 0].flat[r]) if far < 0 else abs(depth[w, 0].flat[r] - far * centres[r, 2]) < 1e-3
        right.append(ids[w, 0].flat[r] == geom[0] and near)
    assert np.mean(right) >= 0.995
    assert {*np.unique(ids)} == {-1, 0, 1}


def test_signals_are_tensors_without_a_copy(model):
    renderer = sim.ModelRenderer(model, EYE, MOUNTS, 1, ONE_RAY)
    signals = renderer.signals([posed(model, 0.0)])
    for tensor in (torch.from_dlpack(signals), torch.from_numpy(signals)):
        assert tensor.data_ptr() == signals.ctypes.data
        assert tensor.shape == signals.shape
    tensor += 1
    assert signals.min() >= 1
    kept = signals.copy()
    renderer.signals([posed(model, 1.0)])  # later frames do not overwrite earlier ones
    np.testing.assert_array_equal(signals, kept)


def test_what_environments_return_are_tensors_without_a_copy():
    env = sim.make_vec_env("detection", sim.Eyes(n_eyes=1), n_envs=2, rays_per_receptor=1, auxiliary=("depth", "flow"))
    for name, array in env.reset().items():
        assert torch.from_dlpack(array).data_ptr() == array.ctypes.data, name
    signals = env.renderer.signals(env.state)
    assert torch.from_dlpack(signals).data_ptr() == signals.ctypes.data
