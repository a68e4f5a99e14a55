"""Colours and textures of geoms. MuJoCo's colours are display-referred; they are linearised here and get the spectrum
that Jakob and Hanika (2019) give an RGB reflectance."""

from __future__ import annotations

from collections.abc import Sequence

import mitsuba as mi
import mujoco
import numpy as np

from sim.scene import cube
from sim.scene.color import decode_srgb
from sim.scene.variant import Description

# MuJoCo's own sign that a geom's rgba was not set, and its material's counts.
UNSET_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
_ROLES = mujoco.mjtTextureRole


def geom_type(model: mujoco.MjModel, geom: int) -> mujoco.mjtGeom:
    """A geom's kind as an enum: numpy's integers equal its members in one direction only."""
    return mujoco.mjtGeom(int(model.geom_type[geom]))


def set_rgba(color: Sequence[float]) -> np.ndarray:
    """The nearest colour (4,) that MuJoCo does not take for none, as it takes the grey UNSET_RGBA."""
    found = np.array(color, np.float32)
    if np.array_equal(found, UNSET_RGBA):
        found[:3] = np.nextafter(found[:3], np.float32(1))  # all three: a grey reflects all bands alike
    return found


def rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Display-referred colour (4,) of a geom, by MuJoCo's rule: its own unless unset, then its material's."""
    own = model.geom_rgba[geom]
    material = model.geom_matid[geom]
    if material >= 0 and np.array_equal(own, UNSET_RGBA):
        return model.mat_rgba[material].astype(float)
    return own.astype(float)


def visible(model: mujoco.MjModel, groups: Sequence[int]) -> list[int]:
    """Ids of the geoms that are to be seen: those of these groups, but for what is wholly transparent."""
    return [g for g in range(model.ngeom) if model.geom_group[g] in groups and rgba(model, g)[3] > 0]


def texture_id(model: mujoco.MjModel, geom: int) -> int:
    """Colour texture of a geom's material, -1 for none."""
    material = model.geom_matid[geom]
    if material < 0:
        return -1
    for role in (_ROLES.mjTEXROLE_RGB, _ROLES.mjTEXROLE_RGBA):
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


def faces_of(model: mujoco.MjModel, texture: int) -> int:
    """Square images that a texture holds: 6, or 1 that is on all sides, of a cube; 0 for a 2-D texture."""
    if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D:
        return 0
    return int(model.tex_height[texture] // model.tex_width[texture])


def image(model: mujoco.MjModel, texture: int) -> np.ndarray:
    """A texture's image (height, width, 3), as MuJoCo stores it, scaled to [0, 1], row 0 on top; of a cube, the faces
    below each other, each with a border (`cube.padded`)."""
    shape = model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture]
    start = model.tex_adr[texture]
    pixels = model.tex_data[start : start + int(np.prod(shape))].reshape(shape).astype(np.float32) / 255
    pixels = np.repeat(pixels[..., :1], 3, axis=2) if shape[2] < 3 else pixels[..., :3]
    return cube.padded(pixels) if faces_of(model, texture) else pixels


def linear(model: mujoco.MjModel, texture: int, color: np.ndarray) -> np.ndarray:
    """A texture's image times a display-referred colour (3,), linear, (height, width, 3)."""
    pixels = image(model, texture)
    if model.tex_colorspace[texture] == mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR:
        return pixels * decode_srgb(color)
    return decode_srgb(pixels * color)


def reflectance_texture(model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None = None) -> Description:
    """Mitsuba texture of a geom's reflectance; `to_uv` (3, 3) turns the shape's texture coordinates to MuJoCo's."""
    color = rgba(model, geom)[:3]
    texture = texture_id(model, geom)
    if texture < 0 or not is_mirrored(model, geom, texture):
        return {"type": "rgb", "value": [float(c) for c in np.clip(decode_srgb(color), 0, 1)]}
    return bitmap(linear(model, texture, color), to_uv)


def bitmap(values: np.ndarray, to_uv: np.ndarray | None) -> Description:
    """Mitsuba texture of an image (height, width, 1 or 3), row 0 on top, that repeats."""
    # Given as an object, a bitmap has its first row at v = 0, as in MuJoCo (a bitmap's `data` would be taken as
    # coefficients of spectra, not as RGB).
    picture = mi.Bitmap(np.ascontiguousarray(values, dtype=np.float32))
    picture.set_srgb_gamma(False)
    transform = mi.ScalarTransform3f((np.eye(3) if to_uv is None else to_uv).tolist())
    return {"type": "bitmap", "bitmap": picture, "wrap_mode": "repeat", "to_uv": transform}


def is_mirrored(model: mujoco.MjModel, geom: int, texture: int) -> bool:
    """Whether a texture shows on a geom: a cube's on a plane is looked up along the plane, where it has no image."""
    return not (faces_of(model, texture) and geom_type(model, geom) == mujoco.mjtGeom.mjGEOM_PLANE)
