"""Conversion of a model to upright walls, a floor and moving spheres, for eyes that move and turn horizontally only.

If a model cannot be represented in this form, `NoClosedForm` states the reason in one line, if possible with the name
of the geom, light or body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from optics import BandMedium
from sim.eyes.compound_eye import CompoundEye
from sim.scene import bsdfs, shapes, surfaces
from sim.scene.variant import MitsubaObject
from sim.tracing.eye_places import LevelStand
from sim.tracing.lighting import DirectionalLight
from sim.tracing.model_lights import ModelLight
from sim.tracing.model_scene import ModelScene
from sim.tracing.spheres import Spheres
from sim.tracing.walls import ALIGNED, NoClosedForm, Walls, walls_of

_SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE
# Modes in which a light keeps its direction.
_KEEP_THEIR_WAY = (int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED), int(mujoco.mjtCamLight.mjCAMLIGHT_TRACK))


@dataclass(frozen=True)
class UprightScene:
    """A model as upright walls, a floor and spheres. Formulas in closed form give their intersections with a ray.

    stand: the body that the eyes are fixed to
    walls: all walls and the floor
    lights: all lights
    spheres: all moving spheres that the eyes can see
    bodies: these spheres, followed by the body that carries the eyes, if it is a sphere. The eyes do not see this body
    heights: heights of all bodies' centres in the reference pose [m], (body,)
    settled: True for bodies that keep this height, (body,)
    model: the MuJoCo model
    variant: Mitsuba's variant
    bsdfs: BSDF of each geom, by id; geoms of equal appearance share one object
    medium: water or air in the eye's bands; None: clear air
    in_bands: True if light is traced separately in each of the eye's bands. This is necessary if a medium weakens the
        bands differently, or if the eye has ommatidia, whose rays have a weight for each band
    """

    model: mujoco.MjModel
    variant: str
    stand: LevelStand
    walls: Walls
    lights: tuple[DirectionalLight, ...]
    spheres: Spheres
    bodies: Spheres
    heights: np.ndarray
    settled: np.ndarray
    bsdfs: dict[int, MitsubaObject]
    medium: BandMedium | None
    in_bands: bool

    @property
    def has_own(self) -> bool:
        """True if the body that carries the eyes is a sphere, which is then the last of `bodies`."""
        return len(self.bodies) > len(self.spheres)


def upright_scene(scene: ModelScene, stand: LevelStand) -> UprightScene:
    """Return a model as upright walls, a floor and spheres, for eyes that stay upright.

    Raises:
        NoClosedForm: the model cannot be represented in this way; the message states the reason.
    """
    _refuse_what_shines(scene)
    model = scene.model
    for geom in scene.geoms:
        if bsdfs.mirror_share(model, geom) > 0:
            raise NoClosedForm(f"geom {_name(model, geom)} is a mirror")
    for geom, materials in scene.varied.items():
        what = "materials" if materials else "sizes or colours"
        raise NoClosedForm(f"{what} of geom {model.geom(geom).name!r} differ between worlds")
    same = {look.geom: scene.bsdfs[look] for look in scene.looks}
    for first, last in scene.coincidences.pairs:
        if same[first] is not same[last]:
            raise NoClosedForm(f"geoms {_name(model, first)} and {_name(model, last)} are in the same place")
    moving = [look.geom for look in scene.moving]
    walls = walls_of(model, [g for g in scene.geoms if g not in moving], stand.heights)
    for geom in moving:
        if surfaces.geom_type(model, geom) != _SPHERE:
            kind = surfaces.geom_type(model, geom).name.removeprefix("mjGEOM_").lower()
            raise NoClosedForm(f"geom {_name(model, geom)} moves and is a {kind}")
    own = [geom for geom in moving if model.geom_bodyid[geom] == stand.body]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    _refuse_what_eyes_would_see(model, data, stand, own)
    seen = [geom for geom in moving if geom not in own]
    bodies = [*seen, *own]
    return UprightScene(
        model,
        scene.variant,
        stand,
        walls,
        tuple(_checked(model, light) for light in scene.lights.found),
        _spheres(data, seen, same),
        _spheres(data, bodies, same),
        data.geom_xpos[bodies, 2],
        np.array([_keeps_height(model, data, geom) for geom in bodies], bool),
        same,
        scene.medium,
        scene.medium is not None or isinstance(scene.eye, CompoundEye),
    )


def _name(model: mujoco.MjModel, geom: int) -> str:
    return repr(model.geom(geom).name or str(geom))


def _refuse_what_shines(scene: ModelScene) -> None:
    for look in scene.glows:
        raise NoClosedForm(f"geom {_name(scene.model, look.geom)} glows")
    if scene.has_sky:
        raise NoClosedForm("there is a sky")


def _checked(model: mujoco.MjModel, light: ModelLight) -> DirectionalLight:
    """Return a model's light as a `DirectionalLight`.

    Raises:
        NoClosedForm: the light is not directional, moves, casts no shadow, or shines from below.
    """
    if light.light < 0:
        raise NoClosedForm("the headlight moves with each eye")
    name = repr(model.light(light.light).name or str(light.light))
    if light.kind != "directional" or light.direction is None:
        raise NoClosedForm(f"light {name} shines from a place nearby")
    body = model.light_bodyid[light.light]
    keeps_its_way = int(model.light_mode[light.light]) in _KEEP_THEIR_WAY
    if not keeps_its_way or model.body_weldid[body] != 0 or model.body_mocapid[model.body_rootid[body]] >= 0:
        raise NoClosedForm(f"light {name} moves")
    if not light.casts_shadow:
        raise NoClosedForm(f"light {name} casts no shadow")
    if light.direction[2] <= 0:
        raise NoClosedForm(f"light {name} shines from below")
    return DirectionalLight(light.direction, light.level)


def _refuse_what_eyes_would_see(
    model: mujoco.MjModel, data: mujoco.MjData, stand: LevelStand, own: Sequence[int]
) -> None:
    """Refuse eyes that would see their own body.

    A body without visible geoms passes. Otherwise, its only visible geom must be a sphere on the body's vertical axis.
    The eyes must lie on or outside the sphere's surface, and look straight away from the sphere's centre.

    own: ids of the body's visible geoms

    Raises:
        NoClosedForm: these conditions are not met.
    """
    if not own:
        return
    name = model.body(stand.body).name
    if len(own) > 1:
        raise NoClosedForm(f"body {name!r}, on which the eyes are, has {len(own)} geoms: must be a single sphere")
    (geom,) = own
    offset = data.xmat[stand.body].reshape(3, 3).T @ (data.geom_xpos[geom] - data.xpos[stand.body])
    if np.abs(offset[:2]).max() > ALIGNED:
        raise NoClosedForm(f"geom {_name(model, geom)} is not centred on the vertical axis of the eyes' body")
    ways = stand.origins - offset
    distances = np.linalg.norm(ways, axis=1)
    outwards = np.einsum("ei,ei->e", ways, stand.rotations[:, :, 2])
    if (distances < model.geom_size[geom, 0] - ALIGNED).any() or (outwards < distances - ALIGNED).any():
        raise NoClosedForm(f"eyes do not look straight out from the skin of geom {_name(model, geom)}")


def _spheres(data: mujoco.MjData, geoms: Sequence[int], bsdfs_of: dict[int, MitsubaObject]) -> Spheres:
    model = data.model
    return Spheres(
        radii=model.geom_size[geoms, 0],
        frames=data.geom_xmat[geoms].reshape(-1, 3, 3).copy(),
        textured=np.array([shapes.is_textured(model, geom) for geom in geoms], bool),
        names=tuple(model.geom(geom).name or str(geom) for geom in geoms),
        bsdfs=tuple(bsdfs_of[geom] for geom in geoms),
        geoms=tuple(geoms),
    )


def _keeps_height(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> bool:
    """Return whether no joint changes the height of a sphere. Mocap bodies are assumed to keep their height."""
    body = int(model.geom_bodyid[geom])
    while body > 0:
        first = model.body_jntadr[body]
        for joint in range(first, first + model.body_jntnum[body]):
            slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
            upright = abs(data.xaxis[joint][2])
            turns = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
            if not ((slides and upright < ALIGNED) or (turns and upright > 1 - ALIGNED)):
                return False
        body = int(model.body_parentid[body])
    return True
