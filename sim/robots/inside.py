"""How deep a point lies inside of a geom."""

from __future__ import annotations

import mujoco
import numpy as np

_TYPES = mujoco.mjtGeom


def depth_inside(model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray) -> float:
    """Below the surface of a primitive [m], at most, for ellipsoids about; 0 outside, and for all other geoms."""
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
    else:
        return 0.0
    return max(float(depth), 0.0)
