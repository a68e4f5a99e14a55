"""Bodies of a task's model, with their visible geoms, and the animal's eyes, for Rerun."""

from __future__ import annotations

from typing import Any

import numpy as np

import sim
from evolve.episodes.episode_scene import EpisodeScene
from evolve.report.rerun_stream import RerunStream, camera_frames
from sim.scene.solids import Solid
from sim.worlds.ground_plan import GroundPlan

__all__ = ["EYES", "draw_bodies", "draw_goal_region"]

BODIES, EYES = ("world", "bodies"), ("world", "eyes")
GOAL, GOAL_HEIGHT = (0, 158, 115), 0.01  # colour (green) and half height [m] of the goal region


def draw_bodies(to: RerunStream, scene: EpisodeScene, eyes: sim.Eyes) -> None:
    """Log all bodies with visible geoms, and all eyes, with their poses before each action, and the animal's path."""
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


def draw_goal_region(to: RerunStream, plan: GroundPlan) -> None:
    """Log the region of the floor that is the goal, if the task has one."""
    if plan.goal_region is None:
        return
    (x0, y0, x1, y1), z = plan.goal_region, GOAL_HEIGHT
    box = to.rr.Boxes3D(
        centers=[[(x0 + x1) / 2, (y0 + y1) / 2, z]], half_sizes=[[(x1 - x0) / 2, (y1 - y0) / 2, z]], colors=GOAL
    )
    to.always(("world", "goal_region"), box)


def _place(to: RerunStream, entity: tuple[str, ...], positions: np.ndarray, rotations: np.ndarray) -> None:
    """Log the position and orientation that an entity has before each action.

    positions: positions [m], (action, 3)
    rotations: rotation matrices, (action, 3, 3)
    """
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
    if solid.kind == "capsule":  # in Rerun, the origin of a capsule is the centre of one end
        return rr.Capsules3D(lengths=[2 * z], radii=[x], translations=[[0, 0, -z]], **look)
    return rr.Cylinders3D(lengths=[2 * z], radii=[x], **look)
