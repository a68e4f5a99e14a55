"""Positions of eyes against MuJoCo's own frames."""

import mujoco
import numpy as np
import pytest

import sim
from optics import Eye
from sim.eyes.eyes import Eyes, eye_positions, eye_rotations
from sim.eyes.inside import depth_inside

MODEL = mujoco.MjModel.from_xml_string("""
    <mujoco><visual><headlight active="0"/></visual><worldbody>
    <body name="head" pos="1 2 3" euler="20 30 40"><freejoint/>
      <geom name="skull" type="capsule" size=".1 .1"/><site name="brow" group="3" pos=".1 0 .3" euler="0 0 90"/>
      <camera name="lens" pos="0 .2 .1" euler="10 50 0"/>
      <camera name="same" pos="0 .2 .1" xyaxes="0 -1 0 0 0 1"/></body></worldbody></mujoco>""")
DATA = mujoco.MjData(MODEL)
mujoco.mj_forward(MODEL, DATA)
EYE = Eye(resolution=(1, 1), bands=1)


def frame_of(mount):
    renderer = sim.ModelRenderer(MODEL, EYE, [mount], 1, sim.Fidelity(1, bands=1))
    pupils, frames = renderer.eye_frames(sim.Poses.from_data([DATA]))
    return pupils[0, 0], frames[0, 0]


def test_a_camera_looks_as_it_does():
    pupil, frame = frame_of(sim.Mount("lens"))
    np.testing.assert_allclose(pupil, DATA.camera("lens").xpos, atol=1e-12)
    right, up, back = DATA.camera("lens").xmat.reshape(3, 3).T
    np.testing.assert_allclose(frame, np.column_stack([right, up, -back]), atol=1e-12)


@pytest.mark.parametrize(("name", "thing"), [("head", DATA.body("head")), ("brow", DATA.site("brow"))])
def test_bodies_and_sites_look_along_x(name, thing):
    matrix = np.reshape(thing.xmat, (3, 3))
    pupil, frame = frame_of(sim.Mount(name, offset=(0.5, 0, 0.1)))
    np.testing.assert_allclose(pupil, thing.xpos + matrix @ [0.5, 0, 0.1], atol=1e-12)
    np.testing.assert_allclose(frame, np.column_stack([-matrix[:, 1], matrix[:, 2], matrix[:, 0]]), atol=1e-12)


def test_angles_turn_left_up_and_over():
    """The angles rotate like MuJoCo's frames: about z, then -y, then the optical axis."""
    left, up, roll = 35.0, 20.0, 50.0
    _, frame = frame_of(sim.Mount("head", azimuth_deg=left, elevation_deg=up, roll_deg=roll, offset=(0.4, 0, 0)))
    turns = []
    for axis, angle in (([0, 0, 1], left), ([0, -1, 0], up), ([-1, 0, 0], roll)):
        quaternion, matrix = np.empty(4), np.empty(9)
        mujoco.mju_axisAngle2Quat(quaternion, np.array(axis, float), np.radians(angle))
        mujoco.mju_quat2Mat(matrix, quaternion)
        turns.append(matrix.reshape(3, 3))
    turned = DATA.body("head").xmat.reshape(3, 3) @ turns[0] @ turns[1] @ turns[2]
    np.testing.assert_allclose(frame, np.column_stack([-turned[:, 1], turned[:, 2], turned[:, 0]]), atol=1e-12)


def test_our_agents_ring_is_one():
    eyes = Eyes(n_eyes=5, placement_range_deg=120)
    for mount, azimuth in zip(sim.ring("head", 5, 120, 0.2), eyes.azimuths(), strict=True):
        offset, frame = mount.local("body")
        np.testing.assert_allclose(offset, eye_positions(np.array([azimuth]))[0], atol=1e-12)
        np.testing.assert_allclose(frame, eye_rotations(np.array([azimuth]))[0], atol=1e-12)
    with pytest.raises(ValueError, match="n_eyes = 0: must be a whole number in"):
        sim.ring("head", 0, 90, 0.2)


def test_both_sides_mirror():
    left, right = sim.both_sides([sim.Mount("head", 30, 10, 5, (0.1, 0.2, 0.3))])
    mirror = np.diag([1.0, -1, 1])
    (left_place, left_frame), (right_place, right_frame) = left.local("body"), right.local("body")
    np.testing.assert_allclose(right_place, mirror @ left_place)
    np.testing.assert_allclose(right_frame, mirror @ left_frame @ np.diag([-1, 1, 1]), atol=1e-12)


