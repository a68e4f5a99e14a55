"""The mirror's geometry against MuJoCo's own ray casting and renderer, and its messages about models and input.

The tests detect these errors, each tried separately: camera mirrored (diag(1, 1, -1)), field of view taken as
horizontal, poses transposed, open cylinders, a capsule's caps at one end, an ellipsoid's quaternion with its real part
first, meshes not rotated, sync without effect.
"""

import warnings

import mujoco
import numpy as np
import pytest

import sim
from sim.scene.cameras import Viewpoint
from sim.scene.mirror import MirrorWarning

from . import models
from .drawn import draw
from .lit import LIGHT, NM, WHITE, xml_of
from .oracle import assert_agrees, camera_hits, first_hits


@pytest.mark.parametrize("textured", [False, True], ids=["exact", "tessellated"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_kind_of_geom_agrees_with_mujoco(seed, textured):
    model = models.every_kind(seed, textured)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ids = assert_agrees(sim.mirror(model, data), model, data, "camera", 200, 150, limb_share=1e-3)
    assert len(np.unique(ids)) >= 13  # nearly all geoms are in view


def test_scalar_variant_sees_the_same():
    model = models.every_kind(3)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scalar, llvm = sim.mirror(model, data, variant="scalar_spectral"), sim.mirror(model, data)
    assert_agrees(scalar, model, data, "camera", 48, 36)
    lit = every_kind_in_the_light(3)
    scalar, llvm = sim.mirror(lit, variant="scalar_spectral"), sim.mirror(lit)
    pictures = [m.render("camera", 16, 12, spp=64, wavelengths=NM * 1e-9) for m in (scalar, llvm)]
    # These are two independent sets of 64 jittered samples of an image with edges.
    assert np.sqrt(np.mean((pictures[0] - pictures[1]) ** 2)) < 0.05 * pictures[1].max()
    np.testing.assert_allclose(pictures[0].mean((1, 2)), pictures[1].mean((1, 2)), rtol=0.02)


def every_kind_in_the_light(seed):
    spec = mujoco.MjSpec.from_string(xml_of(LIGHT, '<geom type="plane" size="0 0 1" rgba="1 1 1 1"/>'))
    models.add_camera(spec, [0, -4.0, 2.0], np.zeros(3))
    spec.worldbody.add_geom(type=models.GEOM.mjGEOM_SPHERE, size=[0.5, 0, 0], pos=[0, 0, 0.5], rgba=[0.9, 0.2, 0.1, 1])
    return spec.compile()


@pytest.mark.parametrize("task", sim.TASKS)
def test_task_worlds_agree_from_the_eyes(task):
    world = sim.build_world(
        task, seed=1, eyes=sim.Eyes(n_eyes=3, resolution=(60, 80), fov_deg=70, placement_range_deg=200)
    )
    model, data = world.model, mujoco.MjData(world.model)
    # MuJoCo's rays would hit the surface on which they start. Mitsuba's rays, like the eyes', look outwards from it.
    mirror, rng, kinds = sim.mirror(model), np.random.default_rng(0), set()
    for _ in range(3):
        data.qpos[:2] = world.agent_spawn[rng.integers(len(world.agent_spawn))]
        data.qpos[2] = rng.uniform(-np.pi, np.pi)
        for i in range(len(world.objects)):
            data.mocap_pos[i, :2] = world.object_spawn[rng.integers(len(world.object_spawn))]
        mujoco.mj_forward(model, data)
        mirror.sync(data)
        for name in ("left", "center", "right"):
            kinds |= set(np.unique(assert_agrees(mirror, model, data, name, 80, 60, model.body("agent").id)))
    assert model.geom("floor").id in kinds


def test_sync_moves_geoms_camera_and_light():
    model = models.every_kind(4, mocap=True)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mirror = sim.mirror(model, data)
    before = assert_agrees(mirror, model, data, "camera", 120, 90)
    rng = np.random.default_rng(5)
    data.mocap_pos += rng.uniform(-0.3, 0.3, data.mocap_pos.shape)
    planes = np.array([kind == models.GEOM.mjGEOM_PLANE for kind, _ in 2 * models.KINDS])
    data.mocap_quat[~planes] = [models.random_quat(rng) for _ in range(int(np.sum(~planes)))]
    mujoco.mj_forward(model, data)
    mirror.sync(data)
    after = assert_agrees(mirror, model, data, "camera", 120, 90)
    assert np.mean(before != after) > 0.05


def test_between_two_syncs_everything_stays_where_it_was():
    """A camera on a falling body, its headlight, and the world change only with `sync`."""
    model = mujoco.MjModel.from_xml_string("""
        <mujoco><visual><headlight ambient="0 0 0"/></visual><worldbody>
          <geom type="plane" size="5 5 .1"/><geom size=".3" pos="0 2 1" rgba=".9 .2 .1 1"/>
          <body pos="0 -1 1.5"><freejoint/><geom size=".1"/>
            <camera name="head" pos="0 .2 0" xyaxes="1 0 0 0 0 1"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mirrored = sim.mirror(model)
    mirrored.sync(data)

    def seen():
        return mirrored.render("head", 16, 12, spp=2), mirrored.render_ids("head", 16, 12), mirrored.viewpoint("head")

    before = seen()
    data.qvel[3] = 2
    mujoco.mj_step(model, data, 100)
    after = seen()
    for one, other in zip(before[:2], after[:2], strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(before[2].position, after[2].position)
    mirrored.sync(data)
    np.testing.assert_array_equal(mirrored.viewpoint("head").position, data.camera("head").xpos)
    assert not np.array_equal(seen()[1], before[1])


def test_what_cannot_be_mirrored_is_named_once():
    xml = """<mujoco><visual><headlight ambient="0.1 0.1 0.1" diffuse="0 0 0"/></visual><asset>
    <texture name="sky" type="skybox" builtin="flat" rgb1="1 1 1" width="8" height="48"/>
    <texture name="sky2" type="skybox" builtin="flat" width="8" height="48"/>
    <texture name="cube" type="cube" builtin="flat" width="8" height="48"/>
    <texture name="bumps" type="2d" builtin="flat" width="8" height="8"/>
    <material name="cubic" texture="cube"/>
    <material name="rough"><layer role="normal" texture="bumps"/></material></asset>
    <worldbody>
    <light name="lamp" pos="0 0 3" attenuation="1 0 0" castshadow="false" ambient="1 1 1" bulbradius="0.3"/>
    <light name="off" active="false" castshadow="false"/>
    <geom name="ground" type="plane" size="0 0 1" material="cubic"/><geom name="ball" size="1" material="rough"/>
    <geom name="hidden" size="1" material="cubic" group="3"/>
    <site name="seen" size="0.1"/><site name="unseen" size="0.1" group="4"/>
    <body pos="2 0 0"><freejoint/><geom size="0.1"/><site name="end"/></body></worldbody>
    <tendon><spatial><site site="seen"/><site site="end"/></spatial></tendon></mujoco>"""
    with pytest.warns(MirrorWarning) as caught:
        mirror = sim.mirror(xml)
    (message,) = (str(w.message) for w in caught)
    for words in (
        "cube texture on plane geom 'ground'",
        "normal texture of material 'rough'",
        "1 more skyboxes",
        "light of the sky below 360 nm",
        "haze",
        "2 sites",
        "1 tendon",
        "ambient part of the headlight",
        "ambient part of 'lamp'",
        "attenuation of 'lamp'",
        "bulbradius = 0.3 of 'lamp'",
    ):
        assert words in message
    assert message.count(";") == 10
    assert list(mirror.geoms) == [0, 1, 3]


def test_a_model_that_can_be_mirrored_wholly_is_mirrored_without_a_word():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sim.mirror(xml_of(LIGHT, WHITE))
        sim.mirror(models.every_kind(0, textured=True, kinds=models.KINDS + models.SDF))


def test_invisible_geoms_and_other_bodies_are_left_out():
    xml = """<mujoco><worldbody><geom name="a" type="sphere" size="1"/>
    <geom name="b" type="sphere" size="1" rgba="1 1 1 0"/><geom name="c" type="sphere" size="1" group="3"/>
    <body name="box"><geom name="d" type="box" size="1 1 1"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(
        xml.replace("<worldbody>", "<visual><headlight active='0'/></visual><worldbody>")
    )
    assert list(sim.mirror(model).geoms) == [0, 3]
    assert list(sim.mirror(model, groups=(3,)).geoms) == [2]
    assert list(sim.mirror(model, bodies=["box"]).geoms) == [3]


@pytest.mark.parametrize("target", [[1.0, 2.0, 3.0], [1e200, 0.0, 0.0], [0.0, 0.0], [np.nan, 0.0, 0.0]])
def test_viewpoints_need_two_points(target):
    with pytest.raises(ValueError, match=r"^target = .*: must (differ from the origin|be a point, three numbers)"):
        Viewpoint.looking_at([1.0, 2.0, 3.0], target)


def test_bad_input_is_named():
    model = mujoco.MjModel.from_xml_string(xml_of(LIGHT, WHITE))
    mirror = sim.mirror(model)
    with pytest.raises(ValueError, match="no camera None; the model has"):
        mirror.render(None, 4, 4)
    for strange in ("pathtracer", "diffuse", {"type": "path", "max_dept": 3}):
        with pytest.raises(
            ValueError, match=r"integrator = .*: must be one of Mitsuba's, such as 'path'; its message: "
        ):
            mirror.render(Viewpoint(np.zeros(3), np.eye(3), 45.0), 4, 4, integrator=strange)
    for strange in (None, {"spp": 3}):
        with pytest.raises(ValueError, match=r"integrator = .*: must be a name, or a description such as"):
            mirror.render(Viewpoint(np.zeros(3), np.eye(3), 45.0), 4, 4, integrator=strange)
    with pytest.raises(ValueError, match="no camera 'eye_9'"):
        mirror.render("eye_9", 4, 4)
    with pytest.raises(ValueError, match="width = 0"):
        mirror.render_ids(Viewpoint(np.zeros(3), np.eye(3), 45.0), 0, 4)
    with pytest.raises(ValueError, match="light samples"):
        mirror.render(Viewpoint(np.zeros(3), np.eye(3), 45.0), 4, 4, {"type": "direct", "emitter_samples": 4})
    for nowhere in ((450, 550, 650), (5e-7, 2e-7), (), 5e-7, (np.nan,)):
        with pytest.raises(ValueError, match=r"wavelengths = .*: must be in metres, from 3e-07 to 7.8e-07"):
            mirror.render(Viewpoint(np.zeros(3), np.eye(3), 45.0), 4, 4, wavelengths=nowhere)
    with pytest.raises(ValueError, match="no body 'arm'"):
        sim.mirror(model, bodies=["arm"])
    with pytest.raises(ValueError, match="llvm_ad_rgb"):
        sim.mirror(model, variant="llvm_ad_rgb")
    with pytest.raises(ValueError, match="no visible geom"):
        sim.mirror(model, groups=(5,))


def test_the_callers_variant_stays_in_force():
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    try:
        sim.mirror(mujoco.MjModel.from_xml_string(xml_of(LIGHT, WHITE)))
        assert mi.variant() == "scalar_rgb"
    finally:
        mi.set_variant("llvm_ad_spectral")


def test_geom_ids_agree_with_mujocos_renderer():
    """The oracle's rays and the mirror agree with pixels that MuJoCo renders. Signed distance fields are rendered as
    meshes, which rays do not hit.
    """
    model = models.every_kind(0, kinds=models.KINDS + models.SDF)
    model.vis.quality.numslices = model.vis.quality.numstacks = 100
    model.vis.map.zfar = 1e4  # so that the floor reaches to the horizon
    pictures = draw([model], 200, 150)
    if pictures is None:
        pytest.skip("no OpenGL context: compared with MuJoCo's ray casting alone")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drawn, (ids, _) = pictures[1][0], camera_hits(model, data, "camera", 200, 150)
    meshes = np.isin([ids, drawn], np.flatnonzero(model.geom_type == models.GEOM.mjGEOM_SDF)).any(axis=0)
    assert np.mean((drawn == ids)[~meshes]) >= 0.995
    assert meshes.mean() > 0.01
    assert np.mean(drawn == sim.mirror(model, data).render_ids("camera", 200, 150)) >= 0.995


def test_a_camera_inside_bodies_looks_out_of_them():
    """MuJoCo also renders outer sides only: the camera looks through a head and a helmet, but not through the back of a
    wall.
    """
    ball = '<geom name="ball" size="0.5" pos="4 0 0" rgba="0.8 0.8 0.8 1"/>'
    around = '<geom name="head" size="0.2"/><geom name="helmet" type="box" size="0.4 0.3 0.3"/>'
    wall = '<geom name="wall" type="plane" size="5 5 1" pos="2 0 0" zaxis="1 0 0"/>'
    light = LIGHT.replace("0 0 -1", "0.6 0 -0.8")  # so that the light passes the head
    view = Viewpoint.looking_at(np.zeros(3), np.array([1.0, 0, 0]), 5.0)
    for variant in ("llvm_ad_spectral", "scalar_spectral"):
        mirror = sim.mirror(xml_of(light, around + ball), variant=variant)
        assert (mirror.render_ids(view, 4, 4) == 2).all()
        np.testing.assert_allclose(mirror.render_depth(view, 4, 4), 3.5, atol=0.03)
        alone = sim.mirror(xml_of(light, ball), variant=variant).render(view, 4, 4, wavelengths=[560e-9])
        assert alone.min() > 0.2
        np.testing.assert_allclose(mirror.render(view, 4, 4, wavelengths=[560e-9]), alone, rtol=1e-3)
    assert (sim.mirror(xml_of("", around + wall + ball)).render_ids(view, 4, 4) == 2).all()


def test_viewpoint_looks_where_it_is_told():
    model = models.every_kind(0)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = Viewpoint.looking_at(np.array([3.0, 2.0, 2.5]), np.array([0, 0, 0.7]), 40.0)
    ids, _ = first_hits(model, data, view.position, view.rotation, 40.0, 80, 60)
    assert np.mean(sim.mirror(model, data).render_ids(view, 80, 60) == ids) >= 0.995
