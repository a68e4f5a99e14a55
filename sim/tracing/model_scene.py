"""A model in two parts: static geoms form one Mitsuba scene, and moving geoms are intersected separately.

All surfaces are treated as matt and opaque. A warning lists gloss, mirrors and glass, which are not rendered.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Hashable, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import mitsuba as mi
import mujoco
import numpy as np

from optics import TurbidMedium
from optics.spectra.spectrum import Spectrum
from sim.eyes.compound_eye import WorldEye
from sim.scene import bsdfs, inventory, lights, shapes, sky, surfaces
from sim.scene.appearances import Appearance, Varied, appearances_of, in_white, varied_geoms
from sim.scene.band_error import lights_in_bands
from sim.scene.coincident import coincidences
from sim.scene.merged_parts import PlacedPart, merged
from sim.scene.mirror import VISIBLE_GROUPS, MirrorWarning
from sim.scene.model_snapshot import ModelSnapshot
from sim.scene.primitive_geoms import is_resizable
from sim.scene.rays import names_of
from sim.scene.spectra import of_geom, resolve
from sim.scene.variant import Description, MitsubaObject, default_variant
from sim.scene.variant import variant as in_variant
from sim.tracing.lighting import DIRECT
from sim.tracing.model_lights import Lights, model_lights
from sim.tracing.movers import Movers
from sim.tracing.paint import Paint

_HERE = Path(__file__).parents[1]


class ModelScene:
    """The parts of a model that tracers of rays need. Mitsuba's scenes are built on first use.

    model: the MuJoCo model
    eye: determines the spectral bands
    groups: visible geom groups
    medium: water or air between surfaces and eye; None: clear air. The attribute `medium` contains the
        medium's optical properties in the eye's bands
    variant: Mitsuba's variant
    geoms: ids of all visible geoms
    looks: appearances of these geoms; a geom that may have several materials has one for each of them
    moving: appearances of all "movers". These are the geoms that glow, and the geoms that may change their place, size,
        colour or material
    bsdfs: the BSDF of every appearance; equal surfaces share one object. They are stored here, because a BSDFPtr does
        not keep its objects alive
    lights: all lights
    spectra: measured spectra of materials and lights, by name
    has_sky: True if rays that hit nothing reach a sky
    glows: for each appearance of a geom that glows, a BSDF whose reflectance is the radiance that the geom emits
    varied: geoms whose size, colour or material differs between worlds, with the ids of the materials that each may
        have. They are movers, even if they always stay in the same place
    coincidences: geoms in the same place in the model's reference pose
    as_built: snapshot of the model, for comparison with the models of individual worlds

    Raises:
        ValueError: the model has no visible geoms, or lacks an element that `spectra` or `varied` names.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        eye: WorldEye,
        groups: Sequence[int] = VISIBLE_GROUPS,
        spectra: Mapping[str, Spectrum | str] | None = None,
        varied: Varied = (),
        medium: TurbidMedium | None = None,
    ) -> None:
        self.medium = None if medium is None else medium.in_bands(eye.spectral_bands, eye.receptors)
        self.model, self.eye, self.variant, self._groups = model, eye, default_variant(), groups
        self.spectra = resolve(model, spectra)
        in_bands, self._off = lights_in_bands(model, self.spectra, eye.spectral_bands, eye.receptors)
        self._visible = surfaces.visible(model, groups)
        self.geoms = [g for g in self._visible if shapes.has_shape(model, g)]
        surfaces.require_geoms(model, self.geoms)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        self.coincidences = coincidences(data, self.geoms)
        with in_variant(self.variant):
            self.varied = varied_geoms(model, self.geoms, varied, self.spectra)
            drawn = {geom: materials for geom, materials in self.varied.items() if materials}
            self._painted = [geom for geom in self.varied if geom not in drawn]
            self.looks = appearances_of(model, self.geoms, drawn)
            glows = ((look, self._glow(look, look.geom in self._painted)) for look in self.looks)
            self.glows = {look: glow for look, glow in glows if glow is not None}
            self.bsdfs = self._shared_bsdfs()
            found, self._unlit = model_lights(model, in_bands, self.wavelengths)
            self.lights = Lights(found)
            self._heaven = sky.description(model, lights.white())
        self.moving = [look for look in self.looks if self._may_change(look)]
        self.has_sky = self._heaven is not None

    @property
    def wavelengths(self) -> np.ndarray:
        """Wavelengths of the eye's bands [m]."""
        return np.asarray(self.eye.spectral_bands.wavelengths)

    def _may_change(self, look: Appearance) -> bool:
        return _moves(self.model, look.geom) or look.geom in self.varied or look in self.glows

    def warn_of_missing(self, light: str = DIRECT) -> None:
        """Warn (`sim.MirrorWarning`) of features of the model that are not rendered, such as gloss and mirrors.

        Also warn of geoms of different groups in the same place, and of lights with a measured spectrum that the eye's
        bands represent inaccurately, because there are too few bands.

        light: how often the rendered light may be reflected on its way to the eye: "direct": once, "bounce": once or
            twice, "all": any number of times. With "direct", surfaces are not lit by the sky or by glowing materials,
            and the warning says so
        """
        model = self.model
        of_sky = ["light of the sky on surfaces"] if light == DIRECT and self.has_sky else []
        missing = [*self._unlit, *of_sky, *inventory.left_out(model, self._visible, self._groups)]
        missing += _not_matt(model, self.looks, light)
        unseen = [f"eyes do not see: {'; '.join(missing)}"] if missing else []
        for words in (*unseen, *filter(None, [self.coincidences.message(model)]), *self._off):
            warnings.warn(words, MirrorWarning, stacklevel=_outside())

    @cached_property
    def as_built(self) -> ModelSnapshot:
        """Snapshot of the scene's model, for comparison with the models of individual worlds."""
        model, groups = self.model, self._groups
        reachable = [g for g in range(model.ngeom) if model.geom_group[g] in groups and shapes.has_shape(model, g)]
        hidden = [g for g in reachable if g not in self._visible]
        moving = np.array([look.geom for look in self.moving], int)
        fixed = [look.geom for look in self.moving if not is_resizable(look.model, look.geom)]
        return ModelSnapshot(model, self.geoms, hidden, moving, np.setdiff1d(moving, fixed), self.varied)

    @cached_property
    def movers(self) -> Movers:
        """The moving geoms, and the geoms that glow or whose size, colour or material may change."""
        with in_variant(self.variant):
            return Movers(self.model, self.moving, self.coincidences.lifts, next(iter(self.bsdfs.values())))

    @cached_property
    def paint(self) -> Paint:
        """Colours that differ between worlds."""
        glow = any(look.geom in self._painted for look in self.glows)
        with in_variant(self.variant):
            return Paint(self.model, self._painted, self.movers.geoms, self.wavelengths, glow)

    @cached_property
    def still(self) -> MitsubaObject:
        """Mitsuba scene of the static geoms and the sky."""
        with in_variant(self.variant):
            description: Description = {"type": "scene", **merged(self._still_parts(), "still")}
            if self._heaven is not None:
                description["sky"] = self._heaven
            return mi.load_dict(description, optimize=False)

    def _shared_bsdfs(self) -> dict[Appearance, MitsubaObject]:
        """Return the BSDF of every appearance. A thousand walls of one material share one BSDF."""
        made: dict[Hashable, MitsubaObject] = {}
        found = {}
        for look in self.looks:
            white = look.geom in self._painted
            key = (look.surface, white)
            if key not in made:
                made[key] = self._matt(look, white)
            found[look] = made[key]
        return found

    def _matt(self, look: Appearance, white: bool) -> MitsubaObject:
        to_uv = shapes.uv_transform(look.model, look.geom)
        if white:
            return bsdfs.matt_white(look.model, look.geom, to_uv)
        return bsdfs.matt(look.model, look.geom, to_uv, of_geom(look.model, look.geom, self.spectra))

    def _glow(self, look: Appearance, white: bool) -> MitsubaObject | None:
        """Return a BSDF whose reflectance is the radiance of a glowing geom; None if the geom does not glow.

        The renderer's kernel evaluates this BSDF like other BSDFs.

        white: True if the geom's colour differs between worlds. The geom is then treated as white, and the kernel
            multiplies the radiance by the colour in the rendered world
        """
        to_uv, geom = shapes.uv_transform(look.model, look.geom), look.geom
        model = in_white(look.model, geom) if white else look.model
        radiance = lights.glow(model, geom, to_uv, of_geom(model, geom, self.spectra))
        if radiance is None:
            return None
        return mi.load_dict({"type": "twosided", "inside": {"type": "diffuse", "reflectance": radiance}})

    @cached_property
    def one_shape_per_geom(self) -> tuple[MitsubaObject, np.ndarray]:
        """Mitsuba scene in which every static geom has its own shapes, and a table from shapes' ids to geoms.

        The table contains -1 for unused ids. A table is necessary because a ray on a GPU reports only the id of the
        shape that it hits.
        """
        with in_variant(self.variant):
            built = {name: shapes.build(part, pose, name, bsdf, None) for name, part, pose, bsdf in self._still_parts()}
            scene = mi.load_dict({"type": "scene", **built}, optimize=False)
            known = names_of(scene)
        geoms = np.full(max(known, default=0) + 1, -1)
        for shape, name in known.items():
            geoms[shape] = int(name.split("_")[1])
        return scene, geoms

    def _still_parts(self) -> list[PlacedPart]:
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        return [
            (f"geom_{g}_{k}", part, shapes.pose(data, g), bsdf)
            for g, bsdf in ((look.geom, bsdf) for look, bsdf in self.bsdfs.items() if look not in self.moving)
            for k, part in enumerate(shapes.parts(self.model, g, self.coincidences.lift(g)))
        ]