@pytest.mark.parametrize(
    ("mount", "words"),
    [
        (lambda: sim.Mount("haed"), "no site or camera or body 'haed' in the model.*head"),
        (lambda: sim.Mount("head", kind="camera"), "no camera 'head' in the model"),
        (lambda: sim.Mount("head", kind="geom"), "kind = 'geom': must be one of"),
        (lambda: sim.Mount(None), "Mount: on = None: must be a kind of str, such as 'head'"),
        (lambda: sim.Mount(b"head"), "Mount: on = b'head': must be a kind of str"),
        (lambda: sim.Mount(""), "Mount: on = '': must be the name of a site, a camera or a body"),
        (lambda: sim.ring(None, 2, 90, 0.2)[0], "Mount: on = None: must be a kind of str"),
        (lambda: sim.ring("head", 2, 90, -1.0)[0], r"radius = -1.0: must lie in \[0, 1e\+15\]"),
        (lambda: sim.Mount("head", azimuth_deg=np.inf), "azimuth_deg = inf: must be finite"),
        (lambda: sim.Mount("head", offset=(1, 2)), "offset = .* must be three lengths"),
        (
            lambda: sim.Mount("head", offset=(0.05, 0, 0)),
            "inside geom 'skull' of body 'head', 0.05 m below its surface: offset must",
        ),
    ],
)
def test_bad_mounts_are_named(mount, words):
    with pytest.raises(ValueError, match=words):
        frame_of(mount())


@pytest.mark.parametrize(
    ("shape", "point", "depth"),
    [
        ('type="sphere" size=".5"', (0.3, 0, 0), 0.2),
        ('type="capsule" size=".2 .5"', (0, 0.1, 0.6), 0.2 - np.hypot(0.1, 0.1)),
        ('type="cylinder" size=".2 .5"', (0.1, 0, 0.45), 0.05),
        ('type="box" size=".2 .3 .4"', (0.1, 0.28, 0), 0.02),
        ('type="ellipsoid" size=".2 .2 .2"', (0.05, 0, 0), 0.15),
        ('type="box" size=".2 .3 .4"', (0.1, 0.31, 0), 0.0),
        ('type="plane" size="1 1 1"', (0, 0, -0.1), 0.0),
    ],
)
def test_depth_inside(shape, point, depth):
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom {shape} pos="1 2 3" euler="0 0 90"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    place = data.geom_xpos[0] + data.geom_xmat[0].reshape(3, 3) @ point
    assert depth_inside(model, data, 0, place) == pytest.approx(depth, abs=1e-9)


CORNERS = np.array(list(np.ndindex(2, 2, 2))) - 0.5
# Each side of a cube as two triangles that face outwards; the last side is the lid, at z = 0.5.
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def cube(*sizes, lids=True):
    """Return a model of nested cubes as one tilted mesh, with or without lids."""
    vertices = np.concatenate([size * CORNERS for size in sizes])
    sides = SIDES if lids else SIDES[:-1]
    faces = [
        [8 * k + corner for corner in triangle]
        for k in range(len(sizes))
        for a, b, c, d in sides
        for triangle in ((a, b, c), (a, c, d))
    ]
    vertex, face = (" ".join(map(str, np.ravel(numbers))) for numbers in (vertices, faces))
    return f"""<mujoco><visual><headlight active="0"/></visual>
        <asset><mesh name="cube" inertia="shell" vertex="{vertex}" face="{face}"/></asset><worldbody>
        <light type="directional"/><body name="head" pos="1 2 3" euler="20 30 40"><freejoint/>
        <geom name="skull" type="mesh" mesh="cube" mass="1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("text", "point", "least", "most"),
    [
        (cube(1), (0, 0, 0), 0.5, 0.5 * 1.1),
        (cube(1), (0.2, 0.1, -0.45), 0.05, 0.05 * 1.1),
        (cube(1), (0.2, 0.1, -0.51), 0, 0),
        (cube(1), (5, 0, 0), 0, 0),
        (cube(1, lids=False), (0, 0, -0.4), 0, 0),  # an open box
        (cube(1, 0.5), (0, 0, 0.3), 0.05, 0.05 * 1.1),  # between two shells
        (cube(1, 0.5), (0, 0, 0.2), 0, 0),  # in the inner cavity
    ],
)
def test_depth_inside_of_meshes(text, point, least, most):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    centre = data.xpos[1] + data.xmat[1].reshape(3, 3) @ point  # MuJoCo moves a mesh's origin within its geom
    assert least <= depth_inside(model, data, 0, centre) <= most


def test_eyes_inside_a_mesh_are_refused():
    def made(text, ahead):
        return sim.ModelRenderer(text, EYE, [sim.Mount("head", offset=(ahead, 0, 0))], 1, sim.Fidelity(1, bands=1))

    with pytest.raises(
        ValueError, match=r"inside geom 'skull' of body 'head', 0\.0[45].* m below its surface: offset must lead out"
    ):
        made(cube(1), 0.46)
    assert made(cube(1), 0.51).moving == made(cube(1, lids=False), 0.4).moving == 1
