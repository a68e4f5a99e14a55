"""Geoms as plain shapes in their bodies' frames, for programs that draw the scene themselves."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from sim.scene import shapes, surfaces
from sim.scene.mirror import VISIBLE_GROUPS
from sim.scene.primitive_geoms import KINDS
from sim.scene.tessellation import Triangles

FAR = 3.0  # half sides of an infinite plane, in units of the model's extent


@dataclass(frozen=True)
class Solid:
    """A geom as a plain shape, with the values that the model had when `solids_of` was called.

    name: name in the model, or "geom_<id>"
    body: id of the geom's body
    kind: "ellipsoid", "capsule", "cylinder", "box" or "mesh"; a plane is a box of zero height
    half_sizes: half sizes along its own axes [m]; for capsules (radius, radius, half the distance between the ends'
        centres); 0 for a mesh
    position, quaternion: pose in the body's frame, [m] and (w, x, y, z)
    rgba: displayed colour, 0 to 1, without texture
    triangles: triangles of a mesh, in its own frame
    """

    name: str
    body: int
    kind: str
    half_sizes: tuple[float, float, float]
    position: tuple[float, ...]
    quaternion: tuple[float, ...]
    rgba: tuple[float, ...]
    triangles: Triangles | None = None


def solids_of(model: mujoco.MjModel) -> tuple[Solid, ...]:
    """Return all geoms that eyes can see by default (in the geom groups 0, 1 and 2), in the model's order."""
    return tuple(_solid(model, g) for g in surfaces.visible(model, VISIBLE_GROUPS) if shapes.has_shape(model, g))


def _solid(model: mujoco.MjModel, geom: int) -> Solid:
    kind = surfaces.geom_type(model, geom)
    plane = kind == mujoco.mjtGeom.mjGEOM_PLANE
    drawn = "box" if plane else KINDS.get(kind, "mesh")
    return Solid(
        name=model.geom(geom).name or f"geom_{geom}",
        body=int(model.geom_bodyid[geom]),
        kind=drawn,
        half_sizes=_floor(model, geom) if plane else _extent(model, geom, drawn),
        position=tuple(model.geom_pos[geom].tolist()),
        quaternion=tuple(model.geom_quat[geom].tolist()),
        rgba=tuple(surfaces.rgba(model, geom).tolist()),
        triangles=shapes.parts(model, geom)[0].triangles if drawn == "mesh" else None,
    )


def _floor(model: mujoco.MjModel, geom: int) -> tuple[float, float, float]:
    far = FAR * max(1.0, float(model.stat.extent))
    x, y, _ = model.geom_size[geom].tolist()
    return x or far, y or far, 0.0


def _extent(model: mujoco.MjModel, geom: int, drawn: str) -> tuple[float, float, float]:
    x, y, z = (0.0, 0.0, 0.0) if drawn == "mesh" else shapes.half_sizes(model, geom).tolist()
    return x, y, z
