"""A model taken apart: what stands still becomes one Mitsuba scene, and what moves is met by itself.

Surfaces are matt here, and opaque: what of a material is gloss, mirror or glass is left out, and said so.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.arguments import did_you_mean
from optics.spectra.spectrum import Spectrum
from sim.robots.model_lights import Lights, model_lights
from sim.robots.movers import Movers, kind_of
from sim.robots.paint import Paint
from sim.robots.poses import Poses
from sim.scene import bsdfs, inventory, lights, shapes, sky, surfaces
from sim.scene.merged_parts import PlacedPart, merged
from sim.scene.mirror import VISIBLE_GROUPS, MirrorWarning
from sim.scene.spectra import Spectra, of_geom, resolve
from sim.scene.variant import Description, MitsubaObject, default_variant
from sim.scene.variant import variant as in_variant
from sim.tracing.lighting import DIRECT

_HERE = Path(__file__).parents[1]


class ModelScene:
    """What a renderer needs of a model.

    model · variant: of Mitsuba · geoms: ids of all that are seen
    scene: mi.Scene of what stands still, and the sky · movers: what moves · lights: all of them
    spectra: measured ones of materials and lights, by name · has_sky: whether there is something to see at infinity
    glows: BSDFs whose reflectance is the radiance of geoms that glow, by id; these are met like movers
    paint: of what differs from world to world, `varied` by name: it is met like a mover, though it may stand still
    bsdfs: of every mover, in their order; kept here, since a BSDFPtr does not keep its objects alive

    Warns (`sim.MirrorWarning`) once of what has no counterpart.

    Raises:
        ValueError: a model without visible geoms, and spectra or variation of what it does not have.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        wavelengths: np.ndarray,
        groups: Sequence[int] = VISIBLE_GROUPS,
        spectra: Mapping[str, Spectrum | str] | None = None,
        varied: Sequence[str] = (),
        light: str = DIRECT,
    ) -> None:
        self.model, self.variant = model, default_variant()
        self._as_built = {"size": model.geom_size.copy(), "colour": model.geom_rgba.copy()}
        self.spectra: Spectra = resolve(model, spectra)
        seen = surfaces.visible(model, groups)
        self.geoms = [g for g in seen if shapes.has_shape(model, g)]
        if not self.geoms:
            raise ValueError("the model has no visible geom of a kind that can be mirrored")
        with in_variant(self.variant):
            self.glows = {g: glow for g in self.geoms if (glow := self._glow(g)) is not None}
            painted = varied_geoms(model, self.geoms, varied, self.spectra)
            matt = {g: self._matt(g, g in painted) for g in self.geoms}
            moving = [g for g in self.geoms if _moves(model, g) or g in painted or g in self.glows]
            meshes = {g: self._mesh(g, matt[g]) for g in moving if kind_of(model, g) is None}
            self.movers = Movers(model, moving, meshes)
            self.paint = Paint(model, painted, self.movers.geoms, wavelengths)
            self.bsdfs = [matt[int(g)] for g in self.movers.geoms]
            found, left_out = model_lights(model, self.spectra, wavelengths, light)
            self.lights = Lights(found)
            self._matt_still = {g: matt[g] for g in self.geoms if g not in moving}
            self.scene = self._still()
            self.has_sky = self.scene.environment() is not None
        left_out += [*inventory.left_out(model, seen, groups), *_not_matt(model, self.geoms, light)]
        if left_out:
            warnings.warn(f"eyes do not see: {'; '.join(left_out)}", MirrorWarning, stacklevel=_outside())

    def _matt(self, geom: int, white: bool) -> MitsubaObject:
        to_uv = shapes.uv_transform(self.model, geom)
        if white:
            return bsdfs.matt_white(self.model, geom, to_uv)
        return bsdfs.matt(self.model, geom, to_uv, of_geom(self.model, geom, self.spectra))

    def _glow(self, geom: int) -> MitsubaObject | None:
        """A BSDF whose reflectance is the radiance of a geom that glows: the kernel asks for it as for the others."""
        to_uv = shapes.uv_transform(self.model, geom)
        radiance = lights.glow(self.model, geom, to_uv, of_geom(self.model, geom, self.spectra))
        if radiance is None:
            return None
        return mi.load_dict({"type": "twosided", "inside": {"type": "diffuse", "reflectance": radiance}})

    def _mesh(self, geom: int, bsdf: MitsubaObject) -> MitsubaObject:
        """A geom in its own frame."""
        parts = enumerate(shapes.parts(self.model, geom))
        built = {f"part_{k}": shapes.build(part, np.eye(4), f"part_{k}", bsdf, None) for k, part in parts}
        return mi.load_dict({"type": "scene", **built}, optimize=False)

    @cached_property
    def told_apart(self) -> tuple[MitsubaObject, np.ndarray]:
        """What stands still, each geom by itself, and the geoms of the scene's shapes, (shape,)."""
        with in_variant(self.variant):
            built = {name: shapes.build(part, pose, name, bsdf, None) for name, part, pose, bsdf in self._still_parts()}
            scene = mi.load_dict({"type": "scene", **built}, optimize=False)
        return scene, np.array([int(shape.id().split("_")[1]) for shape in scene.shapes()], int)

    def refuse_differences(self, poses: Poses) -> None:
        """Sizes and colours that differ from the model's where they cannot.

        Raises:
            ValueError: they do.
        """
        free = self.movers.geoms[: self.movers.n_primitives]
        for what, here, may in (("size", poses.geom_size, free), ("colour", poses.geom_rgba, self.paint.geoms)):
            if here is None:
                continue
            own = self._as_built[what]
            alike = here[:1] if here.strides[0] == 0 else here
            if np.array_equal(np.broadcast_to(own, alike.shape), alike):
                continue
            differs = (alike != own).any(axis=(0, 2))
            differs[may] = False
            wrong = [g for g in np.flatnonzero(differs) if g in self.geoms]
            if wrong:
                name = self.model.geom(int(wrong[0])).name or str(wrong[0])
                more = ", and be a primitive without a texture" if what == "size" else ""
                raise ValueError(
                    f"geom {name!r} has another {what} than in the renderer's model: must be in `varied`{more}"
                )

    def _still_parts(self) -> list[PlacedPart]:
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        return [
            (f"geom_{g}_{k}", part, shapes.pose(data, g), bsdf)
            for g, bsdf in self._matt_still.items()
            for k, part in enumerate(shapes.parts(self.model, g))
        ]

    def _still(self) -> MitsubaObject:
        description: Description = {"type": "scene", **merged(self._still_parts(), "still")}
        heaven = sky.description(self.model, lights.white())
        if heaven is not None:
            description["sky"] = heaven
        return mi.load_dict(description, optimize=False)


