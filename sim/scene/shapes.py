"""Geoms as Mitsuba shapes.

Planes and spheres are exact Mitsuba shapes, and so are capsules and cylinders if they have no texture. (The shapes are
Mitsuba's rectangle, sphere, cylinder and disk.) Geoms for which Mitsuba's texture coordinates differ from MuJoCo's are
tessellated, and so are spheres with cube textures, and long planes. Ellipsoids are tessellated, too, because Mitsuba
intersects its own ellipsoids in float32, with wrong hit points on small, flat or distant ellipsoids.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mitsuba as mi
import mujoco
import numpy as np

from sim.scene import bsdfs, cube, surfaces, tessellation
from sim.scene.device_arrays import as_floats, as_whole_numbers
from sim.scene.tessellation import Triangles
from sim.scene.variant import Description, MitsubaObject

_TYPES = mujoco.mjtGeom
_PRIMITIVES = (
    _TYPES.mjGEOM_PLANE,
    _TYPES.mjGEOM_SPHERE,
    _TYPES.mjGEOM_CAPSULE,
    _TYPES.mjGEOM_ELLIPSOID,
    _TYPES.mjGEOM_CYLINDER,
    _TYPES.mjGEOM_BOX,
)
_ASSETS = (_TYPES.mjGEOM_MESH, _TYPES.mjGEOM_SDF, _TYPES.mjGEOM_HFIELD)


# Half side of an infinite plane in units of the model's extent. An eye one extent above the plane sees its edge 1e-4
# rad below the horizon, and float32 is accurate to 1e-3 of an extent for texture and shadows there. (Hits on triangles
# of this size would be wrong; see also LONG.)
INFINITY = 1e4
# Largest ratio of a plane's sides for which it is a single rectangle. Embree's hit points on a rectangle have an error
# of 1e-7 long² / short, which is 4 m for an infinite plane that is 2 m wide. Longer planes are strips of triangles.
LONG = 30


@dataclass(frozen=True)
class Part:
    """One Mitsuba shape of a geom: a Mitsuba plugin with the pose `local` (4, 4) in the geom's frame, or triangles.

    mirrors: True if this part reflects like a mirror when the geom's material does. A box does so on its top only
    """

    plugin: str = ""
    local: np.ndarray | None = None
    triangles: Triangles | None = None
    mirrors: bool = True

    def placement(self, pose: np.ndarray) -> Description:
        """Return names and values of the Mitsuba parameters that place the shape at a geom's pose (4, 4)."""
        if self.triangles is not None:
            placed = {"vertex_positions": self.vertices(pose)}
            return placed if self.triangles.normals is None else {**placed, "vertex_normals": self.normals(pose)}
        assert self.local is not None
        return {"to_world": mi.Transform4f((pose @ self.local).tolist())}

    def vertices(self, pose: np.ndarray) -> np.ndarray:
        """Return the vertices in world coordinates [m], if the geom has this pose (4, 4), as a flat float32 array."""
        assert self.triangles is not None
        return as_floats(self.triangles.vertices @ pose[:3, :3].T + pose[:3, 3])

    def normals(self, pose: np.ndarray) -> np.ndarray:
        """Return the vertex normals in world coordinates, if the geom has this pose (4, 4), as a flat float32 array."""
        assert self.triangles is not None
        assert self.triangles.normals is not None
        return as_floats(self.triangles.normals @ pose[:3, :3].T)


def pose(data: mujoco.MjData, geom: int) -> np.ndarray:
    """Return a geom's frame in the world, (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = data.geom_xmat[geom].reshape(3, 3)
    matrix[:3, 3] = data.geom_xpos[geom]
    return matrix


def has_shape(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom can be converted to a Mitsuba shape.

    Geoms of all primitive kinds can be converted. Meshes, SDFs and height fields can be converted if the model contains
    the asset (mesh or height field) that defines them. A user-defined SDF cannot be converted, because it has no mesh.
    """
    kind = surfaces.geom_type(model, geom)
    return kind in _PRIMITIVES or (kind in _ASSETS and model.geom_dataid[geom] >= 0)


