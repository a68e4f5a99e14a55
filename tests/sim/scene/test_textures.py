"""Positions of a texture on every kind of geom: against independent formulas and MuJoCo's own renderer.

The texture's grey value codes u in one model and v in another. A white texture gives the light, so that a ratio of
radiances gives the coordinate. The tests detect these errors, each tried separately: a box's u and v swapped or u
mirrored, u mirrored around an axis, a plane's v upwards, image upside down, a capsule's caps swapped, uniform repeats
ignored, sRGB not decoded, a plane that is infinite along one axis shifted by half a repeat along the other, and such
planes and long ones as a single rectangle, whose hit points have errors of metres.
"""

from functools import cache

import mujoco
import numpy as np
import pytest

import sim
from sim.scene.color import decode_srgb

from . import models
from .drawn import draw
from .models import GEOM

WIDTH, HEIGHT = 96, 72
TEXELS = 256

# kind, size, rotation of the geom (quaternion), texture repeat, uniform
TURNED = [0.8, 0.2, -0.4, 0.3]
CASES = {
    "plane": (GEOM.mjGEOM_PLANE, [1.0, 0.6, 0.1], [1, 0, 0, 0.2], (1, 1), False),
    "plane-uniform": (GEOM.mjGEOM_PLANE, [1.0, 0.6, 0.1], [1, 0, 0, 0.2], (0.9, 1.1), True),
    "plane-infinite": (GEOM.mjGEOM_PLANE, [0, 0, 0.1], [1, 0, 0, 0.2], (0.3, 0.4), False),
    "box": (GEOM.mjGEOM_BOX, [0.9, 0.5, 0.6], TURNED, (1, 1), False),
    "box-turned": (GEOM.mjGEOM_BOX, [0.9, 0.5, 0.6], [0.1, 0.9, 0.6, -0.3], (1, 1), False),
    "box-uniform": (GEOM.mjGEOM_BOX, [0.9, 0.5, 0.6], TURNED, (0.8, 1.3), True),
    "sphere": (GEOM.mjGEOM_SPHERE, [0.8, 0, 0], TURNED, (1, 1), False),
    "sphere-repeated": (GEOM.mjGEOM_SPHERE, [0.8, 0, 0], [1, 0, 0, 0], (0.7, 0.4), False),
    "sphere-uniform": (GEOM.mjGEOM_SPHERE, [0.8, 0, 0], [1, 0, 0, 0], (0.7, 0.9), True),
    "ellipsoid": (GEOM.mjGEOM_ELLIPSOID, [0.9, 0.5, 0.7], TURNED, (1, 1), False),
    "cylinder": (GEOM.mjGEOM_CYLINDER, [0.6, 0.7, 0], TURNED, (1, 1), False),
    "cylinder-uniform": (GEOM.mjGEOM_CYLINDER, [0.6, 0.7, 0], TURNED, (1.2, 0.9), True),
    "capsule": (GEOM.mjGEOM_CAPSULE, [0.5, 0.5, 0], TURNED, (1, 1), False),
    "capsule-upside-down": (GEOM.mjGEOM_CAPSULE, [0.5, 0.5, 0], [0.1, 1, 0, 0], (1, 1), False),
    "mesh": (GEOM.mjGEOM_MESH, [0, 0, 0], [1, 0, 0, 0.3], (1, 1), False),
    "mesh-repeated": (GEOM.mjGEOM_MESH, [0, 0, 0], [1, 0, 0, 0.3], (0.6, 0.8), False),
    "mesh-without": (GEOM.mjGEOM_MESH, [0, 0, 0], [1, 0, 0, 0.3], (0.6, 0.8), False),
    "mesh-without-uniform": (GEOM.mjGEOM_MESH, [0, 0, 0], [1, 0, 0, 0.3], (0.6, 0.8), True),
    "hfield": (GEOM.mjGEOM_HFIELD, [0.9, 0.7, 0.5], [1, 0, 0, 0.3], (0.6, 0.8), False),
    "hfield-uniform": (GEOM.mjGEOM_HFIELD, [0.9, 0.7, 0.5], [1, 0, 0, 0.3], (0.6, 0.8), True),
}


