"""What the batched renderer needs of a world: the static scene, and the movers' shapes and materials.

Both are made by the mirror's own parts, so that the renderer shows the same geometry, texture coordinates, textures
and lights. Static geoms that share a material become one shape here: nobody asks which geom a ray hit, and every
shape costs time in every launch of the kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mitsuba as mi
import mujoco
import numpy as np

from sim.scene import lights, shapes
from sim.scene.merged_parts import merged
from sim.scene.mirror import Mirror, mirror
from sim.scene.variant import Description, MitsubaObject
from sim.scene.variant import variant as in_variant
from sim.tracing.spheres import Spheres
from sim.worlds.world import World


@dataclass(frozen=True)
class StaticScene:
    """scene: mi.Scene of the world's own geoms
    geoms: their ids · bsdfs: of each, by id
    spheres: the objects', in the order of World.objects
    bodies: the same, and the agent's body: what light that was reflected may come from
    variant: of Mitsuba
    """

    scene: MitsubaObject
    geoms: tuple[int, ...]
    bsdfs: Mapping[int, MitsubaObject]
    spheres: Spheres
    bodies: Spheres
    variant: str


def build_static_scene(world: World) -> StaticScene:
    """The static scene of a world.

    Raises:
        ValueError: an object that is not one sphere, for moving geoms that are neither the agent's nor an object's, and
            for geoms that glow.
    """
    model = world.model
    static = mirror(model, bodies=["world"], spectra=world.spectra)
    geoms = [_sphere_of(model, name) for name in world.objects]
    known = {0, model.body("agent").id, *(model.geom_bodyid[g] for g in geoms)}
    others = set(model.geom_bodyid.tolist()) - known
    if others:
        raise ValueError(f"body {model.body(others.pop()).name!r} moves, but is neither the agent nor an object")
    spheres, bodies = (_spheres(static, g) for g in (geoms, [*geoms, _sphere_of(model, "agent")]))
    standing = tuple(map(int, static.geoms))
    with in_variant(static.variant):
        scene = _static_scene(static)
        return StaticScene(scene, standing, {g: static.bsdf(g) for g in standing}, spheres, bodies, static.variant)


def _spheres(static: Mirror, geoms: list[int]) -> Spheres:
    model = static.model
    poses = [_frame_and_offset(model, geom) for geom in geoms]
    return Spheres(
        radii=model.geom_size[geoms, 0],
        frames=np.array([frame for frame, _ in poses]).reshape(-1, 3, 3),
        offsets=np.array([offset for _, offset in poses]).reshape(-1, 3),
        bsdfs=tuple(static.bsdf(geom) for geom in geoms),
        geoms=tuple(geoms),
    )


def _static_scene(static: Mirror) -> MitsubaObject:
    """The mirror's scene with one shape per material (and per plugin that is no mesh)."""
    model = static.model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    parts = []
    for geom in map(int, static.geoms):
        _refuse_glow(model, geom)
        bsdf, pose = static.bsdf(geom), shapes.pose(data, geom)
        parts += [(f"geom_{geom}_{k}", part, pose, bsdf) for k, part in enumerate(shapes.parts(model, geom))]
    description: Description = {"type": "scene", **merged(parts, "mesh")}
    for emitter in lights.emitters(model, data, static.spectra)[0]:
        description[emitter.name] = emitter.description
    return mi.load_dict(description, optimize=False)


def _refuse_glow(model: mujoco.MjModel, geom: int) -> None:
    material = model.geom_matid[geom]
    if material >= 0 and model.mat_emission[material] > 0:
        raise ValueError(f"geom {model.geom(geom).name!r} glows; the batched renderer knows directional lights only")


def _sphere_of(model: mujoco.MjModel, body: str) -> int:
    geoms = np.flatnonzero(model.geom_bodyid == model.body(body).id)
    if len(geoms) != 1 or model.geom_type[geoms[0]] != mujoco.mjtGeom.mjGEOM_SPHERE:
        raise ValueError(f"body {body!r} has {len(geoms)} geoms: must be a single sphere")
    return int(geoms[0])


def _frame_and_offset(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation of a geom's frame in the world, and of its centre from its body's origin; the body keeps the
    orientation that it has in the model."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.geom_bodyid[geom]
    return data.geom_xmat[geom].reshape(3, 3).copy(), data.geom_xpos[geom] - data.xpos[body]
