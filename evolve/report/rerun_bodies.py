"""A task's model for rerun: its bodies with all that eyes see of them, and the eyes."""

from __future__ import annotations

from typing import Any

import numpy as np

import sim
from evolve.analysis.episode_scene import EpisodeScene
from evolve.report.rerun_stream import RerunStream, camera_frames
from sim.scene.solids import Solid

__all__ = ["EYES", "draw_bodies"]

BODIES, EYES = ("world", "bodies"), ("world", "eyes")


def draw_bodies(to: RerunStream, scene: EpisodeScene, eyes: sim.Eyes) -> None:
    """What there is, and where it is before each action."""
    for body in sorted({solid.body for solid in scene.solids}):
        _place(to, (*BODIES, scene.bodies[body]), scene.positions[:, body], scene.rotations[:, body])
    for solid in scene.solids:
        w, x, y, z = solid.quaternion
        local = to.rr.Transform3D(translation=solid.position, quaternion=to.rr.Quaternion(xyzw=(x, y, z, w)))
        to.always((*BODIES, scene.bodies[solid.body], solid.name), local, _shape(to.rr, solid))
    for eye, name in enumerate(eyes.names()):
        to.camera((*EYES, name), eyes)
        _place(to, (*EYES, name), scene.eye_positions[:, eye], camera_frames(scene.eye_rotations[:, eye]))
    to.path(scene.path)


def _place(to: RerunStream, entity: tuple[str, ...], positions: np.ndarray, rotations: np.ndarray) -> None:
    """Where something is before each action, (t, 3) [m] and (t, 3, 3)."""
    to.columns(entity, len(positions), to.rr.Transform3D.columns(translation=positions, mat3x3=rotations))


def _shape(rr: Any, solid: Solid) -> Any:
    color = np.rint(255 * np.clip(solid.rgba, 0, 1)).astype(np.uint8)
    x, y, z = solid.half_sizes
    if solid.triangles is not None:
        mesh = solid.triangles
        return rr.Mesh3D(
            vertex_positions=mesh.vertices,
            triangle_indices=mesh.faces,
            vertex_normals=mesh.normals,
            albedo_factor=color,
        )
    look: dict[str, Any] = {"colors": color, "fill_mode": "solid"}
    if solid.kind == "box":
        return rr.Boxes3D(half_sizes=[[x, y, z]], **look)
    if solid.kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=[[x, y, z]], **look)
    if solid.kind == "capsule":  # rerun's begin at the middle of an end
        return rr.Capsules3D(lengths=[2 * z], radii=[x], translations=[[0, 0, -z]], **look)
    return rr.Cylinders3D(lengths=[2 * z], radii=[x], **look)
