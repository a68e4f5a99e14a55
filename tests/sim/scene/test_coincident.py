"""Geoms in the same place: the one that is defined last is visible, as in MuJoCo, on every path to an image.

Without a rule, rounding decides: boxes show the first geom, spheres the last one, and cylinders a speckle.
"""

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.pictures.quick_camera import QuickCamera
from sim.scene.coincident import coincidences

from .drawn import draw

BALL = np.random.default_rng(5).normal(size=(60, 3))
BALL *= 0.3 / np.linalg.norm(BALL, axis=1, keepdims=True)
SHARP = np.random.default_rng(6).normal(size=(12, 3)) * 0.25
CUBE = np.stack(np.meshgrid([-0.3, 0.3], [-0.2, 0.2], [-0.25, 0.25]), axis=-1).reshape(-1, 3)


def _mesh(name, vertices, more=""):
    return f'<mesh name="{name}" {more} vertex="{" ".join(map(str, vertices.ravel()))}"/>'


ASSETS = f"""<asset>{_mesh("ball", BALL, 'smoothnormal="true"')}{_mesh("sharp", SHARP)}{_mesh("cube", CUBE)}
    <hfield name="hills" nrow="3" ncol="3" size=".4 .4 .3 .1" elevation="0 1 0 1 0 1 0 1 .5"/>
    <texture name="white" type="cube" builtin="flat" rgb1="1 1 1" width="8" height="48"/>
    <material name="white" texture="white"/></asset>"""
KINDS = {
    "box": 'type="box" size=".3 .2 .25"',
    "painted box": 'type="box" size=".3 .2 .25" material="white"',
    "sphere": 'type="sphere" size=".3"',
    "ellipsoid": 'type="ellipsoid" size=".3 .2 .4"',
    "capsule": 'type="capsule" size=".2 .2"',
    "cylinder": 'type="cylinder" size=".25 .2"',
    "plane": 'type="plane" size=".5 .4 .1"',
    "ball": 'type="mesh" mesh="ball"',
    "sharp": 'type="mesh" mesh="sharp"',
    "cube": 'type="mesh" mesh="cube"',
    "hfield": 'type="hfield" hfield="hills"',
    "sdf": 'type="sdf" mesh="ball"',
}
SAME = [(kind, kind) for kind in KINDS] + [
    ("box", "cube"),
    ("cube", "box"),
    ("painted box", "box"),
    ("ball", "sdf"),
    ("sdf", "ball"),
]
BODIES = ("still", "one body", "two bodies")
EVERYWHERE = ("box", "sphere", "ball", "sdf")  # kinds that are tested in all bodies: shapes, meshes and what is neither
ARRANGED = [
    pytest.param(kinds, bodies, id=f"{kinds[0]} and {kinds[1]}-{bodies}")
    for number, kinds in enumerate(SAME)
    for turn, bodies in enumerate(BODIES)
    if (kinds[0] == kinds[1] and kinds[0] in EVERYWHERE) or turn == number % len(BODIES)
]
RED, BLUE = "1 .1 .1 1", ".1 .1 1 1"
FOV = 30.0


def model_of(first, last, seed, bodies):
    """Return two geoms in the same place, in a random pose ahead of a camera, at 2 to 20 times their size."""
    rng = np.random.default_rng(seed)
    x, turn = np.exp(rng.uniform(np.log(1.5), np.log(8))), rng.uniform(-70, 70, 3)
    if "plane" in (first, last):
        turn = rng.uniform(-20, 20, 3) + np.array([0, -60, 0])
    place = f'pos="{x} {rng.uniform(-0.1, 0.1) * x} {rng.uniform(-0.1, 0.1) * x}" euler="{" ".join(map(str, turn))}"'
    joint = "" if bodies == "still" or "plane" in (first, last) else "<freejoint/>"
    geoms = [f'<geom {KINDS[first]} rgba="{RED}"/>', f'<geom {KINDS[last]} rgba="{BLUE}"/>']
    groups = ["".join(geoms)] if bodies != "two bodies" else geoms
    placed = "".join(f"<body {place}>{joint}{group}</body>" for group in groups)
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><headlight ambient="0 0 0" diffuse=".8 .8 .8"/></visual>{ASSETS}<worldbody>
        <camera name="ahead" xyaxes="0 -1 0 0 0 1" fovy="{FOV}"/>{placed}</worldbody></mujoco>"""
    )


def views(model):
    """Return red and blue light (2, y, x), and ids, for each way to render an image."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mirror = sim.mirror(model, data)
    eye = optics.Eye(resolution=(24, 24), fov_deg=FOV, bands=3)
    renderer = sim.ModelRenderer(model, eye, [sim.Mount("ahead")], 1, sim.Fidelity(1, bands=3))
    colors = {
        "mirror": mirror.render("ahead", 24, 24, spp=1, wavelengths=[650e-9, 450e-9]),
        "quick": np.moveaxis(QuickCamera(model).picture(data, "ahead", 24, 24)[..., [0, 2]] / 255, -1, 0),
        "eye": renderer.signals([data])[0, 0, [0, 2]],
    }
    return colors, {"mirror": mirror.render_ids("ahead", 48, 48), "eye": renderer.ids([data])}


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
@pytest.mark.fast_cases(12)
@pytest.mark.parametrize(("kinds", "bodies"), ARRANGED)
def test_the_geom_that_is_defined_last_is_visible(kinds, bodies):
    colors, ids = views(model_of(*kinds, 3 * SAME.index(kinds) + len(bodies), bodies))
    for path, found in ids.items():
        assert set(np.unique(found)) == {-1, 1}, path
    for path, (red, blue) in colors.items():
        assert blue.max() > 0.05, path
        assert np.all(red <= blue), path


