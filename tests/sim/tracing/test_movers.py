"""Intersections of rays with moving geoms, against MuJoCo's own ray caster."""

import drjit as dr
import mujoco
import numpy as np
import pytest

import sim
from optics import Eye
from sim.scene import variant
from sim.tracing import movers, primitives

SHAPES = {
    "sphere": '<geom type="sphere" size=".3"/>',
    "ellipsoid": '<geom type="ellipsoid" size=".4 .15 .25"/>',
    "capsule": '<geom type="capsule" size=".15 .3"/>',
    "cylinder": '<geom type="cylinder" size=".25 .2"/>',
    "box": '<geom type="box" size=".3 .15 .2"/>',
    "mesh": '<geom type="mesh" mesh="wedge"/>',
}
WEDGE = '<asset><mesh name="wedge" vertex="-.3 -.3 -.2  .4 -.3 -.2  0 .4 -.2  0 0 .4"/></asset>'
EYE = Eye(resolution=(24, 24), fov_deg=40, bands=1)
WORLDS = 6


def model_of(*shapes):
    bodies = "".join(
        f'<body name="b{i}" pos="{i * 0.5} 0 0"><freejoint/>{shape}</body>' for i, shape in enumerate(shapes)
    )
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><headlight active="0"/></visual>{WEDGE}<worldbody>
        <light type="directional" dir=".3 .2 -1"/><geom type="plane" size="9 9 .1" pos="0 0 -3"/>
        <camera name="eye" pos="0 -2.5 .4" xyaxes="1 0 0 0 .1 1"/>{bodies}</worldbody></mujoco>"""
    )


def posed(model, seed, spread=0.4):
    rng = np.random.default_rng(seed)
    data = mujoco.MjData(model)
    for k in range(model.nq // 7):
        data.qpos[7 * k : 7 * k + 3] += rng.uniform(-spread, spread, 3)
        quaternion = rng.normal(size=4)
        data.qpos[7 * k + 3 : 7 * k + 7] = quaternion / np.linalg.norm(quaternion)
    mujoco.mj_forward(model, data)
    return data


def cast(model, data, pupil, directions):
    """Return the depth along the axis of the points that MuJoCo's rays hit."""
    found, geom = np.empty(len(directions)), np.zeros(1, np.int32)
    for i, direction in enumerate(directions):
        found[i] = mujoco.mj_ray(model, data, pupil, direction, None, 1, -1, geom, None)
    return np.where(found < 0, np.inf, found)


def depths(model, datas):
    renderer = sim.ModelRenderer(model, EYE, [sim.Mount("eye")], max(len(datas), 1), sim.Fidelity(1, bands=1))
    pupils, frames = renderer.eye_frames(sim.Poses.from_data(datas))
    side = 2 * np.tan(np.radians(EYE.fov_deg) / 2) / EYE.resolution[1]
    row, column = np.indices(EYE.resolution)
    plane = np.stack([(column - 11.5) * side, (11.5 - row) * side, np.ones(row.shape)], axis=-1).reshape(-1, 3)
    expected = [
        cast(model, data, pupil[0], plane @ frame[0].T).reshape(EYE.resolution)
        for data, pupil, frame in zip(datas, pupils, frames, strict=True)
    ]
    return renderer.depth(datas)[:, 0], np.array(expected)


def agreement(found, expected):
    """Return the share of rays that hit the same geom, to 1e-4: ten times float32's rounding at a distance of 3 m."""
    return np.mean(np.isclose(found, expected, rtol=1e-4, atol=0))


@pytest.mark.parametrize("name", list(SHAPES))
def test_each_kind_is_met_where_mujoco_meets_it(name):
    """Hit points agree, except for single rays at a limb, where rounding decides."""
    model = model_of(SHAPES[name])
    datas = [posed(model, seed) for seed in range(WORLDS)]
    found, expected = depths(model, datas)
    assert 0.02 < np.mean(expected < 3.2) < 0.6
    assert agreement(found, expected) > 0.998


def test_all_kinds_together():
    model = model_of(*SHAPES.values(), *SHAPES.values())
    datas = [posed(model, seed, 0.8) for seed in range(WORLDS)]
    found, expected = depths(model, datas)
    assert agreement(found, expected) > 0.998


def kernels_of(look, datas):
    """Return the number of kernels in the first call, and its result. Work left by earlier code is finished before."""
    dr.eval()
    dr.sync_thread()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        found = look(datas)
        return sum(each["type"] == dr.KernelType.JIT for each in dr.kernel_history()), found


