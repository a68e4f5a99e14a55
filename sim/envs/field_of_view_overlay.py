"""Overlay for images: the eyes, their fields of view at eye height, and the viewing directions of receptors.

The camera follows the agent, so the fields of view have a fixed position in the image. Only the parts that obstacles
hide differ between images.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT, Eyes, eye_positions
from sim.pictures.camera_rays import plane_coordinates
from sim.scene.cameras import Viewpoint

# Colours of the eyes, from left to right, repeated if necessary (Okabe and Ito 2008: distinguishable by colour-blind
# readers).
COLORS = np.array(
    [[0, 158, 115], [230, 159, 0], [86, 180, 233], [204, 121, 167], [240, 228, 66], [0, 114, 178], [213, 94, 0]]
)
FILL, RAY, RIM = 0.22, 0.55, 0.95  # opacities of a field's interior, of receptors' directions and of its edges
FARTHEST = 30.0  # [m] length of a ray that hits no surface
MOST_RAYS = 15  # largest number of receptors' directions drawn for one eye, in addition to the edges of its field
FAN = 64  # number of rays in the fan across a field
LINE = 1.2  # [pixels] width of the lines
IRIS, PUPIL = 0.07, 0.045  # [m] radii of the coloured disc and of the black disc in it

# Function from pixel indices, counted row by row, to 1 / depth of the surface visible in these pixels [1/m].
Nearness = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class _Level:
    """Points of the horizontal plane at eye height, in the agent's frame: one for each pixel that sees this plane.

    pixels: indices of these pixels, counted row by row, (n,)
    depth: depth of each point along the camera's axis [m], (n,)
    points: x and y of each point [m], (n, 2)
    pixel: size of a pixel at the depth of each point [m], (n,)
    """

    pixels: np.ndarray
    depth: np.ndarray
    points: np.ndarray
    pixel: np.ndarray


@dataclass(frozen=True)
class _Field:
    """Pixels that show one eye's field of view if nothing hides it.

    Each pixel shows a point of the horizontal plane at eye height. The distance to obstacles is measured along a fan of
    64 rays, which start at the eye and are evenly spaced over its field of view.

    pixels: indices of the pixels, counted row by row, (n,)
    depth: depth of each pixel's point along the camera's axis [m], (n,)
    opacity: opacity of the overlay, (n,)
    distance: distance of each pixel's point from the eye [m], (n,)
    ray: index of the nearest ray to the right of each pixel's point, as seen from the eye, (n,)
    share: angular position of the point between this ray (0) and the next ray to the left (1), (n,)
    """

    pixels: np.ndarray
    depth: np.ndarray
    opacity: np.ndarray
    distance: np.ndarray
    ray: np.ndarray
    share: np.ndarray

    def visible(self, reach: np.ndarray) -> np.ndarray:
        """Return True for each pixel that shows a point visible from the eye, not hidden by an obstacle, (n,) bool.

        reach: distance [m] from the eye to the first obstacle along each of 64 rays, which are evenly spaced over the
            eye's field of view from right to left, (ray,); distances between rays are interpolated
        """
        end = np.diff(reach).take(self.ray)
        end *= self.share
        end += reach.take(self.ray)
        return np.asarray(self.distance <= end)


@dataclass(frozen=True)
class _Dot:
    """Pixels of the disc that marks one eye, including pixels in which obstacles may hide the disc.

    pixels: indices of the pixels, (n,)
    iris, pupil: opacities of the coloured disc and of the black disc in it, (n,)
    depth: depth of the eye along the camera's axis [m]
    """

    pixels: np.ndarray
    iris: np.ndarray
    pupil: np.ndarray
    depth: float


class FieldsOfView:
    """Overlay of the fields of view of one agent's eyes.

    view: viewpoint of the camera in the agent's frame; the origin of this frame is on the floor
    size: size of the images (height, width)
    """

    def __init__(self, eyes: Eyes, view: Viewpoint, size: tuple[int, int]) -> None:
        self.eyes, level = eyes, _level(view, size)
        azimuths = eyes.azimuths()
        places = eye_positions(azimuths)
        self._fields = [_field(level, eyes, azimuth, eye[:2]) for azimuth, eye in zip(azimuths, places, strict=True)]
        self._dots = [_dot(eye + np.array([0, 0, EYE_HEIGHT]), view, size, _radius(eyes)) for eye in places]

    def draw(self, picture: np.ndarray, nearness: Nearness, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
        """Return the image (y, x, 3) uint8 with the visible part of every eye's field of view drawn into it.

        picture: image from the camera, (y, x, 3) uint8; it is not changed
        nearness: function that returns 1 / depth of the surfaces in the image, see `Nearness`
        model, data: MuJoCo's model of the world, and its data with the current poses
        """
        shown = picture.reshape(-1, 3).copy()
        heading = float(data.joint("agent_heading").qpos[0])
        azimuths = self.eyes.azimuths() + heading
        skin = data.qpos[:2] + eye_positions(azimuths)[:, :2]
        for i, (azimuth, eye, field) in enumerate(zip(azimuths, skin, self._fields, strict=True)):
            reach = _reach(azimuth + _fan(self.eyes), eye, model, data)
            within = np.flatnonzero(field.visible(reach))
            pixels = field.pixels.take(within)
            seen = nearness(pixels) * field.depth.take(within) < 1
            pixels, opacity = pixels[seen], field.opacity.take(within[seen])
            before = shown.take(pixels, axis=0).astype(np.float32)
            shown[pixels] = np.rint(before + opacity[:, None] * (_color(i) - before))
        for i, dot in enumerate(self._dots):
            _draw_dot(shown, dot, nearness, _color(i))
        return shown.reshape(picture.shape)


def _draw_dot(shown: np.ndarray, dot: _Dot, nearness: Nearness, color: np.ndarray) -> None:
    """Draw an eye into the pixels `shown`.

    The agent's own body does not hide the eye, so eyes on the far side of the body are visible, too.

    shown: pixels of the image, row by row, (n, 3), which are changed in place
    color: colour of the iris, (3,)
    """
    free = nearness(dot.pixels) * (dot.depth - 2 * BODY_RADIUS) < 1
    under = shown[dot.pixels].astype(np.float32)
    colored = under + (free * dot.iris)[:, None] * (color - under)
    shown[dot.pixels] = np.rint(colored * (1 - free * dot.pupil)[:, None])


def _color(eye: int) -> np.ndarray:
    return COLORS[eye % len(COLORS)].astype(np.float32)


def _level(view: Viewpoint, size: tuple[int, int]) -> _Level:
    across, above = plane_coordinates(view.fovy_deg, size)
    x, y = (a.ravel() for a in np.meshgrid(across, above))
    directions = np.stack([x, y, -np.ones_like(x)], axis=1) @ view.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (EYE_HEIGHT - view.position[2]) / directions[:, 2]
    pixels = np.flatnonzero((depth > 0) & np.isfinite(depth))
    depth = depth[pixels]
    points = view.position[:2] + depth[:, None] * directions[pixels, :2]
    return _Level(pixels, depth, points, depth * _pixel(view, size))


def _pixel(view: Viewpoint, size: tuple[int, int]) -> float:
    """Return the size of a pixel [m] at a depth of 1 m."""
    return float(2 * np.tan(np.radians(view.fovy_deg) / 2) / size[0])


def _field(level: _Level, eyes: Eyes, azimuth: float, eye: np.ndarray) -> _Field:
    """Return the field of view of an eye at the position `eye` (2,) [m], with the eye's axis at this azimuth [rad]."""
    half = np.radians(eyes.fov_deg) / 2
    offset = level.points - eye
    distance = np.linalg.norm(offset, axis=1)
    angle = (np.arctan2(offset[:, 1], offset[:, 0]) - azimuth + np.pi) % (2 * np.pi) - np.pi
    opacity = np.where(np.abs(angle) <= half, FILL, 0.0)
    rims = [(ray, RIM) for ray in (-half, half)]
    for ray, strength in [*((ray, RAY) for ray in _receptor_rays(eyes)), *rims]:
        off = distance * np.abs(np.sin(angle - ray)) / level.pixel
        line = np.where(np.cos(angle - ray) > 0, strength * np.clip(LINE / 2 + 0.5 - off, 0, 1), 0.0)
        opacity = np.maximum(opacity, line)
    rows = np.flatnonzero((opacity > 0) & (distance <= FARTHEST))
    place = np.clip((angle[rows] + half) / (2 * half), 0, 1) * (FAN - 1)
    ray = np.minimum(place.astype(np.int32), FAN - 2)
    share = (place - ray).astype(np.float32)
    depth, opacity, distance = (a[rows].astype(np.float32) for a in (level.depth, opacity, distance))
    return _Field(level.pixels[rows], depth, opacity, distance, ray, share)


