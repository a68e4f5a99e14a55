"""A mirror (`sim.mirror`) with fewer shapes: triangle meshes of static geoms with the same appearance are merged.

Meshes with and without normals are merged separately, and so are meshes with and without texture coordinates. Geoms
that emit light, and shapes that are not meshes, such as most spheres, are not merged.

Every shape slows down each launch of a kernel, and every geom slows down each `sync`. In merged meshes, single static
geoms cannot be identified in the image.
"""

from __future__ import annotations

from collections.abc import Mapping

import mitsuba as mi
import mujoco
import numpy as np

from optics.spectra.spectrum import Spectrum
from sim.scene import lights, shapes, surfaces
from sim.scene.cameras import Viewpoint
from sim.scene.merged_parts import merged
from sim.scene.mirror import VISIBLE_GROUPS, Mirror
from sim.scene.variant import Description, MitsubaObject, default_variant
from sim.scene.variant import variant as in_variant


class MergedMirror(Mirror):
    """A Mitsuba scene with copies of the geoms of all bodies of a model.

    Only geoms of the groups that MuJoCo shows by default (0 to 2) are copied. Merged meshes are called
    "still_<n>", all other shapes "geom_<geom id>_<part>".

    model, spectra: see `sim.mirror`
    closed: names of the shapes that are invisible to a camera inside them
    """

    def __init__(self, model: mujoco.MjModel, spectra: Mapping[str, Spectrum | str] | None = None) -> None:
        super().__init__(model, None, bodies=None, groups=VISIBLE_GROUPS, variant=default_variant(), spectra=spectra)
        planes = {g for g in self._parts if surfaces.geom_type(model, g) == mujoco.mjtGeom.mjGEOM_PLANE}
        outer = {f"geom_{g}_" for g in self._parts if g not in planes}
        self.closed = frozenset(
            n for n in self._names.values() if n.startswith("still_") or n[: n.rfind("_") + 1] in outer
        )
        self._parts = {g: parts for g, parts in self._parts.items() if _moves(model, g)}
        with in_variant(self.variant):
            for geom, parts in self._parts.items():
                self._move(geom, parts, self._poses[geom])
            self._params.update()

    @property
    def shape_names(self) -> Mapping[int, str]:
        """Names of the scene's shapes, by their ids in Dr.Jit."""
        return self._names

    @property
    def near(self) -> float:
        """Distance along a camera's axis up to which surfaces are invisible, the same for all cameras [m]."""
        return self._near()

    def face(self, view: Viewpoint) -> None:
        """Turn the headlight, if there is one, into the camera's direction."""
        with in_variant(self.variant):
            self._aim_headlight(view)

    @property
    def lamps(self) -> dict[str, lights.Emitter]:
        """Lights of the model, by the names of their emitters."""
        return {emitter.name: emitter for emitter in self._emitters}

    def towards(self, name: str, view: Viewpoint) -> np.ndarray:
        """Return the unit vector (3,) towards a directional light; the headlight shines along the camera's axis."""
        if name == lights.HEADLIGHT:
            return view.rotation[:, 2]
        direction = -self._places.light_xdir[self.lamps[name].light]
        return np.asarray(direction / np.linalg.norm(direction))

    def surrounds(self, point: np.ndarray) -> bool:
        """Return whether a point lies in or close to the bounding box of any geom except planes.

        The point may then be inside the geom. Close means within the distance `near`, along every axis of the box.
        """
        sizes, bounded = self.model.geom_rbound[self.geoms], self.model.geom_rbound[self.geoms] > 0
        offset = point - self._places.geom_xpos[self.geoms]
        local = np.einsum("gij,gi->gj", self._places.geom_xmat[self.geoms].reshape(-1, 3, 3), offset)
        box = self.model.geom_aabb[self.geoms]
        inside = (np.abs(local - box[:, :3]) <= box[:, 3:] + self.near).all(axis=1)
        return bool((inside & bounded & (sizes > 0)).any())

    def _build(self) -> MitsubaObject:
        moving, still = {}, []
        for geom, parts in self._parts.items():
            glow = self._glow(geom)
            for k, part in enumerate(parts):
                name, bsdf = f"geom_{geom}_{k}", self._bsdf(geom, part.mirrors)
                if glow is not None or _moves(self.model, geom):
                    moving[name] = shapes.build(part, self._poses[geom], name, bsdf, glow)
                else:
                    still.append((name, part, self._poses[geom], bsdf))
        description: Description = {"type": "scene", **moving, **merged(still, "still")}
        for emitter in self._emitters:
            description[emitter.name] = emitter.described
        return mi.load_dict(description, optimize=False)


def _moves(model: mujoco.MjModel, geom: int) -> bool:
    body = model.geom_bodyid[geom]
    return bool(model.body_weldid[body] != 0 or model.body_mocapid[model.body_rootid[body]] >= 0)