@pytest.mark.parametrize("what", ["depth", "signals"])
def test_on_a_gpu_meshes_have_kernels_of_their_own(monkeypatch, what):
    """OptiX, on a GPU, intersects one scene per kernel. The test simulates a GPU: results stay the same, and meshes
    need more kernels, but no more for three than for one.
    """
    launched, expected = {}, {}
    for gpu in (False, True):
        for place in (movers, variant):
            monkeypatch.setattr(place, "on_gpu", lambda gpu=gpu: gpu)
        for meshes in (1, 3):
            model = model_of(SHAPES["box"], *[SHAPES["mesh"]] * meshes)
            renderer = sim.ModelRenderer(model, EYE, [sim.Mount("eye")], 1, sim.Fidelity(1, bands=1))
            launched[gpu, meshes], found = kernels_of(getattr(renderer, what), [posed(model, 0)])
            np.testing.assert_array_equal(found, expected.setdefault(meshes, found))
    assert launched[False, 1] == launched[False, 3]
    assert launched[True, 1] == launched[True, 3]
    more = 2 if what == "signals" else 1  # once for rays, and once for the lamp's shadow
    assert (
        launched[True, 1] >= launched[False, 1] + 2 * more
    )  # kernels before the meshes, of the meshes, and after them


@pytest.mark.parametrize("name", ["ellipsoid", "capsule", "cylinder", "box"])
def test_other_shapes_do_not_agree(name, monkeypatch):
    """The mutants are a capsule without its ends, a cylinder without its lids, and an ellipsoid and a box of other
    sizes.
    """
    right = primitives.PRIMITIVES[name]

    def wrong(o, d, size):
        if name in ("capsule", "cylinder"):
            return primitives._into_side(o, d, size.x)
        return right.hit(o, d, size * 1.05)

    monkeypatch.setitem(primitives.PRIMITIVES, name, primitives.Primitive(wrong, right.normal))
    model = model_of(SHAPES[name])
    found, expected = depths(model, [posed(model, seed) for seed in range(WORLDS)])
    assert agreement(found, expected) < 0.99


def test_what_stands_still_hides_what_moves():
    model = mujoco.MjModel.from_xml_string("""<mujoco><visual><headlight ambient="0 0 0"/></visual><worldbody>
        <camera name="eye" pos="0 -2 0" xyaxes="1 0 0 0 0 1"/><geom type="box" size=".5 .1 .5" pos="0 -1 0"/>
        <body><freejoint/><geom size=".4"/></body>
        </worldbody></mujoco>""")
    found, expected = depths(model, [posed(model, 0, 0.1)])
    assert agreement(found, expected) > 0.998
    assert found[0, 12, 12] == pytest.approx(0.9, abs=1e-5)