def varied_geoms(model: mujoco.MjModel, seen: Sequence[int], names: Sequence[str], spectra: Spectra) -> list[int]:
    """Those whose size or colour differs from world to world.

    Raises:
        ValueError: there is none of that name to be seen, or its reflectance is measured.
    """
    known = {model.geom(g).name: g for g in seen if model.geom(g).name}
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known) or f"; it has {', '.join(map(repr, known))}"
            raise ValueError(f"varied: the model has no visible geom {name!r}{hint}")
        if of_geom(model, known[name], spectra) is not None:
            raise ValueError(f"varied: geom {name!r} has a measured spectrum: must have a colour, or not vary")
    return sorted({known[name] for name in names})


def _moves(model: mujoco.MjModel, geom: int) -> bool:
    body = model.geom_bodyid[geom]
    return bool(model.body_weldid[body] != 0 or model.body_mocapid[model.body_rootid[body]] >= 0)


def _outside() -> int:
    """How many calls ago somebody else's code was running: that is where a warning points."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and Path(frame.f_code.co_filename).is_relative_to(_HERE):
        frame, level = frame.f_back, level + 1
    return level


def _not_matt(model: mujoco.MjModel, geoms: Iterable[int], light: str) -> list[str]:
    """What surfaces do that is left out, in words."""
    materials = sorted({int(model.geom_matid[g]) for g in geoms if model.geom_matid[g] >= 0})
    geoms = list(geoms)
    glossy = [m for m in materials if bsdfs.has_gloss(model, m)]
    glowing = [m for m in materials if model.mat_emission[m] > 0 and light == DIRECT]
    mirrors = [g for g in geoms if bsdfs.mirror_share(model, g) > 0]
    glass = [g for g in geoms if surfaces.rgba(model, g)[3] < 1]
    words = [f"gloss of {inventory.listed_materials(model, glossy)}"] if glossy else []
    words += [f"light of {inventory.listed_materials(model, glowing)} on surfaces"] if glowing else []
    words += [f"reflections in {inventory.listed_geoms(model, mirrors)}"] if mirrors else []
    return words + ([f"what is behind the transparent {inventory.listed_geoms(model, glass)}"] if glass else [])
