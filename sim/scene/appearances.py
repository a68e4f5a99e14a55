"""How geoms may look: each in one way, or in one for each material that a world may draw for it.

Every look is built as if the model had it, texture, mapping and glow, and is a mover of its own; a world has one of a
geom's. So worlds that draw materials are one kernel, and what has one look costs nothing for it.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco

from optics.numerics.arguments import did_you_mean
from sim.scene import surfaces
from sim.scene.spectra import Spectra, of_geom

# Names of geoms that differ from world to world, and, where these are drawn, of the materials that one may have.
Varied = Sequence[str] | Mapping[str, Sequence[str]]


@dataclass(frozen=True, eq=False)
class Appearance:
    """geom: its id · model: in which it looks so · drawn: whether it is one of several materials'"""

    geom: int
    model: mujoco.MjModel
    drawn: bool = False

    @property
    def material(self) -> int:
        """Its id; -1: none."""
        return int(self.model.geom_matid[self.geom])

    @property
    def alpha(self) -> float:
        """How opaque it is."""
        return float(surfaces.rgba(self.model, self.geom)[3])


def appearances_of(
    model: mujoco.MjModel, geoms: Sequence[int], materials: Mapping[int, Sequence[int]]
) -> list[Appearance]:
    """All that are seen of these geoms; materials: ids of those that are drawn, by geom."""
    found = []
    for geom in geoms:
        if geom in materials:
            drawn = (in_material(model, geom, material) for material in materials[geom])
            found += [look for look in drawn if look.alpha > 0]
        else:
            found.append(Appearance(geom, model))
    return found


def in_material(model: mujoco.MjModel, geom: int, material: int) -> Appearance:
    """As a geom looks in one of the model's materials."""
    changed = copy.copy(model)
    changed.geom_matid[geom] = material
    return Appearance(geom, changed, drawn=True)


def in_white(model: mujoco.MjModel, geom: int) -> mujoco.MjModel:
    """The model in which a geom is white, but for its texture."""
    changed = copy.copy(model)
    changed.geom_rgba[geom, :3] = 1
    return changed


def material_of(model: mujoco.MjModel, material: str, where: str) -> int:
    """Its id.

    Raises:
        ValueError: there is none; where: who asks.
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
    """Those that differ from world to world, and ids of the materials that they may have; none: size or colour differs.

    Raises:
        ValueError: there is none of that name to be seen, no such material, or a reflectance is measured.
    """
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
