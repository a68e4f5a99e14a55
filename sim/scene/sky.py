"""MuJoCo's skybox as light from infinity.

MuJoCo draws a skybox behind everything. Here it also illuminates the scene, as a sky does. Between 360 and 780 nm,
white in the skybox has the same radiance as a white Lambertian surface that faces a light whose `diffuse` is 1. For the
direction (x, y, z) in the world, MuJoCo reads the cube texture at (x, z, -y): faces R and L are visible towards +x and
-x, U and D towards +z and -z, F and B towards -y and +y.
"""

from __future__ import annotations

import mitsuba as mi
import mujoco
import numpy as np

from sim.scene import cube, surfaces
from sim.scene.variant import Description

MAX_ROWS = 1024  # limit for the rows of the panorama


def texture(model: mujoco.MjModel) -> int:
    """Return the index of the model's first skybox texture, the one that MuJoCo draws, or -1 if there is none."""
    found = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    return int(found[0]) if len(found) else -1


def description(model: mujoco.MjModel, white: float) -> Description | None:
    """Return Mitsuba's `envmap` of the model's skybox; None without a skybox, or with a black one.

    white: radiance of white, as a multiple of Mitsuba's spectrum `d65`. (An `envmap` multiplies its image by `d65`.)
    """
    skybox = texture(model)
    if skybox < 0:
        return None
    panorama = _panorama(surfaces.linear(model, skybox, np.ones(3)))
    if not panorama.any():
        return None
    bitmap = mi.Bitmap(np.ascontiguousarray(panorama, dtype=np.float32))
    bitmap.set_srgb_gamma(False)
    return {
        "type": "envmap",
        "bitmap": bitmap,
        "scale": white,
        # Mitsuba's y is up.
        "to_world": mi.ScalarTransform4f([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]),
    }


def _panorama(image: np.ndarray) -> np.ndarray:
    """Return the latitude-longitude image (rows, 2 rows, 3) of a cube texture.

    The left edge of the result is at the direction -z of Mitsuba's frame, and the columns continue towards +x. Rows run
    from +y to -y. The centres of the first and the last row are on the poles.

    image: the faces of the cube texture, stacked vertically, each with a border (`cube.padded`)
    """
    pitch = image.shape[1]
    rows = min(MAX_ROWS, 2 * (pitch - 2 * cube.BORDER))
    rows = max(rows, 16)
    polar = np.pi * np.arange(rows) / (rows - 1)
    azimuth = np.pi * (np.arange(2 * rows) + 0.5) / rows
    sin = np.sin(polar)[:, None]
    x, y, z = np.broadcast_arrays(sin * np.sin(azimuth), np.cos(polar)[:, None], -sin * np.cos(azimuth))
    # Mitsuba's (x, y, z) is the world's (x, -z, y). MuJoCo looks up the world's (x, y, z) at (x, z, -y).
    face, at = cube.look_up(np.stack([x, y, z], axis=-1).reshape(-1, 3))
    if len(image) == pitch:
        face = np.zeros_like(face)
    where = cube.BORDER - 0.5 + at * (pitch - 2 * cube.BORDER)
    return _bilinear(image, where[:, 0], where[:, 1] + face * pitch).reshape(rows, 2 * rows, 3)


def _bilinear(image: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    left, top = np.clip(left, 0, image.shape[1] - 2), np.clip(top, 0, image.shape[0] - 2)
    right, down = (column - left)[:, None], (row - top)[:, None]
    upper = image[top, left] * (1 - right) + image[top, left + 1] * right
    lower = image[top + 1, left] * (1 - right) + image[top + 1, left + 1] * right
    return upper * (1 - down) + lower * down
