"""Models with one geom of every kind, for tests of the mirror."""

import mujoco
import numpy as np

GEOM = mujoco.mjtGeom
TETRAHEDRON = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
TETRAHEDRON_FACES = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]

KINDS = (
    (GEOM.mjGEOM_SPHERE, [0.3, 0, 0]),
    (GEOM.mjGEOM_BOX, [0.3, 0.2, 0.1]),
    (GEOM.mjGEOM_PLANE, [0.4, 0.3, 0.1]),
    (GEOM.mjGEOM_CAPSULE, [0.15, 0.3, 0]),
    (GEOM.mjGEOM_CYLINDER, [0.2, 0.3, 0]),
    (GEOM.mjGEOM_ELLIPSOID, [0.4, 0.15, 0.25]),
    (GEOM.mjGEOM_MESH, [0, 0, 0]),
    (GEOM.mjGEOM_HFIELD, [0, 0, 0]),
)
# MuJoCo's rays hit an octree's approximation of the rendered mesh.
SDF = ((GEOM.mjGEOM_SDF, [0, 0, 0]),)


def random_quat(rng):
    quat = rng.normal(size=4)
    return (quat / np.linalg.norm(quat)).tolist()


def add_camera(spec, position, target, name="camera", fovy=45.0):
    back = np.array(position, float) - target
    back /= np.linalg.norm(back)
    right = np.cross([0, 0, 1.0], back)
    right /= np.linalg.norm(right)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.column_stack([right, np.cross(back, right), back]).ravel())
    spec.worldbody.add_camera(name=name, pos=list(position), quat=quat.tolist(), fovy=fovy)


def add_gradient(spec, name="gradient"):
    rng = np.random.default_rng(7)
    texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=16, height=8, nchannel=3)
    texture.data = rng.integers(0, 256, (8, 16, 3), dtype=np.uint8).tobytes()
    spec.add_material(name=name).textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def every_kind(seed, textured=False, mocap=False, kinds=KINDS):
    """Return a model with an infinite floor, two geoms of every kind, each on its own body at a random pose, and a
    camera.
    """
    rng = np.random.default_rng(seed)
    spec = mujoco.MjSpec()
    spec.visual.headlight.active = 0
    spec.visual.map.znear = 1e-4
    spec.add_mesh(
        name="tetrahedron",
        uservert=(0.3 * np.array(TETRAHEDRON)).ravel().tolist(),
        userface=np.ravel(TETRAHEDRON_FACES).tolist(),
    )
    hills = spec.add_hfield(name="hills", nrow=4, ncol=6, size=[0.3, 0.25, 0.2, 0.1])
    hills.userdata = rng.uniform(0, 1, 24).tolist()
    add_gradient(spec)
    spec.worldbody.add_geom(name="floor", type=GEOM.mjGEOM_PLANE, size=[0, 0, 0.1])
    for i, (kind, size) in enumerate(2 * kinds):
        body = spec.worldbody.add_body(
            name=f"body_{i}",
            mocap=mocap,
            pos=[*rng.uniform(-1.2, 1.2, 2), rng.uniform(0.3, 1.5)],
            # MuJoCo's rays pass through the back of a plane, so it keeps facing the camera.
            quat=[1, 0, 0, 0] if kind == GEOM.mjGEOM_PLANE else random_quat(rng),
        )
        arguments = {"size": size}
        if kind == GEOM.mjGEOM_HFIELD:
            arguments = {"hfieldname": "hills"}
        elif kind in (GEOM.mjGEOM_MESH, GEOM.mjGEOM_SDF):
            arguments = {"meshname": "tetrahedron"}
        if textured:
            arguments["material"] = "gradient"
        body.add_geom(
            type=kind, contype=0, conaffinity=0, pos=rng.uniform(-0.1, 0.1, 3).tolist(),
            quat=[1, 0, 0, 0] if kind == GEOM.mjGEOM_PLANE else random_quat(rng), **arguments,
        )  # fmt: skip
    add_camera(spec, [*rng.uniform(-1, 1, 1), -4.0, rng.uniform(2.0, 3.5)], np.array([0, 0, 0.7]))
    return spec.compile()