def _half_infinite(rng):
    """Return a plane that is infinite along one axis, as a case."""
    size = [*rng.permutation([rng.uniform(0.5, 1.2), 0.0]).tolist(), 0.1]
    repeat = tuple(rng.uniform(0.2, 0.6, 2).tolist())
    return GEOM.mjGEOM_PLANE, size, [1, 0, 0, rng.uniform(-0.5, 0.5)], repeat, bool(rng.integers(2))


CASES |= {f"plane-half-infinite-{seed}": _half_infinite(np.random.default_rng(seed)) for seed in range(5)}
CASES["plane-long"] = (GEOM.mjGEOM_PLANE, [0.9, 9000, 0.1], [1, 0, 0, 0.2], (0.9, 4500), False)
ANGULAR = (GEOM.mjGEOM_PLANE, GEOM.mjGEOM_BOX, GEOM.mjGEOM_MESH, GEOM.mjGEOM_HFIELD)
WITH_FORMULA = [case for case in CASES if not case.startswith("mesh")]
QUAD = np.array([[-0.8, -0.8, 0], [0.8, -0.8, 0], [0.8, 0.8, 0], [-0.8, 0.8, 0.05]])
QUAD_UV = np.array([[0.1, 0.9], [0.8, 0.7], [0.9, 0.2], [0.2, 0.05]])

CODES = {
    "u": np.broadcast_to(np.arange(TEXELS)[None, :], (TEXELS, TEXELS)),
    "v": np.broadcast_to(np.arange(TEXELS)[:, None], (TEXELS, TEXELS)),
    "white": np.full((TEXELS, TEXELS), 255),
}


def build(case, *codes, emission=0.0):
    """Return a model of the geom in the first of its materials, one material per code."""
    kind, size, quat, repeat, uniform = CASES[case]
    spec = mujoco.MjSpec()
    spec.visual.headlight.active = 0
    spec.visual.headlight.ambient = [0, 0, 0]
    spec.visual.map.znear = 1e-3
    if kind not in ANGULAR:
        spec.visual.quality.numslices = spec.visual.quality.numstacks = 120
    spec.visual.quality.offsamples = 0
    for code in codes:
        texture = spec.add_texture(
            name=code, type=mujoco.mjtTexture.mjTEXTURE_2D, width=TEXELS, height=TEXELS, nchannel=3
        )
        texture.data = np.repeat(CODES[code].astype(np.uint8)[..., None], 3, axis=2).tobytes()
        material = spec.add_material(
            name=code, texrepeat=repeat, texuniform=uniform, emission=emission, specular=0, shininess=0
        )
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = code
    if kind == GEOM.mjGEOM_MESH:
        back = QUAD - [0, 0, 0.3]  # a mesh must enclose a volume, so this is the back of the quad
        spec.add_mesh(
            name="quad",
            uservert=np.concatenate([QUAD, back]).ravel().tolist(),
            usertexcoord=[] if "without" in case else np.concatenate([QUAD_UV, QUAD_UV]).ravel().tolist(),
            userface=[0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6],
        )
    where = {"meshname": "quad"} if kind == GEOM.mjGEOM_MESH else {"size": size}
    if kind == GEOM.mjGEOM_HFIELD:
        hills = spec.add_hfield(name="hills", nrow=3, ncol=4, size=[*size, 0.2])
        hills.userdata = np.random.default_rng(3).uniform(0, 0.4, 12).tolist()
        where = {"hfieldname": "hills"}
    spec.worldbody.add_geom(type=kind, quat=quat, material=codes[0], **where)
    if emission == 0:
        light = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        spec.worldbody.add_light(type=light, dir=[0.2, 0.5, -0.7], diffuse=[1, 1, 1])
    models.add_camera(spec, [0.35, -1.75, 2.0], np.zeros(3))
    return spec.compile()


