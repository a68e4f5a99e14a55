"""Cube textures on every kind of geom: the visible face and the position on it, against MuJoCo's own renderer and an
independent implementation of OpenGL's definition.

A texture's grey value codes the face in one model, the column in another, and the row in a third. A white texture gives
the light, so that a ratio of radiances gives the code. The tests detect these errors, each tried separately: faces U
and D swapped, columns of ±x mirrored, rows of ±y mirrored, uniform textures treated as others, caps looked up by their
own sphere, no cut along the seams, no halving.
"""

import mujoco
import numpy as np
import pytest

import sim
from sim.scene import cube
from sim.scene.color import decode_srgb
from sim.scene.tessellation import ellipsoid

from . import models
from .drawn import draw
from .models import GEOM

WIDTH, HEIGHT, TEXELS = 96, 72, 64
TURNED, OVER = [0.8, 0.2, -0.4, 0.3], [0.1, 0.9, 0.6, -0.3]
# kind, size, rotation of the geom (quaternion), uniform, faces in the image
CASES = {
    "box": (GEOM.mjGEOM_BOX, [0.9, 0.5, 0.6], TURNED, False, 6),
    "box-over": (GEOM.mjGEOM_BOX, [0.9, 0.5, 0.6], OVER, False, 6),
    "box-uniform": (GEOM.mjGEOM_BOX, [0.9, 0.5, 0.6], TURNED, True, 6),
    "box-one-image": (GEOM.mjGEOM_BOX, [0.9, 0.5, 0.6], OVER, False, 1),
    "sphere": (GEOM.mjGEOM_SPHERE, [0.9, 0, 0], TURNED, False, 6),
    "ellipsoid": (GEOM.mjGEOM_ELLIPSOID, [0.9, 0.5, 0.7], OVER, False, 6),
    "ellipsoid-uniform": (GEOM.mjGEOM_ELLIPSOID, [0.9, 0.5, 0.7], TURNED, True, 6),
    "cylinder": (GEOM.mjGEOM_CYLINDER, [0.6, 0.8, 0], TURNED, False, 6),
    "capsule": (GEOM.mjGEOM_CAPSULE, [0.5, 0.5, 0], TURNED, False, 6),
    "capsule-uniform": (GEOM.mjGEOM_CAPSULE, [0.5, 0.7, 0], OVER, True, 6),
    "mesh": (GEOM.mjGEOM_MESH, [0, 0, 0], TURNED, False, 6),
    "mesh-uniform": (GEOM.mjGEOM_MESH, [0, 0, 0], OVER, True, 6),
    "hfield": (GEOM.mjGEOM_HFIELD, [0, 0, 0], [1, 0, 0, 0.3], False, 6),
}
ANGULAR = (GEOM.mjGEOM_BOX, GEOM.mjGEOM_MESH, GEOM.mjGEOM_HFIELD)
CODES = ("face", "column", "row", "white")


def picture(code, faces):
    """Return display values (faces · TEXELS, TEXELS)."""
    face, row, column = np.indices((faces, TEXELS, TEXELS))
    values = {"face": 40 * face + 20, "column": 4 * column + 2, "row": 4 * row + 2, "white": 255 + 0 * face}
    return values[code].reshape(-1, TEXELS).astype(np.uint8)


