"""Materials and textures as Mitsuba BSDFs: Lambertian, with the spectrum that Jakob and Hanika (2019) give an RGB
reflectance. Colours of MuJoCo are display-referred and are linearised here."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import mujoco
import numpy as np

from optics.tabulated import Spectrum
from sim.color import decode_srgb
from sim.scene import spectra

# MuJoCo's own sign that a geom's rgba was not set, and its material's counts.
_UNSET_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


def geom_type(model: mujoco.MjModel, geom: int) -> mujoco.mjtGeom:
    """A geom's kind as an enum: numpy's integers equal its members in one direction only."""
    return mujoco.mjtGeom(int(model.geom_type[geom]))


def rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Display-referred colour (4,) of a geom, by MuJoCo's rule: its own unless unset, then its material's."""
    own = model.geom_rgba[geom]
    material = model.geom_matid[geom]
    if material >= 0 and np.array_equal(own, _UNSET_RGBA):
        return model.mat_rgba[material].astype(float)
    return own.astype(float)


def texture_id(model: mujoco.MjModel, geom: int) -> int:
    """Colour texture of a geom's material, -1 for none."""
    material = model.geom_matid[geom]
    if material < 0:
        return -1
    roles = mujoco.mjtTextureRole
    for role in (roles.mjTEXROLE_RGB, roles.mjTEXROLE_RGBA):
        if model.mat_texid[material, role] >= 0:
            return int(model.mat_texid[material, role])
    return -1


def texture_repeat(model: mujoco.MjModel, geom: int, size: np.ndarray) -> np.ndarray:
    """Repeats (u, v) over a geom: the material's, times the size along x and y where it is uniform."""
    material = model.geom_matid[geom]
    repeat = model.mat_texrepeat[material].astype(float)
    if model.mat_texuniform[material]:
        repeat = repeat * np.where(size[:2] > 0, size[:2], 1.0)
    return repeat


def image(model: mujoco.MjModel, texture: int) -> np.ndarray:
    """A texture's image (height, width, 3), as MuJoCo stores it, scaled to [0, 1], row 0 on top."""
    shape = model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture]
    start = model.tex_adr[texture]
    pixels = model.tex_data[start : start + int(np.prod(shape))].reshape(shape).astype(np.float32) / 255
    return np.repeat(pixels, 3, axis=2) if shape[2] == 1 else pixels[..., :3]


def reflectance(model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None = None) -> dict[str, Any]:
    """Mitsuba texture of a geom's reflectance; `to_uv` (3, 3) turns the shape's texture coordinates to MuJoCo's."""
    color = rgba(model, geom)[:3]
    texture = texture_id(model, geom)
    if texture < 0 or model.tex_type[texture] != mujoco.mjtTexture.mjTEXTURE_2D:
        return {"type": "rgb", "value": [float(c) for c in np.clip(decode_srgb(color), 0, 1)]}
    pixels = image(model, texture)
    if model.tex_colorspace[texture] == mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR:
        linear = pixels * decode_srgb(color)
    else:
        linear = decode_srgb(pixels * color)
    return _bitmap(linear, to_uv)


def _bitmap(linear: np.ndarray, to_uv: np.ndarray | None) -> dict[str, Any]:
    """Mitsuba texture of an image (height, width, 1 or 3), row 0 on top, that repeats."""
    # Given as an object, a bitmap has its first row at v = 0, as in MuJoCo (a bitmap's `data` would be taken as
    # coefficients of spectra, not as RGB).
    bitmap = mi.Bitmap(np.ascontiguousarray(linear, dtype=np.float32))
    bitmap.set_srgb_gamma(False)
    transform = mi.ScalarTransform3f((np.eye(3) if to_uv is None else to_uv).tolist())
    return {"type": "bitmap", "bitmap": bitmap, "wrap_mode": "repeat", "to_uv": transform}


def _measured(model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None, spectrum: Spectrum) -> dict[str, Any]:
    """Mitsuba BSDF of a measured reflectance, multiplied by the geom's texture if it has one."""
    whole = {"type": "diffuse", "reflectance": spectra.described(spectrum)}
    texture = texture_id(model, geom)
    if texture < 0 or model.tex_type[texture] != mujoco.mjtTexture.mjTEXTURE_2D:
        return whole
    pixels = image(model, texture)
    if np.ptp(pixels, axis=2).max() > 0:
        name = model.material(int(model.geom_matid[geom])).name
        raise ValueError(f"spectra: material {name!r} has a coloured texture: must be grey beside a spectrum")
    is_linear = model.tex_colorspace[texture] == mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
    share = pixels[..., :1] if is_linear else decode_srgb(pixels[..., :1])
    # Mitsuba multiplies no textures: black and the whole reflectance are mixed instead, pixel by pixel.
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    return {"type": "blendbsdf", "weight": _bitmap(share, to_uv) | {"raw": True}, "bsdf_0": black, "bsdf_1": whole}


def is_open(model: mujoco.MjModel, geom: int) -> bool:
    """Whether the inner side of a geom's surface can be seen."""
    return geom_type(model, geom) in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_MESH)


def bsdf(model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None = None, measured: Spectrum | None = None) -> Any:
    """A geom's BSDF (a Mitsuba object of the variant in force): Lambertian; both sides of planes and meshes, which
    may be open; see-through by its rgba's alpha. `measured`: a reflectance that takes the place of its colour."""
    description = (
        {"type": "diffuse", "reflectance": reflectance(model, geom, to_uv)}
        if measured is None
        else _measured(model, geom, to_uv, measured)
    )
    if is_open(model, geom):
        description = {"type": "twosided", "inside": description}
    alpha = float(rgba(model, geom)[3])
    if alpha < 1:
        description = {"type": "mask", "opacity": alpha, "inside": description}
    return mi.load_dict(description)
