"""Descriptions of a model's features that its Mitsuba scene (`mirror`) lacks, so that every omission is reported."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from sim.scene import shapes, sky, surfaces

_ROLES = mujoco.mjtTextureRole
_UNMIRRORED_ROLES = {
    _ROLES.mjTEXROLE_OCCLUSION: "occlusion",
    _ROLES.mjTEXROLE_ROUGHNESS: "roughness",
    _ROLES.mjTEXROLE_METALLIC: "metallic",
    _ROLES.mjTEXROLE_NORMAL: "normal",
    _ROLES.mjTEXROLE_OPACITY: "opacity",
    _ROLES.mjTEXROLE_EMISSIVE: "emissive",
    _ROLES.mjTEXROLE_ORM: "occlusion, roughness and metallic",
}
_NAMED = 4  # largest number of elements of one kind that a message names; it only counts the others


def left_out(model: mujoco.MjModel, geoms: Sequence[int], groups: Sequence[int]) -> list[str]:
    """Return messages about features of a model that have no counterpart in its Mitsuba scene.

    geoms: ids of the visible geoms. They and their materials are considered
    groups: groups of elements that MuJoCo draws. Elements in them that are not geoms are also considered
    """
    materials = sorted({int(model.geom_matid[g]) for g in geoms if model.geom_matid[g] >= 0})
    return [*_geoms(model, geoms), *_textures(model, materials), *_sky(model, geoms), *_others(model, groups)]


def _geoms(model: mujoco.MjModel, geoms: Sequence[int]) -> list[str]:
    words = []
    shapeless = [g for g in geoms if not shapes.has_shape(model, g)]
    for kind in sorted({surfaces.geom_type(model, g) for g in shapeless}):
        names = [_name(model, g) for g in shapeless if surfaces.geom_type(model, g) == kind]
        words.append(f"{kind.name.removeprefix('mjGEOM_').lower()} {_listed('geom', names)}")
    textured = {g: surfaces.texture_id(model, g) for g in geoms if surfaces.texture_id(model, g) >= 0}
    flat = [_name(model, g) for g, t in textured.items() if not surfaces.is_mirrored(model, g, t)]
    if flat:
        words.append(f"cube texture on plane {_listed('geom', flat)}")
    return words


def _textures(model: mujoco.MjModel, materials: Sequence[int]) -> list[str]:
    words = []
    for role, what in _UNMIRRORED_ROLES.items():
        names = [_material(model, m) for m in materials if model.mat_texid[m, role] >= 0]
        if names:
            words.append(f"{what} texture of {_listed('material', names)}")
    roles = [int(_ROLES.mjTEXROLE_RGB), int(_ROLES.mjTEXROLE_RGBA)]
    colors = {m: int(model.mat_texid[m, roles].max()) for m in materials}
    names = [_material(model, m) for m, t in colors.items() if t >= 0 and model.tex_nchannel[t] in (2, 4)]
    if names:
        words.append(f"alpha channel of the texture of {_listed('material', names)}")
    return words


def _sky(model: mujoco.MjModel, geoms: Sequence[int]) -> list[str]:
    skies = int(np.sum(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX))
    words = [f"{skies - 1} more skyboxes"] if skies > 1 else []
    if skies:
        words.append("light of the sky below 360 nm")
    planes = [g for g in geoms if surfaces.geom_type(model, g) == mujoco.mjtGeom.mjGEOM_PLANE]
    if sky.texture(model) >= 0 and any((model.geom_size[g, :2] == 0).all() for g in planes):
        words.append("haze where the infinite plane meets the sky")
    return words


def _others(model: mujoco.MjModel, groups: Sequence[int]) -> list[str]:
    sites = np.isin(model.site_group, groups) & (_alpha(model, model.site_rgba, model.site_matid) > 0)
    tendons = np.isin(model.tendon_group, groups) & (_alpha(model, model.tendon_rgba, model.tendon_matid) > 0)
    counts = {
        "site": sites.sum(),
        "tendon": tendons.sum(),
        "flex": np.isin(model.flex_group, groups).sum(),
        "skin": np.isin(model.skin_group, groups).sum(),
    }
    plural = {"flex": "flexes"}
    return [f"{n} {what if n == 1 else plural.get(what, what + 's')}" for what, n in counts.items() if n]


def _alpha(model: mujoco.MjModel, rgba: np.ndarray, material: np.ndarray) -> np.ndarray:
    """Return the alpha of each element by MuJoCo's rule: that of its own colour if set, else that of its material.

    rgba: colours of the elements, (n, 4)
    material: ids of their materials, (n,); -1: no material
    """
    unset = (rgba == np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)).all(axis=1) & (material >= 0)
    return np.where(unset, model.mat_rgba[material, 3] if model.nmat else 1.0, rgba[:, 3])


def listed_geoms(model: mujoco.MjModel, geoms: Iterable[int]) -> str:
    """Return text that lists geoms by name, such as "geoms 'a', 'b'"; only the first few are named."""
    return _listed("geom", (_name(model, g) for g in geoms))


def listed_materials(model: mujoco.MjModel, materials: Iterable[int]) -> str:
    """Return text that lists materials by name, such as "materials 'a', 'b'"; only the first few are named."""
    return _listed("material", (_material(model, m) for m in materials))


def _name(model: mujoco.MjModel, geom: int) -> str:
    return model.geom(geom).name or str(geom)


def _material(model: mujoco.MjModel, material: int) -> str:
    return model.mat(material).name or str(material)


def _listed(what: str, names: Iterable[str]) -> str:
    found = list(names)
    shown = ", ".join(map(repr, found[:_NAMED]))
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return f"{what if len(found) == 1 else what + 's'} {shown}{more}"