def flush_boxes(seed):
    """Return overlapping boxes whose top faces are in one plane, seen from above, and their places (box, 2, 2)."""
    rng = np.random.default_rng(seed)
    middle, half = rng.uniform(-0.6, 0.6, (8, 2)), rng.uniform(0.2, 0.5, (8, 2))
    heights = rng.uniform(0.1, 0.5, 8)
    boxes = "".join(
        f'<geom type="box" size="{x} {y} {h}" pos="{mx} {my} {-h}"/>'
        for (mx, my), (x, y), h in zip(middle, half, heights, strict=True)
    )
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><headlight ambient="0 0 0"/></visual><worldbody>
        <camera name="above" pos="0 0 3" fovy="40"/>{boxes}</worldbody></mujoco>"""
    )
    return model, np.stack([middle - half, middle + half], axis=1)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("seed", range(4))
def test_flush_faces_of_different_boxes_show_the_last(seed):
    model, places = flush_boxes(seed)
    n = 60
    middles = (np.arange(n) + 0.5) / n * 2 - 1
    y, x = np.meshgrid(-middles, middles, indexing="ij")
    at = np.stack([x, y], axis=-1)[:, :, None] * 3 * np.tan(np.radians(20))
    inside = ((at > places[:, 0]) & (at < places[:, 1])).all(axis=-1)
    expected = np.where(inside.any(axis=-1), 7 - np.argmax(inside[..., ::-1], axis=-1), -1)
    found = sim.mirror(model).render_ids("above", n, n)
    on_top = expected >= 0  # elsewhere, sides of boxes are visible
    assert np.mean(found[on_top] == expected[on_top]) > 0.99  # pixels at borders, which have been moved a little
    eye = optics.Eye(resolution=(n, n), fov_deg=40, bands=1)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    seen = sim.ModelRenderer(model, eye, [sim.Mount("above")], 1).ids([data])[0, 0]
    assert np.mean(seen[on_top] == expected[on_top]) > 0.99
    drawn = draw([model], n, n)
    if drawn is not None:
        assert np.mean(drawn[1][0][on_top] == expected[on_top]) > 0.85  # MuJoCo's rounding leaves a few speckles


def test_neighbours_and_contacts_are_left_alone():
    """Boxes side by side and on a floor, and a ball that touches a box, share no visible surface."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom type="plane" size="5 5 .1"/>
        <geom type="box" size=".5 .5 .5" pos="0 0 .5"/><geom type="box" size=".5 .5 .5" pos="1 0 .5"/>
        <geom type="sphere" size=".2" pos="0 0 1.2"/><geom type="capsule" size=".1 .3" pos="0 .6 .4"/>
        </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = coincidences(data, range(model.ngeom))
    assert found.pairs == ()
    assert found.lifts == {}


GROUPED = """<mujoco><visual><headlight ambient="0 0 0"/></visual><worldbody><camera name="eye" pos="0 0 3"/>
    <geom name="shell" type="box" size=".3 .2 .25" rgba="1 0 0 1"/>
    <geom name="skin" type="box" size=".3 .2 .25" rgba="0 0 1 1" group="1" contype="0"/></worldbody></mujoco>"""


def test_groups_in_the_same_place_are_named():
    message = r"'shell' \(group 0\) and 'skin' \(group 1\) are in the same place.*groups=\(1,\)"
    model = mujoco.MjModel.from_xml_string(GROUPED)
    with pytest.warns(sim.MirrorWarning, match=message):
        sim.mirror(model)
    with pytest.warns(sim.MirrorWarning, match=message):
        sim.ModelRenderer(model, optics.Eye(resolution=(2, 2), fov_deg=20), [sim.Mount("eye")], 1)
    assert set(np.unique(sim.mirror(model, groups=(0,)).render_ids("eye", 9, 9))) == {-1, 0}


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
def test_the_closed_form_refuses_geoms_in_the_same_place():
    ball = '<body mocap="true" pos="2 0 .4"><geom name="{}" size=".3" rgba="{}"/></body>'
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><headlight active="0"/></visual><worldbody><body name="eye" pos="0 0 .4"/>
        <light type="directional" dir=".3 0 -1"/><geom type="plane" size="5 5 .1"/>
        {ball.format("red", RED)}{ball.format("blue", BLUE)}</worldbody></mujoco>"""
    )
    eye = optics.Eye(resolution=(2, 2), fov_deg=20)
    with pytest.raises(ValueError, match="geoms 'red' and 'blue' are in the same place"):
        sim.ModelRenderer(model, eye, [sim.Mount("eye")], 1, tracer="closed_form")
    assert sim.ModelRenderer(model, eye, [sim.Mount("eye")], 1, tracer="auto").tracer.name == "mitsuba"
