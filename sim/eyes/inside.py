"""Depth of a point inside a geom."""

from __future__ import annotations

import mujoco
import numpy as np

_TYPES = mujoco.mjtGeom
# Unit vectors in all directions, spaced by the golden angle so that few of them hit edges of meshes. At least one of
# them passes through any round opening in a mesh with an angular diameter of 40 degrees or more.
_N_WAYS = 64
_HEIGHTS, _AROUND = 1 - (2 * np.arange(_N_WAYS) + 1) / _N_WAYS, np.arange(_N_WAYS) * np.pi * (3 - np.sqrt(5))
_WAYS = np.column_stack([np.sqrt(1 - _HEIGHTS**2) * f(_AROUND) for f in (np.cos, np.sin)] + [_HEIGHTS])
# Distance behind a crossing at which a ray continues, in units of a mesh's radius; far above rounding errors.
_BEYOND = 1e-9


def depth_inside(model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray) -> float:
    """Return the depth [m] of a point below the surface of a primitive or a closed mesh.

    The depth is 0 for points outside the geom, and for geoms of other types, such as planes. For ellipsoids and
    meshes the depth is approximate.

    point: position in world coordinates [m], (3,)
    """
    p = data.geom_xmat[geom].reshape(3, 3).T @ (point - data.geom_xpos[geom])
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == _TYPES.mjGEOM_SPHERE:
        depth = size[0] - np.linalg.norm(p)
    elif kind == _TYPES.mjGEOM_ELLIPSOID:
        depth = (1 - np.linalg.norm(p / size)) * size.min()
    elif kind == _TYPES.mjGEOM_CAPSULE:
        depth = size[0] - np.linalg.norm(p - [0, 0, np.clip(p[2], -size[1], size[1])])
    elif kind == _TYPES.mjGEOM_CYLINDER:
        depth = min(size[0] - np.hypot(p[0], p[1]), size[1] - abs(p[2]))
    elif kind == _TYPES.mjGEOM_BOX:
        depth = (size - np.abs(p)).min()
    elif kind == _TYPES.mjGEOM_MESH:
        depth = _inside_mesh(model, data, geom, point)
    else:
        return 0.0
    return max(float(depth), 0.0)


def _inside_mesh(model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray) -> float:
    """Return the shortest distance [m] to the mesh along 64 rays if the point is inside the mesh; otherwise 0.

    From a point inside a closed mesh, rays in all directions cross the mesh an odd number of times.

    point: position in the world [m], (3,)
    """
    if np.linalg.norm(point - data.geom_xpos[geom]) > model.geom_rbound[geom]:
        return 0.0
    nearest = np.inf
    for way in _WAYS:
        crossings = _crossings(model, data, geom, point, way)
        if len(crossings) % 2 == 0:
            return 0.0
        nearest = min(nearest, crossings[0])
    return nearest


def _crossings(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray, way: np.ndarray
) -> list[float]:
    """Return the distances [m] at which a ray crosses a mesh, nearest first.

    point, way: start of the ray [m], and its direction, a unit vector, in the world's frame, (3,)
    """
    found: list[float] = []
    so_far, beyond = 0.0, _BEYOND * model.geom_rbound[geom]
    while (further := mujoco.mj_rayMesh(model, data, geom, point + so_far * way, way)) >= 0:
        found.append(so_far + further)
        so_far = found[-1] + beyond
    return found
