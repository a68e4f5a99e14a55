"""What the batched renderer needs of a world: the static scene, and the movers' shapes and materials.

Both come from the mirror, so that the renderer shows the same geometry, texture coordinates, textures and lights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from sim.movers import Spheres
from sim.scene.mirror import Mirror, mirror
from sim.world import World


@dataclass(frozen=True)
class Stage:
    """static: mirror of the world's own geoms · spheres: the objects', in the order of World.objects"""

    static: Mirror
    spheres: Spheres

    @property
    def scene(self) -> Any:
        return self.static.scene

    @property
    def variant(self) -> str:
        return self.static.variant


def build_stage(world: World) -> Stage:
    """The stage of a world. Raises ValueError for an object that is not one sphere, and for moving geoms that are
    neither the agent's nor an object's."""
    model = world.model
    static = mirror(model, bodies=["world"])
    geoms = [_sphere_of(model, name) for name in world.objects]
    known = {0, model.body("agent").id, *(model.geom_bodyid[g] for g in geoms)}
    others = set(model.geom_bodyid.tolist()) - known
    if others:
        raise ValueError(f"body {model.body(others.pop()).name!r} moves, but is neither the agent nor an object")
    poses = [_frame_and_offset(model, geom) for geom in geoms]
    spheres = Spheres(
        radii=model.geom_size[geoms, 0],
        frames=np.array([frame for frame, _ in poses]).reshape(-1, 3, 3),
        offsets=np.array([offset for _, offset in poses]).reshape(-1, 3),
        bsdfs=tuple(static.bsdf(geom) for geom in geoms),
    )
    return Stage(static, spheres)


def _sphere_of(model: mujoco.MjModel, body: str) -> int:
    geoms = np.flatnonzero(model.geom_bodyid == model.body(body).id)
    if len(geoms) != 1 or model.geom_type[geoms[0]] != mujoco.mjtGeom.mjGEOM_SPHERE:
        raise ValueError(f"object {body!r} must be a single sphere geom")
    return int(geoms[0])


def _frame_and_offset(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation of a geom's frame in the world, and of its centre from its body's origin; the body keeps the
    orientation that it has in the model."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.geom_bodyid[geom]
    return data.geom_xmat[geom].reshape(3, 3).copy(), data.geom_xpos[geom] - data.xpos[body]