def build(case, *codes, emission=0.0):
    """Return a model of the geom in the first of its materials, one material per code."""
    kind, size, quat, uniform, faces = CASES[case]
    spec = mujoco.MjSpec()
    spec.visual.headlight.active = 0
    spec.visual.map.znear = 1e-3
    if kind not in ANGULAR:
        spec.visual.quality.numslices = spec.visual.quality.numstacks = 120
    spec.visual.quality.offsamples = 0
    for code in codes:
        texture = spec.add_texture(
            name=code, type=mujoco.mjtTexture.mjTEXTURE_CUBE, width=TEXELS, height=faces * TEXELS, nchannel=3
        )
        texture.data = np.repeat(picture(code, faces)[..., None], 3, axis=2).tobytes()
        material = spec.add_material(name=code, texuniform=uniform, emission=emission, specular=0, shininess=0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = code
    where = {"size": size}
    if kind == GEOM.mjGEOM_MESH:
        # A skewed tetrahedron that is not centred on its frame: its faces have other directions than a box.
        corners = np.array([[-1, -1, -0.4], [1.1, -0.9, -0.5], [0.2, 1.2, -0.3], [0.1, -0.1, 1.1]]) * 0.8
        faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
        spec.add_mesh(name="mesh", uservert=corners.ravel().tolist(), userface=np.ravel(faces).tolist())
        where = {"meshname": "mesh"}
    if kind == GEOM.mjGEOM_HFIELD:
        field = spec.add_hfield(name="hills", nrow=5, ncol=7, size=[0.9, 0.7, 0.6, 0.3])
        field.userdata = np.random.default_rng(2).uniform(0, 1, 35).tolist()
        where = {"hfieldname": "hills"}
    spec.worldbody.add_geom(type=kind, quat=quat, material=codes[0], **where)
    if emission == 0:
        light = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        spec.worldbody.add_light(type=light, dir=[0.2, 0.5, -0.7], diffuse=[1, 1, 1])
    models.add_camera(spec, [0.35, -1.75, 2.0], np.zeros(3))
    return spec.compile()


def mirrored(case):
    """Return face, column and row in the mirror at each pixel, NaN if dark, (y, x, 3); columns and rows in [0, 1].

    With the same seed, all images have the same rays, so that a ratio has no noise.
    """
    pictures = {
        code: sim.mirror(build(case, code)).render("camera", WIDTH, HEIGHT, spp=8, wavelengths=[550e-9])[0]
        for code in CODES
    }
    lit = pictures["white"] > 0.02
    levels = decode_srgb(np.arange(256) / 255)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = [np.where(lit, pictures[code] / pictures["white"], np.nan) for code in CODES[:3]]
    return decoded([np.where(lit, np.interp(ratio, levels, np.arange(256.0)), np.nan) for ratio in ratios])


def decoded(levels):
    """Return face, column and row (y, x, 3) from display values 0 ... 255 in the three codes."""
    face, column, row = levels
    return np.stack([(face - 20) / 40, (column - 2) / 4 / (TEXELS - 1), (row - 2) / 4 / (TEXELS - 1)], axis=-1)


@pytest.fixture(scope="module")
def drawn():
    """Return the coordinates in MuJoCo's rendering, by case."""
    pictures = draw([build(case, *CODES[:3], emission=1.0) for case in CASES], WIDTH, HEIGHT, 3)
    if pictures is None:
        pytest.skip("no OpenGL context: compared with OpenGL's definition alone")
    levels = np.where(pictures[1] == 0, pictures[0][..., 0].astype(float), np.nan)
    return {case: decoded(levels[3 * i : 3 * i + 3]) for i, case in enumerate(CASES)}


@pytest.mark.parametrize("case", CASES)
def test_cube_textures_lie_where_mujoco_draws_them(case, drawn):
    seen, expected = mirrored(case), drawn[case]
    plain = _plain(expected) & ~np.isnan(seen).any(axis=-1)  # dark pixels give no coordinates
    assert plain.sum() > 700
    # Faces change and colours blend only along seams, which `plain` omits.
    assert np.mean(np.abs(seen[plain][:, 0] - expected[plain][:, 0]) < 0.05) > 0.995
    # The mean of 8 jittered samples is within a third of a pixel, and a pixel spans up to 3 texels.
    assert np.mean(np.abs(seen[plain][:, 1:] - expected[plain][:, 1:]).max(axis=1) < 2.5 / TEXELS) > 0.99


def _plain(values):
    """Return the pixels whose neighbours show the same face at nearly the same position."""
    steps = np.zeros(values.shape[:2])
    for axis in (0, 1):
        step = np.abs(np.diff(values, axis=axis)).max(axis=-1)
        pad = [(0, 0), (0, 0)]
        for side in ((1, 0), (0, 1)):
            pad[axis] = side
            steps = np.maximum(steps, np.pad(step, pad))
    return steps < 0.08  # a step is NaN next to the background


def test_faces_are_those_of_opengl():
    """The reference is table 3.19 of the OpenGL 2.1 specification. The coordinate ma with the largest absolute value
    selects the face. With the other two, sc and tc, the position on the face is (s, t) = ((sc, tc) / |ma| + 1) / 2.
    """
    table = {
        0: ([1, 0.2, 0.3], (-0.3, -0.2)),
        1: ([-1, 0.2, 0.3], (0.3, -0.2)),
        2: ([0.2, 1, 0.3], (0.2, 0.3)),
        3: ([0.2, -1, 0.3], (0.2, -0.3)),
        4: ([0.2, 0.3, 1], (0.2, -0.3)),
        5: ([0.2, 0.3, -1], (-0.2, -0.3)),
    }
    for expected, (towards, at) in table.items():
        face, where = cube.look_up(2.5 * np.array([towards]))
        assert face[0] == expected
        np.testing.assert_allclose(where[0], (np.array(at) + 1) / 2)


def test_no_triangle_spans_a_seam_and_none_is_lost():
    round_one = ellipsoid(np.array([0.9, 0.5, 0.7]))
    cut = cube.laid(
        round_one, cube.directions(round_one.vertices, GEOM.mjGEOM_ELLIPSOID, np.array([0.9, 0.5, 0.7]), True), 64, 6
    )
    corners = cut.vertices[cut.faces]
    middle = corners.mean(axis=1)
    face = cube.look_up(middle)[0]
    inwards = corners + 1e-6 * (middle[:, None] - corners)
    assert (cube.look_up(inwards.reshape(-1, 3))[0].reshape(-1, 3) == face[:, None]).all()
    assert _area(cut) == pytest.approx(_area(round_one), rel=1e-9)
    # Linear coordinates on each triangle are accurate to about the tolerance, which is checked at its centre.
    at = cube.look_up(middle)[1]
    pitch = 66
    expected = np.column_stack([1 + 64 * at[:, 0], face * pitch + 1 + 64 * at[:, 1]]) / [pitch, 6 * pitch]
    error = np.abs(cut.uv[cut.faces].mean(axis=1) - expected) * [1, 6]
    assert error.max() < 2 * cube.TOLERANCE


def _area(triangles):
    a, b, c = np.moveaxis(triangles.vertices[triangles.faces], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_borders_repeat_the_edge():
    faces = np.arange(6 * 4 * 4 * 3).reshape(24, 4, 3)
    padded = cube.padded(faces)
    assert padded.shape == (36, 6, 3)
    np.testing.assert_array_equal(padded[7:11, 1:5], faces[4:8])
    np.testing.assert_array_equal(padded[6, 1:5], faces[4])
    np.testing.assert_array_equal(padded[7:11, 5], faces[4:8, 3])
