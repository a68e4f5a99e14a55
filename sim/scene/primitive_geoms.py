"""Primitive geoms. Their intersections with rays are computed in closed form."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from sim.scene import shapes, surfaces

_TYPES = mujoco.mjtGeom
KINDS = {
    _TYPES.mjGEOM_SPHERE: "ellipsoid",
    _TYPES.mjGEOM_ELLIPSOID: "ellipsoid",
    _TYPES.mjGEOM_CAPSULE: "capsule",
    _TYPES.mjGEOM_CYLINDER: "cylinder",
    _TYPES.mjGEOM_BOX: "box",
}
PLANE = "plane"
# Largest distance of a geom's surface from its origin [m] as a function of the half sizes (..., 3), for each kind.
REACH: dict[mujoco.mjtGeom, Callable[[np.ndarray], np.ndarray]] = {
    _TYPES.mjGEOM_SPHERE: lambda size: size[..., 0],
    _TYPES.mjGEOM_ELLIPSOID: lambda size: size.max(axis=-1),
    _TYPES.mjGEOM_CAPSULE: lambda size: size[..., 0] + size[..., 1],
    _TYPES.mjGEOM_CYLINDER: lambda size: np.hypot(size[..., 0], size[..., 1]),
    _TYPES.mjGEOM_BOX: lambda size: np.linalg.norm(size, axis=-1),
    _TYPES.mjGEOM_PLANE: lambda size: np.hypot(size[..., 0], size[..., 1]),
}


def kind_of(model: mujoco.MjModel, geom: int) -> str | None:
    """Return the name of the primitive shape that a geom is, such as "box".

    Return None if the geom is not a primitive (for example, a mesh), or if it has a texture and is not a plane.
    """
    if surfaces.geom_type(model, geom) == _TYPES.mjGEOM_PLANE:
        return PLANE
    return None if shapes.is_textured(model, geom) else KINDS.get(surfaces.geom_type(model, geom))


def is_resizable(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether the sizes of a moving geom may differ between worlds."""
    return kind_of(model, geom) not in (None, PLANE)
