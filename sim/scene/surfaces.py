"""Colours and textures of geoms.

MuJoCo's colours and textures are display-referred. They are linearised here, except for textures that contain linear
light already (see `linear_textures`). Jakob and Hanika's (2019) method assigns a spectrum to each RGB reflectance.
"""

from __future__ import annotations

from collections.abc import Sequence

import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.arguments import is_sized, shown
from optics.numerics.number_types import is_boolean
from sim.scene import cube
from sim.scene.color import decode_srgb
from sim.scene.linear_textures import is_linear
from sim.scene.variant import Description

# MuJoCo's marker for a geom whose rgba is not set, so that its material's rgba applies.
UNSET_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
_ROLES = mujoco.mjtTextureRole


def geom_type(model: mujoco.MjModel, geom: int) -> mujoco.mjtGeom:
    """Return a geom's kind as a member of the enum.

    The model stores a NumPy integer. It is converted, because the result of comparing it with a member of the enum
    depends on which of the two is on the left.
    """
    return mujoco.mjtGeom(int(model.geom_type[geom]))


def set_rgba(color: Sequence[float]) -> np.ndarray:
    """Return a colour (4,) for a geom.

    The grey (0.5, 0.5, 0.5, 1), which MuJoCo interprets as unset, is replaced by the next lighter grey.
    """
    found = np.array(color, np.float32)
    if np.array_equal(found, UNSET_RGBA):
        found[:3] = np.nextafter(found[:3], np.float32(1))  # all change alike, so that grey remains grey
    return found


def rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return the display-referred colour (4,) of a geom.

    By MuJoCo's rule, it is the geom's own colour if this is set or there is no material, else the material's colour.
    """
    own = model.geom_rgba[geom]
    material = model.geom_matid[geom]
    if material >= 0 and np.array_equal(own, UNSET_RGBA):
        return model.mat_rgba[material].astype(float)
    return own.astype(float)


def visible(model: mujoco.MjModel, groups: Sequence[int]) -> list[int]:
    """Return the ids of the visible geoms: all geoms in these groups that are not completely transparent.

    Raises:
        ValueError: `groups` is not a collection of whole numbers.
    """
    if not is_sized(groups) or not all(isinstance(g, int | np.integer) and not is_boolean(g) for g in groups):
        raise ValueError(f"groups = {shown(groups)}: must be numbers of geom groups, such as (0, 1, 2)")
    return [g for g in range(model.ngeom) if model.geom_group[g] in groups and rgba(model, g)[3] > 0]


def require_geoms(model: mujoco.MjModel, geoms: Sequence[int], where: str = "") -> None:
    """Raise a ValueError if `geoms` is empty, for example because MuJoCo has discarded the visuals of a URDF.

    where: beginning of the error message
    """
    if len(geoms):
        return
    why = "the model has no visible geom of a kind that can be mirrored"
    if not model.ngeom:
        why = (
            "the model has no geoms; MuJoCo discards the visuals of a URDF, unless its <robot> contains "
            '<mujoco><compiler discardvisual="false"/></mujoco>'
        )
    raise ValueError(f"{where}{why}")


def texture_id(model: mujoco.MjModel, geom: int) -> int:
    """Return the index of the colour texture of a geom's material, -1 for none."""
    material = model.geom_matid[geom]
    if material < 0:
        return -1
    for role in (_ROLES.mjTEXROLE_RGB, _ROLES.mjTEXROLE_RGBA):
        if model.mat_texid[material, role] >= 0:
            return int(model.mat_texid[material, role])
    return -1


def texture_repeat(model: mujoco.MjModel, geom: int, size: np.ndarray) -> np.ndarray:
    """Return the numbers (u, v) of repetitions of the texture over a geom, (2,).

    They are the material's `texrepeat`. If the material has `texuniform`, they are multiplied by the geom's half sizes
    along x and y, except where a half size is 0.

    size: half sizes of the geom, see `sim.scene.shapes.half_sizes`
    """
    material = model.geom_matid[geom]
    repeat = model.mat_texrepeat[material].astype(float)
    if model.mat_texuniform[material]:
        repeat = repeat * np.where(size[:2] > 0, size[:2], 1.0)
    return repeat


def faces_of(model: mujoco.MjModel, texture: int) -> int:
    """Return the number of square images in a cube texture; 0 for a 2-D texture.

    The number is 6, or 1 if all sides of the cube show the same image.
    """
    if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D:
        return 0
    return int(model.tex_height[texture] // model.tex_width[texture])


def image(model: mujoco.MjModel, texture: int) -> np.ndarray:
    """Return a texture's image (height, width, 3), as MuJoCo stores it, scaled to [0, 1], with row 0 at the top.

    For a cube texture, the faces are stacked vertically, each with a border (`cube.padded`).
    """
    shape = model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture]
    start = model.tex_adr[texture]
    pixels = model.tex_data[start : start + int(np.prod(shape))].reshape(shape).astype(np.float32) / 255
    pixels = np.repeat(pixels[..., :1], 3, axis=2) if shape[2] < 3 else pixels[..., :3]
    return cube.padded(pixels) if faces_of(model, texture) else pixels


def linear(model: mujoco.MjModel, texture: int, color: np.ndarray) -> np.ndarray:
    """Return a texture's image, multiplied by a display-referred colour (3,), as linear light, (height, width, 3)."""
    pixels = image(model, texture)
    return pixels * decode_srgb(color) if is_linear(model, texture) else decode_srgb(pixels * color)


def reflectance_texture(model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None = None) -> Description:
    """Return the Mitsuba texture of a geom's reflectance.

    to_uv: matrix from the shape's texture coordinates to MuJoCo's, (3, 3); None: they are equal
    """
    color = rgba(model, geom)[:3]
    texture = texture_id(model, geom)
    if texture < 0 or not is_mirrored(model, geom, texture):
        return {"type": "rgb", "value": [float(c) for c in np.clip(decode_srgb(color), 0, 1)]}
    return bitmap(linear(model, texture, color), to_uv)


def bitmap(values: np.ndarray, to_uv: np.ndarray | None) -> Description:
    """Return a Mitsuba texture that repeats an image periodically.

    values: the image in linear light (not sRGB-encoded), with row 0 at the top, (height, width, 1 or 3)
    to_uv: matrix from the shape's texture coordinates to MuJoCo's, (3, 3); None: they are equal
    """
    # A bitmap that is passed as an object has its first row at v = 0, as in MuJoCo. (Mitsuba would interpret a bitmap's
    # `data` as coefficients of spectra instead of RGB.)
    picture = mi.Bitmap(np.ascontiguousarray(values, dtype=np.float32))
    picture.set_srgb_gamma(False)
    transform = mi.ScalarTransform3f((np.eye(3) if to_uv is None else to_uv).tolist())
    return {"type": "bitmap", "bitmap": picture, "wrap_mode": "repeat", "to_uv": transform}


def is_mirrored(model: mujoco.MjModel, geom: int, texture: int) -> bool:
    """Return whether a texture is visible on a geom.

    All textures are visible, except cube textures on planes. A cube texture is looked up in the direction from the
    geom's centre to a point. For points of a plane, these directions lie in the plane itself, so they meet the cube
    only along a line and not in an image.
    """
    return not (faces_of(model, texture) and geom_type(model, geom) == mujoco.mjtGeom.mjGEOM_PLANE)