def _moves(model: mujoco.MjModel, geom: int) -> bool:
    body = model.geom_bodyid[geom]
    return bool(model.body_weldid[body] != 0 or model.body_mocapid[model.body_rootid[body]] >= 0)


def _outside() -> int:
    """Return the stack level of the nearest caller outside `sim`, to which a warning should point."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and Path(frame.f_code.co_filename).is_relative_to(_HERE):
        frame, level = frame.f_back, level + 1
    return level


def _not_matt(model: mujoco.MjModel, looks: Sequence[Appearance], light: str) -> list[str]:
    """Return descriptions of surface properties that are not rendered."""
    materials = sorted({look.material for look in looks if look.material >= 0})
    glossy = [m for m in materials if bsdfs.has_gloss(model, m)]
    glowing = [m for m in materials if model.mat_emission[m] > 0 and light == DIRECT]
    mirrors = list(dict.fromkeys(look.geom for look in looks if bsdfs.mirror_share(look.model, look.geom) > 0))
    glass = list(dict.fromkeys(look.geom for look in looks if look.alpha < 1))
    words = [f"gloss of {inventory.listed_materials(model, glossy)}"] if glossy else []
    words += [f"light of {inventory.listed_materials(model, glowing)} on surfaces"] if glowing else []
    words += [f"reflections in {inventory.listed_geoms(model, mirrors)}"] if mirrors else []
    return words + ([f"what is behind the transparent {inventory.listed_geoms(model, glass)}"] if glass else [])
