"""Appearances of geoms: if episodes choose a geom's material, it has one for each material, otherwise a single one.

The appearance for a material is built as if the geom had that material in the model, including texture, mapping and
glow. If a geom has several appearances, each of them is a separate moving shape, and each world shows only one of these
shapes. The scene contains the shapes for all materials, so one rendering kernel serves worlds with different materials.
Geoms with a single appearance cost nothing extra.
"""

from __future__ import annotations

import copy
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import mujoco

from optics.numerics.arguments import did_you_mean, is_sized, shown
from sim.scene import bsdfs, shapes, surfaces
from sim.scene.spectra import Spectra, of_geom

# Names of geoms that differ between worlds, optionally with the names of the materials that an episode may choose.
Varied = Sequence[str] | Mapping[str, Sequence[str]]


@dataclass(frozen=True, eq=False)
class Appearance:
    """One appearance of a geom.

    geom: id of the geom
    model: a model in which the geom has this appearance
    drawn: True if each episode chooses the geom's material from several, of which this appearance shows one
    """

    geom: int
    model: mujoco.MjModel
    drawn: bool = False

    @property
    def material(self) -> int:
        """Id of the geom's material; -1: no material."""
        return int(self.model.geom_matid[self.geom])

    @property
    def alpha(self) -> float:
        """Opacity of the geom, from 0 (invisible) to 1."""
        return float(surfaces.rgba(self.model, self.geom)[3])

    @property
    def surface(self) -> tuple[Hashable, ...]:
        """Values that, together with the model's materials and textures, determine the geom's BSDF."""
        to_uv = shapes.uv_transform(self.model, self.geom)
        return (
            self.material,
            tuple(surfaces.rgba(self.model, self.geom)),
            None if to_uv is None else tuple(to_uv.ravel()),
            bsdfs.is_open(self.model, self.geom),
            shapes.is_textured(self.model, self.geom),
        )


def appearances_of(
    model: mujoco.MjModel, geoms: Sequence[int], materials: Mapping[int, Sequence[int]]
) -> list[Appearance]:
    """Return all visible appearances of these geoms.

    A geom has one appearance, or one for each material that it may have. Appearances with an alpha of 0 are omitted.

    geoms: ids of visible geoms
    materials: ids of the materials from which each episode chooses one for a geom. The key is the geom's id. Geoms
        whose material is fixed are not included
    """
    found = []
    for geom in geoms:
        if geom in materials:
            drawn = (in_material(model, geom, material) for material in materials[geom])
            found += [appearance for appearance in drawn if appearance.alpha > 0]
        else:
            found.append(Appearance(geom, model))
    return found


def in_material(model: mujoco.MjModel, geom: int, material: int) -> Appearance:
    """Return the appearance of a geom in one of the model's materials."""
    changed = copy.copy(model)
    changed.geom_matid[geom] = material
    return Appearance(geom, changed, drawn=True)


def in_white(model: mujoco.MjModel, geom: int) -> mujoco.MjModel:
    """Return a model in which a geom is white, except for its texture."""
    changed = copy.copy(model)
    changed.geom_rgba[geom, :3] = 1
    return changed


def material_of(model: mujoco.MjModel, material: str, where: str) -> int:
    """Return the id of a material.

    Raises:
        ValueError: the model has none of this name; the message begins with `where`.
    """
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, material)
    if found < 0:
        known = [model.material(m).name for m in range(model.nmat) if model.material(m).name]
        hint = did_you_mean(material, known) or (f"; it has {', '.join(map(repr, known))}" if known else "")
        raise ValueError(f"{where}: the model has no material {material!r}{hint}")
    return int(found)


def varied_geoms(
    model: mujoco.MjModel, seen: Sequence[int], varied: Varied, spectra: Spectra
) -> dict[int, tuple[int, ...]]:
    """Return the geoms that differ from world to world, with the ids of the materials that they may have.

    If `varied` lists no materials for a geom, its tuple of ids is empty.

    seen: ids of the visible geoms
    varied: names of the geoms; or a mapping from each of these names to the names of the geom's materials

    Raises:
        ValueError: `varied` does not consist of names; it names a geom that is not visible or not in the model, or a
            material that is not in the model; or a geom for which it lists no materials has a measured spectrum.
    """
    if isinstance(varied, str) or not (is_sized(varied) and all(isinstance(name, str) for name in varied)):
        raise ValueError(f"varied = {shown(varied)}: must be names of geoms, such as ('ball',)")
    known = {model.geom(g).name: g for g in seen if model.geom(g).name}
    found = {}
    for name in varied:
        if name not in known:
            hint = did_you_mean(name, known) or f"; it has {', '.join(map(repr, known))}"
            raise ValueError(f"varied: the model has no visible geom {name!r}{hint}")
        materials = varied[name] if isinstance(varied, Mapping) else ()
        if not materials and of_geom(model, known[name], spectra) is not None:
            raise ValueError(f"varied: geom {name!r} has a measured spectrum: must have a colour, or not vary")
        found[known[name]] = tuple(material_of(model, m, f"varied: geom {name!r}") for m in dict.fromkeys(materials))
    return dict(sorted(found.items()))