def _fan(eyes: Eyes) -> np.ndarray:
    """Return the azimuths [rad] of 64 rays evenly spaced over an eye's field of view, relative to its axis, (64,)."""
    half = np.radians(eyes.fov_deg) / 2
    return np.linspace(-half, half, FAN)


def _receptor_rays(eyes: Eyes) -> np.ndarray:
    """Return the azimuths [rad] of receptor columns, (column,), see `Eyes.column_azimuths`.

    If there are more than 15 columns, only every k-th is included, with the smallest k that leaves at most 15.
    """
    columns = eyes.resolution[1]
    return eyes.column_azimuths()[:: -(-columns // MOST_RAYS)]


def _radius(eyes: Eyes) -> float:
    """Return the radius of an iris [m], small enough that an eye does not overlap the next eye on its right."""
    apart = np.abs(np.diff(eyes.azimuths())).min(initial=np.pi)
    return float(min(IRIS, BODY_RADIUS * np.sin(apart / 2)))


def _dot(eye: np.ndarray, view: Viewpoint, size: tuple[int, int], radius: float) -> _Dot:
    x, y, z = (eye - view.position) @ view.rotation
    across, above = plane_coordinates(view.fovy_deg, size)
    off = np.hypot(across - x / -z, above[:, None] - y / -z).ravel() * -z
    pixel = -z * _pixel(view, size)
    iris, pupil = (np.clip((r - off) / pixel + 0.5, 0, 1) for r in (radius, radius * PUPIL / IRIS))
    pixels = np.flatnonzero(iris > 0)
    return _Dot(pixels, iris[pixels].astype(np.float32), pupil[pixels].astype(np.float32), float(-z))


def _reach(azimuths: np.ndarray, eye: np.ndarray, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the distance to the first surface along these azimuths [m], ignoring the agent's own body.

    Without a hit, it is 30 m (FARTHEST).

    azimuths: directions in the world's frame [rad], (n,)
    eye: x and y of the pupil [m], (2,)
    """
    n = len(azimuths)
    rays = np.stack([np.cos(azimuths), np.sin(azimuths), np.zeros(n)], axis=1)
    hit, distance = np.empty(n, np.int32), np.empty(n)
    origin, groups = np.array([*eye, EYE_HEIGHT]), np.array([True, True, True, False, False, False], np.uint8)
    agent = model.body("agent").id
    mujoco.mj_multiRay(model, data, origin, rays.ravel(), groups, True, agent, hit, distance, None, n, FARTHEST)
    return np.where(hit >= 0, distance, FARTHEST).astype(np.float32)