@cache
def coordinates(case):
    """Return (u, v) from the mirror's radiance at each pixel, NaN if dark, and the visible points in the geom's frame.

    With the same seed, all three images have the same rays, so that a ratio has no noise.
    """
    pictures = {
        code: sim.mirror(build(case, code)).render("camera", WIDTH, HEIGHT, spp=16, wavelengths=[550e-9])[0]
        for code in CODES
    }
    lit = pictures["white"] > 0.02
    with np.errstate(divide="ignore", invalid="ignore"):
        uv = [_display(np.where(lit, pictures[code] / pictures["white"], np.nan)) for code in "uv"]
    found = np.stack(uv, axis=-1), local_points(case)
    for array in found:
        array.flags.writeable = False
    return found


def _display(linear):
    levels = decode_srgb(np.arange(TEXELS) / 255)
    return np.where(np.isnan(linear), np.nan, np.interp(linear, levels, (np.arange(TEXELS) + 0.5) / TEXELS))


def local_points(case):
    model = build(case, "white")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mirror = sim.mirror(model, data)
    depth = mirror.render_depth("camera", WIDTH, HEIGHT)
    depth = np.where(np.isfinite(depth), depth, np.nan)
    half = np.tan(np.radians(model.cam_fovy[0]) / 2)
    y, x = np.indices((HEIGHT, WIDTH))
    ray = np.stack(
        [
            ((x + 0.5) / WIDTH * 2 - 1) * half * WIDTH / HEIGHT,
            (1 - (y + 0.5) / HEIGHT * 2) * half,
            -np.ones_like(half * x),
        ],
        axis=-1,
    )
    points = data.cam_xpos[0] + depth[..., None] * (ray @ data.cam_xmat[0].reshape(3, 3).T)
    return (points - data.geom_xpos[0]) @ data.geom_xmat[0].reshape(3, 3)


def formula(case, points):
    """Return MuJoCo's texture coordinates of points in a geom's frame, before they wrap."""
    kind, size, _, repeat, uniform = CASES[case]
    x, y, z = np.moveaxis(points, -1, 0)
    azimuth = np.arctan2(y, x) / (2 * np.pi) % 1
    scale = np.array(repeat, float) * (size[:2] if uniform and kind != GEOM.mjGEOM_SPHERE else 1)
    if kind == GEOM.mjGEOM_PLANE and 0 in size[:2]:
        # Along an infinite axis, repeats are counted from the origin; along the other one, as on finite planes.
        u = x / 2 * repeat[0] if size[0] == 0 else (x / size[0] + 1) / 2 * scale[0]
        v = -y / 2 * repeat[1] if size[1] == 0 else (1 - y / size[1]) / 2 * scale[1]
        return np.stack([u + 0.5, v + 0.5], -1)
    if kind == GEOM.mjGEOM_PLANE:
        uv = [(x / size[0] + 1) / 2, (1 - y / size[1]) / 2]
    elif kind == GEOM.mjGEOM_BOX:
        a, b, c = x / size[0], y / size[1], z / size[2]
        face = np.argmax(np.abs([a, b, c]), axis=0)
        uv = [(np.where(face == 0, b, a) + 1) / 2, (1 - np.where(face == 2, b, c)) / 2]
    elif kind == GEOM.mjGEOM_HFIELD:
        # The projection is along z on all sides, and repeats are counted from the middle.
        return np.stack([x / size[0], -y / size[1]], -1) / 2 * scale - 0.5
    elif kind == GEOM.mjGEOM_SPHERE:
        scale = np.array(repeat) * (size[0] if uniform else 1)
        uv = [azimuth, np.arccos(np.clip(z / size[0], -1, 1)) / np.pi]
    elif kind == GEOM.mjGEOM_ELLIPSOID:
        around = np.arctan2(y / size[1], x / size[0]) / (2 * np.pi) % 1
        uv = [around, np.arccos(np.clip(z / size[2], -1, 1)) / np.pi]
    else:
        radius, h = size[:2]
        scale = np.array(repeat) * (radius if uniform else 1)
        side, end = (1 - z / h) / 2, np.abs(z) > h * (1 - 1e-4)
        if kind == GEOM.mjGEOM_CYLINDER:
            uv = [np.where(end, (x / radius + 1) / 2, azimuth), np.where(end, (y / radius + 1) / 2, side)]
        else:
            polar = np.arccos(np.clip((np.abs(z) - h) / radius, 0, 1)) / (np.pi / 2)
            uv = [azimuth, np.where(end, np.where(z > 0, polar, 1 - polar), side)]
    return np.stack(uv, -1) * scale


