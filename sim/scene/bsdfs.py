"""Materials as Mitsuba BSDFs. A surface is Lambertian unless its material has one of these properties:

- specular > 0: a rough dielectric coat. Its reflectance at normal incidence is 0.08 · specular (specular = 0.5
  corresponds to glass of index 1.5; Burley 2012). Its Beckmann roughness is √(2 / (n + 2)) for the exponent n = 128 ·
  shininess (Walter et al. 2007). If specular and shininess are both 0.5, MuJoCo's defaults for unset values, the
  surface is Lambertian.
- metallic or roughness set: Burley's principled BSDF.
- reflectance, on planes and on top of boxes as in MuJoCo: this fraction of the light is reflected as by a mirror.
"""

from __future__ import annotations

from collections.abc import Callable

import mitsuba as mi
import mujoco
import numpy as np

from optics.spectra.spectrum import Spectrum
from sim.scene import spectra, surfaces
from sim.scene.variant import Description, MitsubaObject

_TYPES = mujoco.mjtGeom
_UNSET_GLOSS = (0.5, 0.5)  # specular, shininess
# Roughness of mirrors, which blurs reflections by 0.2°. A perfect mirror is avoided, because Mitsuba 3.9.1 assigns a
# wrong weight to it in a `blendbsdf`.
_SILVER = 0.003
_OPAQUE = 0.995  # MuJoCo treats lower alpha as transparent


