"""What eyes look at, drawn into a picture of their world: fields of view on the eyes' level, and receptors' rays."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.eyes.eyes import EYE_HEIGHT, Eyes, eye_positions
from sim.scene.cameras import Viewpoint

# One colour per eye, from left to right, then again (Okabe and Ito 2008: told apart by the colour-blind, too).
COLORS = np.array(
    [[0, 158, 115], [230, 159, 0], [86, 180, 233], [204, 121, 167], [240, 228, 66], [0, 114, 178], [213, 94, 0]]
)
FILL, RAY, RIM = 0.22, 0.55, 0.95  # opacities
FARTHEST = 30.0  # [m] of a ray that meets nothing
MOST_RAYS = 15  # drawn of one eye, beside the rims
FAN = 64  # rays that find out how far a field reaches
LINE = 1.2  # [pixels] width


@dataclass(frozen=True)
class HorizontalSection:
    """The part of a picture in which the level of the eyes is seen, nothing in front of it.

    seen: (y, x) bool · points: (y, x, 2) [m] in the world · pixel: size of a pixel there [m], (y, x)
    """

    seen: np.ndarray
    points: np.ndarray
    pixel: np.ndarray


def level_of(view: Viewpoint, depth: np.ndarray) -> HorizontalSection:
    """depth: (y, x) [m] along the camera's axis."""
    height, width = depth.shape
    half = np.tan(np.radians(view.fovy_deg) / 2)
    y, x = np.indices(depth.shape)
    right, up = (x + 0.5 - width / 2) / (height / 2) * half, -(y + 0.5 - height / 2) / (height / 2) * half
    directions = np.stack([right, up, -np.ones_like(right)], axis=-1) @ view.rotation.T
    with np.errstate(divide="ignore"):
        t = (EYE_HEIGHT - view.position[2]) / directions[..., 2]
    seen = (t > 0) & (t < depth) & np.isfinite(t)
    t = np.where(seen, t, 0.0)
    return HorizontalSection(seen, view.position[:2] + t[..., None] * directions[..., :2], t * 2 * half / height)


def draw_fields(
    picture: np.ndarray, view: Viewpoint, depth: np.ndarray, eyes: Eyes, model: mujoco.MjModel, data: mujoco.MjData
) -> np.ndarray:
    """A picture (y, x, 3) uint8 with the field of every eye where nothing hides it; data: where everything is."""
    level = level_of(view, depth)
    position, heading = data.qpos[:2], float(data.joint("agent_heading").qpos[0])
    out = picture.astype(float)
    azimuths = eyes.azimuths() + heading
    skin = position + eye_positions(azimuths)[:, :2]
    for i, (azimuth, eye) in enumerate(zip(azimuths, skin, strict=True)):
        opacity = np.where(level.seen, _opacity(level, eyes, azimuth, eye, model, data), 0.0)[..., None]
        out += opacity * (COLORS[i % len(COLORS)] - out)
    return np.rint(out).astype(np.uint8)


def _opacity(
    level: HorizontalSection, eyes: Eyes, azimuth: float, eye: np.ndarray, model: mujoco.MjModel, data: mujoco.MjData
) -> np.ndarray:
    """Of one eye's field, (y, x)."""
    half = np.radians(eyes.fov_deg) / 2
    offset = level.points - eye
    distance = np.linalg.norm(offset, axis=-1)
    angle = (np.arctan2(offset[..., 1], offset[..., 0]) - azimuth + np.pi) % (2 * np.pi) - np.pi
    fan = np.linspace(-half, half, FAN)
    reach = np.interp(angle, fan, _reach(azimuth + fan, eye, model, data))
    opacity = np.where((np.abs(angle) <= half) & (distance <= reach), FILL, 0.0)
    rims = [(ray, RIM) for ray in (-half, half)]
    for ray, strength in [*((ray, RAY) for ray in _receptor_rays(eyes)), *rims]:
        off = distance * np.abs(np.sin(angle - ray)) / np.maximum(level.pixel, 1e-9)
        near = (np.cos(angle - ray) > 0) & (distance <= reach)
        opacity = np.maximum(opacity, np.where(near, strength * np.clip(LINE / 2 + 0.5 - off, 0, 1), 0.0))
    return opacity


def _receptor_rays(eyes: Eyes) -> np.ndarray:
    """Azimuths of columns of receptors from the eye's axis, not all if there are many; positive to the left."""
    columns = eyes.resolution[1]
    shown = np.arange(columns)[:: -(-columns // MOST_RAYS)]
    across = np.tan(np.radians(eyes.fov_deg) / 2)
    return -np.arctan((2 * shown + 1 - columns) / columns * across)


def _reach(azimuths: np.ndarray, eye: np.ndarray, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """How far one sees along these azimuths [m], looking through the agent's own body."""
    n = len(azimuths)
    rays = np.stack([np.cos(azimuths), np.sin(azimuths), np.zeros(n)], axis=-1)
    hit, distance = np.full(n, -1, np.int32), np.full(n, -1.0)
    origin, groups = np.array([*eye, EYE_HEIGHT]), np.array([1, 1, 1, 0, 0, 0], np.uint8)
    agent = model.body("agent").id
    mujoco.mj_multiRay(model, data, origin, rays.ravel(), groups, True, agent, hit, distance, None, n, FARTHEST)
    return np.where(hit >= 0, distance, FARTHEST)