def crowd(n, seed):
    """Return a model with n free meshes, from 5 mm to 0.5 m large, and random poses of it."""
    rng = np.random.default_rng(seed)
    meshes, bodies = "", ""
    for k in range(n):
        corners = rng.normal(size=(9, 3)) * np.exp(rng.uniform(np.log(0.005), np.log(0.3)))
        meshes += f'<mesh name="m{k}" vertex="{" ".join(map(str, corners.ravel()))}"/>'
        place = " ".join(map(str, rng.uniform([-1, 0, -0.6], [1, 4, 1.4])))
        bodies += f'<body pos="{place}"><freejoint/><geom type="mesh" mesh="m{k}"/></body>'
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><headlight active="0"/></visual><asset>{meshes}</asset><worldbody>
        <light type="directional" dir=".3 .2 -1"/><geom type="plane" size="9 9 .1" pos="0 0 -3"/>
        <camera name="eye" pos="0 -2.5 .4" xyaxes="1 0 0 0 .1 1"/>{bodies}</worldbody></mujoco>"""
    )
    return model, [posed(model, seed + i, 0.2) for i in range(2)]


@pytest.mark.parametrize("n", [1, 59, 150])
def test_any_number_of_meshes_is_met_where_mujoco_meets_them(n):
    model, datas = crowd(n, seed=n)
    found, expected = depths(model, datas)
    assert n == 1 or 0.1 < np.mean(expected < 3) < 0.9
    assert agreement(found, expected) > 0.998


def test_kernels_do_not_grow_with_the_number_of_meshes():
    """Kernels with one scene per mesh have ten times as many operations for 40 meshes as for two, and take minutes to
    compile for 128.
    """
    sizes = []
    for n in (2, 40):
        model, datas = crowd(n, seed=1)
        renderer = sim.ModelRenderer(model, EYE, [sim.Mount("eye")], 2, sim.Fidelity(1, bands=1))
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            renderer.signals(datas)
            kernels = [each for each in dr.kernel_history() if each["type"] == dr.KernelType.JIT]
        sizes.append(sum(kernel["operation_count"] for kernel in kernels))
    assert sizes[1] < 1.1 * sizes[0]


def still_and_moving(geom, assets="", wall='size=".1 900 900" pos="300 0 0"'):
    """Return models with a static and a movable geom 2 m ahead, along x, of an eye at the origin, and their data."""
    models = [
        mujoco.MjModel.from_xml_string(f"""<mujoco><visual><headlight active="0"/></visual>{assets}<worldbody>
            <light type="directional" dir="1 .5 -.5"/><body name="eye"/>
            <geom type="box" {wall}/>
            <body{mocap}>{geom}</body></worldbody></mujoco>""")
        for mocap in ("", ' mocap="true"')
    ]
    return models, [posed_as_is(model) for model in models]


def posed_as_is(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def coarse_ball():
    """Return a mesh with normals that MuJoCo smooths: neighbouring faces differ by less than a right angle."""
    polar, around = np.linspace(0, np.pi, 9)[1:-1], np.arange(14) * 2 * np.pi / 14
    rings = [[np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)] for p in polar for a in around]
    vertices = " ".join(map(str, np.ravel([*rings, [0, 0, 1], [0, 0, -1]])))
    return f'<asset><mesh name="ball" smoothnormal="true" vertex="{vertices}"/></asset>'


def test_a_smooth_mesh_is_shaded_alike_whether_it_moves_or_not():
    models, datas = still_and_moving('<geom type="mesh" mesh="ball" pos="4 0 0" euler="10 20 30"/>', coarse_ball())
    eye = Eye(resolution=(40, 40), fov_deg=30, bands=1)
    still, moving = (
        sim.ModelRenderer(model, eye, [sim.Mount("eye")], 1, sim.Fidelity(4, bands=1)).signals([data])
        for model, data in zip(models, datas, strict=True)
    )
    assert len(np.unique(still.round(3))) > 40  # the mesh has many shades
    np.testing.assert_allclose(moving, still, atol=2e-4)


PAINTED = """<asset>
    <texture name="flat" type="2d" builtin="checker" rgb1="1 .2 .2" rgb2=".2 .9 1" width="64" height="64"/>
    <texture name="cube" type="cube" builtin="checker" rgb1="1 .2 .2" rgb2=".2 .9 1" width="64" height="384"/>
    <hfield name="hills" nrow="3" ncol="3" size=".5 .4 .3 .1" elevation="0 1 0 1 0 1 0 1 .5"/>
    <material name="flat" texture="flat" texrepeat="3 2"/><material name="cube" texture="cube"/></asset>"""
TEXTURED = (
    '<geom type="plane" size=".6 .4 .1" material="flat"',
    '<geom type="plane" size="0 .5 .1" material="flat"',
    '<geom type="plane" size=".6 .4 .1" rgba=".2 .5 .9 1"',
    '<geom type="box" size=".4 .3 .2" material="cube"',
    '<geom type="box" size=".4 .3 .2" material="flat"',
    '<geom type="sphere" size=".4" material="flat"',
    '<geom type="capsule" size=".2 .3" material="cube"',
    '<geom type="hfield" hfield="hills" material="flat"',
)


@pytest.mark.parametrize("geom", TEXTURED)
def test_textures_and_planes_look_alike_whether_they_move_or_not(geom):
    """The same geom, once static and once movable, at a random pose. Rays at a limb or at a border of a texture may
    differ. The wall is small, because the error of texture coordinates on infinite planes grows with the model.
    """
    rng = np.random.default_rng(len(geom))
    pose = f'pos="2 {rng.uniform(-0.1, 0.1)} 0" euler="{rng.uniform(-30, 30)} {rng.uniform(-60, -30)} 20"/>'
    models, datas = still_and_moving(f"{geom} {pose}", PAINTED, 'size=".1 2 2" pos="4 0 0"')
    eye = Eye(resolution=(30, 30), fov_deg=30, bands=3)
    still, moving = (
        sim.ModelRenderer(model, eye, [sim.Mount("eye")], 1, sim.Fidelity(1, bands=3)).signals([data])
        for model, data in zip(models, datas, strict=True)
    )
    assert len(np.unique(still.round(3))) > 3
    assert np.mean(np.abs(moving - still) > 1e-3) < 0.02


def test_what_is_small_and_far_is_met_by_all_its_rays():
    """The ball of 5 cm is 100 m away. There, float32 resolves squared distances in steps of a third of the squared
    radius.
    """
    models, datas = still_and_moving('<geom name="far" size=".05" pos="100 3 2"/>')
    azimuth, elevation = np.degrees([np.arctan2(3, 100), np.arctan2(2, np.hypot(3, 100))])
    mount = sim.Mount("eye", azimuth_deg=float(azimuth), elevation_deg=float(elevation))
    seen = []
    for model, data in zip(models, datas, strict=True):
        renderer = sim.ModelRenderer(model, Eye(resolution=(40, 40), fov_deg=0.07, bands=1), [mount], 1)
        seen.append(renderer.ids([data])[0, 0] == model.geom("far").id)
    assert 600 < seen[0].sum() < 1100
    assert (seen[0] != seen[1]).sum() < 20  # rays at the limb