def is_open(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether the inner side of a geom's surface can be visible."""
    return surfaces.geom_type(model, geom) in (_TYPES.mjGEOM_PLANE, _TYPES.mjGEOM_MESH, _TYPES.mjGEOM_SDF)


def mirror_share(model: mujoco.MjModel, geom: int) -> float:
    """Return the fraction of the light that a plane or the top of a box reflects as a mirror.

    The result is 0 for other geoms, and for geoms that are not opaque.
    """
    material = model.geom_matid[geom]
    flat = surfaces.geom_type(model, geom) in (_TYPES.mjGEOM_PLANE, _TYPES.mjGEOM_BOX)
    if material < 0 or not flat or surfaces.rgba(model, geom)[3] < _OPAQUE:
        return 0.0
    return float(np.clip(model.mat_reflectance[material], 0, 1))


def bsdf(
    model: mujoco.MjModel,
    geom: int,
    to_uv: np.ndarray | None = None,
    measured: Spectrum | None = None,
    mirrors: bool = True,
) -> MitsubaObject:
    """Return a geom's BSDF (a Mitsuba object of the active variant).

    The BSDF is two-sided for geoms that may be open surfaces: planes, meshes and signed distance fields. Its
    transparency is given by the alpha of the geom's rgba.

    to_uv: matrix from the shape's texture coordinates to MuJoCo's, (3, 3); None: they are equal
    measured: a reflectance that replaces the geom's colour
    mirrors: True if the material's mirror reflection is included

    Raises:
        ValueError: the geom has a measured reflectance and a texture that is not grey.
    """
    if measured is None:
        description = _matter(model, geom, surfaces.reflectance_texture(model, geom, to_uv))
    else:
        description = _measured(model, geom, to_uv, measured, _matter)
    share = mirror_share(model, geom) if mirrors else 0.0
    if share > 0:
        silver = {"type": "roughconductor", "material": "none", "alpha": _SILVER}
        description = {"type": "blendbsdf", "weight": share, "bsdf_0": description, "bsdf_1": silver}
    if is_open(model, geom):
        description = {"type": "twosided", "inside": description}
    alpha = float(surfaces.rgba(model, geom)[3])
    if alpha < 1:
        description = {"type": "mask", "opacity": alpha, "inside": description}
    return mi.load_dict(description)


def matt(
    model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None = None, measured: Spectrum | None = None
) -> MitsubaObject:
    """Return the Lambertian, opaque part of a geom's BSDF, two-sided; see `bsdf` for arguments and errors."""
    if measured is None:
        color = surfaces.reflectance_texture(model, geom, to_uv)
        description: Description = {"type": "diffuse", "reflectance": color}
    else:
        description = _measured(model, geom, to_uv, measured, _diffuse)
    return mi.load_dict({"type": "twosided", "inside": description})


def matt_white(model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None = None) -> MitsubaObject:
    """Return a Lambertian, opaque, two-sided BSDF that is white except for the geom's texture."""
    texture = surfaces.texture_id(model, geom)
    color: Description = {"type": "uniform", "value": 1.0}
    if texture >= 0 and surfaces.is_mirrored(model, geom, texture):
        color = surfaces.bitmap(surfaces.linear(model, texture, np.ones(3)), to_uv)
    return mi.load_dict({"type": "twosided", "inside": {"type": "diffuse", "reflectance": color}})


def has_gloss(model: mujoco.MjModel, material: int) -> bool:
    """Return whether a material has gloss, so that it is not Lambertian."""
    if model.mat_metallic[material] >= 0 or model.mat_roughness[material] >= 0:
        return True
    specular, shininess = float(model.mat_specular[material]), float(model.mat_shininess[material])
    return specular > 0 and (specular, shininess) != _UNSET_GLOSS


def _diffuse(model: mujoco.MjModel, geom: int, color: Description) -> Description:
    return {"type": "diffuse", "reflectance": color}


def _matter(model: mujoco.MjModel, geom: int, color: Description) -> Description:
    """Return Mitsuba's description of the BSDF of a geom's material.

    color: Mitsuba's description of the texture that gives the material's colour
    """
    material = model.geom_matid[geom]
    if material < 0 or not has_gloss(model, material):
        return _diffuse(model, geom, color)
    metallic, roughness = float(model.mat_metallic[material]), float(model.mat_roughness[material])
    if metallic >= 0 or roughness >= 0:
        parameters = {"metallic": max(metallic, 0.0), "roughness": roughness if roughness >= 0 else 1.0}
        return {"type": "principled", "base_color": color, **parameters}
    specular, shininess = float(model.mat_specular[material]), float(model.mat_shininess[material])
    root = np.sqrt(0.08 * min(specular, 1.0))
    return {
        "type": "roughplastic",
        "diffuse_reflectance": color,
        "int_ior": float((1 + root) / (1 - root)),
        "ext_ior": 1.0,
        "distribution": "beckmann",
        "alpha": float(np.sqrt(2 / (128 * np.clip(shininess, 0, 1) + 2))),
    }


def _measured(
    model: mujoco.MjModel,
    geom: int,
    to_uv: np.ndarray | None,
    spectrum: Spectrum,
    matter: Callable[[mujoco.MjModel, int, Description], Description],
) -> Description:
    """Return the Mitsuba BSDF of a measured reflectance, multiplied by the geom's texture if it has one.

    to_uv: see `bsdf`
    matter: function that returns the BSDF of the geom's material with a given colour

    Raises:
        ValueError: the texture is not grey.
    """
    whole = matter(model, geom, spectra.described(spectrum))
    texture = surfaces.texture_id(model, geom)
    if texture < 0 or not surfaces.is_mirrored(model, geom, texture):
        return whole
    pixels = surfaces.image(model, texture)
    if np.ptp(pixels, axis=2).max() > 0:
        name = model.material(int(model.geom_matid[geom])).name
        raise ValueError(f"spectra: material {name!r} has a coloured texture: must be grey with a spectrum")
    share = surfaces.linear(model, texture, np.ones(3))[..., :1]
    # Mitsuba cannot multiply textures. Instead, black and the full reflectance are blended, with the texture as weight.
    black = matter(model, geom, {"type": "uniform", "value": 0.0})
    weight = surfaces.bitmap(share, to_uv) | {"raw": True}
    return {"type": "blendbsdf", "weight": weight, "bsdf_0": black, "bsdf_1": whole}
