"""Materials of the built-in worlds: functions that add reflectances, striped textures and daylight to an MjSpec.

MuJoCo's colours are display-referred (sRGB). This module therefore encodes reflectances as sRGB, and `sim.mirror`,
which copies a model to Mitsuba, decodes them (`sim.scene.color`). The renderer takes reflectances only from the colours
and textures of the MjModel, and from measured spectra.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from optics.spectra.spectrum import Spectrum, daylight
from sim.scene.color import encode_srgb, preview

# The values of these reflectances are free choices.
WHITE = 0.9  # reflectance of a light stripe
BLACK = 0.05  # reflectance of a dark stripe
GREY = 0.5  # reflectance of a plain wall, about midway between the stripes
FLOOR = 0.04  # reflectance of the floor
BODY = 0.3  # reflectance of the agent's body

# Directional lights: (azimuth [deg] of the source, elevation [deg] of the source, level). They come from three sides
# and light every wall. Walls that face different directions have different brightness, so that the brightness of a wall
# indicates its direction. There is no sky, because a constant environment light would be the main source of noise in a
# rendering.
LIGHTS = ((20.0, 40.0, 0.9), (140.0, 40.0, 0.6), (260.0, 40.0, 0.45))


def stripes(shape: tuple[int, int], edges: int | Sequence[float], axis: int) -> np.ndarray:
    """Return an image of alternately light and dark stripes, (height, width, 3) uint8, display-referred.

    The first stripe is light. A texel that contains an edge between stripes has the mean reflectance of its area.

    shape: height and width of the image
    edges: positions of the edges between stripes, as fractions of the axis in (0, 1); or the number of stripes, which
        then have equal width
    axis: axis along which light and dark stripes alternate (0: rows, 1: columns)
    """
    n = shape[axis]
    inner = np.arange(1, edges) / edges if isinstance(edges, int) else np.asarray(edges, float)
    bounds = np.concatenate([[0.0], inner, [1.0]])
    light_before = np.concatenate([[0.0], np.cumsum(np.diff(bounds) * (np.arange(len(bounds) - 1) % 2 == 0))])
    light = n * np.diff(np.interp(np.arange(n + 1) / n, bounds, light_before))
    values = BLACK + (WHITE - BLACK) * light
    image = np.broadcast_to(values[:, None] if axis == 0 else values[None, :], shape)
    return np.repeat(np.rint(255 * encode_srgb(image)).astype(np.uint8)[..., None], 3, axis=2)


def add_plain(spec: mujoco.MjSpec, name: str, reflectance: float) -> None:
    """Add a matte grey material."""
    value = float(encode_srgb(reflectance))
    spec.add_material(name=name, rgba=[value, value, value, 1], specular=0, shininess=0)


def add_texture(spec: mujoco.MjSpec, name: str, image: np.ndarray) -> None:
    """Add a 2-D texture from a display-referred image (height, width, 3) uint8, whose row 0 is at the top."""
    height, width, channels = image.shape
    texture = spec.add_texture(
        name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=channels
    )
    texture.data = np.ascontiguousarray(image).tobytes()


def add_textured(
    spec: mujoco.MjSpec,
    name: str,
    texture: str,
    repeat: tuple[float, float] = (1, 1),
    uniform: bool = False,
    color: Sequence[float] = (1.0, 1.0, 1.0),
) -> None:
    """Add a matte material with a 2-D texture that is multiplied by a display-referred colour.

    name, texture: name of the new material, and of a texture of `spec`
    repeat: number of repeats of the texture along each axis, over the whole geom or, if `uniform` is True, over 2 m
    """
    material = spec.add_material(
        name=name, texrepeat=list(repeat), texuniform=uniform, specular=0, shininess=0, rgba=[*color, 1.0]
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = texture


def display_color(reflectance: Spectrum) -> tuple[float, float, float]:
    """Return the display-referred colour (sRGB) of a reflectance in daylight, for renderers that do not use spectra."""
    nm = np.arange(380.0, 781.0, 5.0)
    radiance = reflectance.at(nm * 1e-9) * daylight(nm * 1e-9)
    r, g, b = encode_srgb(np.clip(preview(radiance[:, None, None], nm)[0, 0], 0, 1)).tolist()
    return r, g, b


def add_daylight(spec: mujoco.MjSpec) -> None:
    """Add the directional lights and switch the camera's headlight off."""
    spec.visual.headlight.active = 0
    for i, (azimuth_deg, elevation_deg, level) in enumerate(LIGHTS):
        azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
        towards = np.array(
            [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
        )
        spec.worldbody.add_light(
            name=f"light_{i}",
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            pos=(20 * towards).tolist(),
            dir=(-towards).tolist(),
            diffuse=[level] * 3,
            ambient=[0, 0, 0],
            specular=[0, 0, 0],
        )