def is_textured(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom has a texture that is visible on it."""
    texture = surfaces.texture_id(model, geom)
    return texture >= 0 and surfaces.is_mirrored(model, geom, texture)


def _is_cubic(model: mujoco.MjModel, geom: int) -> bool:
    return is_textured(model, geom) and surfaces.faces_of(model, surfaces.texture_id(model, geom)) > 0


def uv_transform(model: mujoco.MjModel, geom: int) -> np.ndarray | None:
    """Return the matrix (3, 3) that converts Mitsuba's texture coordinates of a shape to MuJoCo's.

    The matrix takes into account how often the texture repeats. Return None if the triangles already have MuJoCo's
    coordinates, or if no texture is visible on the geom.
    """
    kind, size = surfaces.geom_type(model, geom), model.geom_size[geom]
    if not is_textured(model, geom) or _is_cubic(model, geom):
        return None
    if kind not in (_TYPES.mjGEOM_SPHERE, _TYPES.mjGEOM_PLANE):
        return None
    if kind == _TYPES.mjGEOM_SPHERE:
        # Both programs use u = azimuth / 2π, v = polar angle / π from +z.
        return np.diag([*surfaces.texture_repeat(model, geom, size[[0, 0]]), 1.0])
    # MuJoCo: u = (x/sx + 1)/2, v = 1 - (y/sy + 1)/2, and (x, -y) repeat/2 + 1/2 along an infinite axis. If one axis is
    # infinite, MuJoCo also adds 1/2 along the other. Mitsuba's v points upwards.
    bounded = size[:2] > 0
    repeat = surfaces.texture_repeat(model, geom, size)
    per_length = model.mat_texrepeat[model.geom_matid[geom]] * plane_sides(model, geom)
    scale = np.where(bounded, repeat, per_length) * [1, -1]
    shift = 0.0 if bounded.all() else 0.5
    offset = shift + np.where(bounded, [0.0, repeat[1]], -scale / 2)
    return np.array([[scale[0], 0, offset[0]], [0, scale[1], offset[1]], [0, 0, 1.0]])


def plane_sides(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return the half sides of a plane [m], (2,)."""
    size = model.geom_size[geom, :2]
    return np.where(size > 0, size, INFINITY * max(1.0, model.stat.extent))


def parts(model: mujoco.MjModel, geom: int, lift: float = 0.0) -> list[Part]:
    """Return the shapes that make up a geom.

    lift: distance by which the surface is moved outwards [m]
    """
    kind, size = surfaces.geom_type(model, geom), model.geom_size[geom]
    if kind == _TYPES.mjGEOM_SPHERE and not _is_cubic(model, geom):
        return [Part("sphere", _placed(size[0] + lift, size[0] + lift, size[0] + lift))]
    if kind == _TYPES.mjGEOM_PLANE:
        return [_plane(plane_sides(model, geom), lift)]
    if not is_textured(model, geom) and kind in (_TYPES.mjGEOM_CYLINDER, _TYPES.mjGEOM_CAPSULE):
        return _exact_cylinder(kind, *(size + lifted_size(kind, lift))[:2])
    triangles = _triangles(model, geom).lifted(lift)
    if kind != _TYPES.mjGEOM_BOX or bsdfs.mirror_share(model, geom) == 0:
        return [Part(triangles=triangles)]
    top = (triangles.vertices[triangles.faces][..., 2] > size[2] * (1 - 1e-9)).all(axis=1)
    return [Part(triangles=triangles.only(~top), mirrors=False), Part(triangles=triangles.only(top))]


def lifted_size(kind: mujoco.mjtGeom, lift: float) -> np.ndarray:
    """Return what must be added to a primitive's `geom_size` to move its surface outwards by `lift` [m], (3,)."""
    return lift * np.array([1, kind != _TYPES.mjGEOM_CAPSULE, 1])


def untextured(model: mujoco.MjModel, geom: int) -> Triangles:
    """Return a geom as triangles, without MuJoCo's texture coordinates."""
    kind, size = surfaces.geom_type(model, geom), half_sizes(model, geom)
    if kind == _TYPES.mjGEOM_PLANE:
        return tessellation.strip(plane_sides(model, geom))
    if kind in (_TYPES.mjGEOM_MESH, _TYPES.mjGEOM_SDF):
        return tessellation.mesh(model, model.geom_dataid[geom])
    if kind == _TYPES.mjGEOM_HFIELD:
        return tessellation.height_field(model, model.geom_dataid[geom])
    if kind == _TYPES.mjGEOM_BOX:
        return tessellation.box(size)
    if kind == _TYPES.mjGEOM_CYLINDER:
        return tessellation.cylinder(size[0], size[2])
    if kind == _TYPES.mjGEOM_CAPSULE:
        return tessellation.capsule(size[0], size[2])
    return tessellation.ellipsoid(size)


def _triangles(model: mujoco.MjModel, geom: int) -> Triangles:
    size, triangles = half_sizes(model, geom), untextured(model, geom)
    if not is_textured(model, geom):
        return triangles
    if _is_cubic(model, geom):
        return _wrapped(model, geom, triangles, size)
    repeat = surfaces.texture_repeat(model, geom, size)
    if triangles.uv is None:
        # MuJoCo projects the image along z: (x, -y) / 2 half sizes - 1/2, with the repeats applied before the shift.
        uv = triangles.vertices[:, :2] / size[:2] * repeat * [0.5, -0.5] - 0.5
        return replace(triangles, uv=uv)
    return triangles.repeated(repeat)


def _wrapped(model: mujoco.MjModel, geom: int, triangles: Triangles, size: np.ndarray) -> Triangles:
    """Return the triangles with texture coordinates in the image of the geom's cube texture."""
    texture = surfaces.texture_id(model, geom)
    uniform = bool(model.mat_texuniform[model.geom_matid[geom]])
    towards = cube.directions(triangles.vertices, surfaces.geom_type(model, geom), size, uniform)
    return cube.laid(triangles, towards, int(model.tex_width[texture]), surfaces.faces_of(model, texture))


def half_sizes(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return the half sizes along x, y, z that MuJoCo's renderer uses [m], (3,)."""
    kind, size = surfaces.geom_type(model, geom), model.geom_size[geom]
    if kind == _TYPES.mjGEOM_SPHERE:
        return np.repeat(size[0], 3)
    if kind in (_TYPES.mjGEOM_CYLINDER, _TYPES.mjGEOM_CAPSULE):
        return np.array([size[0], size[0], size[1]])
    return np.asarray(size, float)


def _plane(sides: np.ndarray, height: float) -> Part:
    """Return a plane with these half sides [m], (2,); its texture coordinates are those of Mitsuba's rectangle.

    height: distance by which the plane is moved along its normal [m]
    """
    if sides.max() > LONG * sides.min():
        return Part(triangles=tessellation.strip(sides).lifted(height))
    return Part("rectangle", _placed(sides[0], sides[1], 1.0, z=height))


def _exact_cylinder(kind: mujoco.mjtGeom, radius: float, half_length: float) -> list[Part]:
    side = Part("cylinder", _placed(radius, radius, 2 * half_length, z=-half_length))
    if kind == _TYPES.mjGEOM_CAPSULE:
        return [side] + [Part("sphere", _placed(radius, radius, radius, z=z)) for z in (half_length, -half_length)]
    # Mitsuba's cylinder is open; its disk faces +z.
    top = Part("disk", _placed(radius, radius, 1.0, z=half_length))
    bottom = Part("disk", _placed(radius, -radius, -1.0, z=-half_length))
    return [side, top, bottom]


def _placed(sx: float, sy: float, sz: float, z: float = 0.0) -> np.ndarray:
    matrix = np.diag([sx, sy, sz, 1.0])
    matrix[2, 3] = z
    return matrix


def build(part: Part, pose: np.ndarray, name: str, bsdf: MitsubaObject, radiance: Description | None) -> MitsubaObject:
    """Return the Mitsuba shape (of the active variant) of a part, as an emitter if `radiance` is not None.

    pose: frame of the part's geom in the world, (4, 4)
    name: id of the shape in Mitsuba
    """
    if part.triangles is None:
        assert part.local is not None
        placed = mi.ScalarTransform4f((pose @ part.local).tolist())
        description: Description = {"type": part.plugin, "bsdf": bsdf, "id": name, "to_world": placed}
        if radiance is not None:
            description["emitter"] = {"type": "area", "radiance": radiance}
        return mi.load_dict(description)
    triangles = part.triangles
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    if radiance is not None:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    shape = mi.Mesh(
        name,
        len(triangles.vertices),
        len(triangles.faces),
        props=properties,
        has_vertex_normals=triangles.normals is not None,
        has_vertex_texcoords=triangles.uv is not None,
    )
    params = mi.traverse(shape)
    params["faces"] = as_whole_numbers(triangles.faces)
    for key, value in part.placement(pose).items():
        params[key] = value
    if triangles.uv is not None:
        params["vertex_texcoords"] = as_floats(triangles.uv)
    params.update()
    return shape