def assert_same_place(uv, expected):
    """Assert that coordinates agree up to whole repeats, to 5 texels.

    The mean position of the 16 samples is off by a fraction of a pixel. Pixels next to an edge, a seam or a limb are
    omitted, because they contain several positions.
    """
    distance = np.abs((uv - expected + 0.5) % 1 - 0.5).max(axis=-1)
    steps = np.zeros(expected.shape[:2])
    for axis in (0, 1):
        step = np.abs(np.diff(expected, axis=axis)).max(axis=-1)
        pad = [(0, 0), (0, 0)]
        for side in ((1, 0), (0, 1)):
            pad[axis] = side
            steps = np.maximum(steps, np.pad(step, pad))
    plain = (steps < 0.05) & ~np.isnan(distance)  # a step is NaN next to the background
    assert plain.sum() > 800
    assert np.mean(distance[plain] < 5 / TEXELS) > 0.99


@pytest.mark.parametrize("case", WITH_FORMULA)
def test_textures_lie_where_the_formulas_say(case):
    uv, points = coordinates(case)
    assert_same_place(uv, formula(case, points) % 1)


def test_mesh_interpolates_its_texture_coordinates():
    uv, points = coordinates("mesh")
    model = build("mesh", "white")
    # The compiler moves a mesh to its centre of mass and rotates it to its axes of inertia.
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[0])
    corners = points @ turn.reshape(3, 3).T + model.mesh_pos[0]
    lower = np.stack(
        [
            _barycentric(corners, QUAD[[0, 1, 2]], QUAD_UV[[0, 1, 2]]),
            _barycentric(corners, QUAD[[0, 2, 3]], QUAD_UV[[0, 2, 3]]),
        ]
    )
    below_diagonal = corners[..., 1] < corners[..., 0]
    assert_same_place(uv, np.where(below_diagonal[..., None], lower[0], lower[1]))


def _barycentric(points, triangle, values):
    edges = np.stack([triangle[1] - triangle[0], triangle[2] - triangle[0]], axis=1)
    weights = (points - triangle[0]) @ np.linalg.pinv(edges).T
    return values[0] + weights @ (values[1:] - values[0])


@pytest.fixture(scope="module")
def drawn():
    """Return (u, v) in MuJoCo's rendering, by case."""
    pictures = draw([build(case, *"uv", emission=1.0) for case in CASES], WIDTH, HEIGHT, 2)
    if pictures is None:
        pytest.skip("no OpenGL context: compared with the formulas alone")
    levels = np.where(pictures[1] == 0, (pictures[0][..., 0] + 0.5) / TEXELS, np.nan)
    return {case: np.stack(levels[2 * i : 2 * i + 2], axis=-1) for i, case in enumerate(CASES)}


@pytest.mark.parametrize("case", CASES)
def test_textures_lie_where_mujoco_draws_them(case, drawn):
    uv, _ = coordinates(case)
    assert_same_place(uv, drawn[case])
