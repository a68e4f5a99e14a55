"""Marks of eyes on images of a model: a dot for each eye, and the borders of its field of view."""

from __future__ import annotations

import numpy as np

from sim.scene.cameras import Viewpoint

# One colour per eye, repeated (Okabe and Ito 2008: distinguishable for colour-blind readers, too).
COLORS = np.array(
    [[0, 158, 115], [230, 159, 0], [86, 180, 233], [204, 121, 167], [240, 228, 66], [0, 114, 178], [213, 94, 0]]
)
NEAREST = 1e-6  # fraction of `reach`: points closer to the camera's plane are not drawn
RIM, IRIS, PUPIL = 1.2, 3.5, 1.8  # width of borders and radii of dots [pixels of an image that is 360 pixels high]
OPACITY = 0.8


def with_eyes(
    picture: np.ndarray, view: Viewpoint, eyes: tuple[np.ndarray, np.ndarray], fov_deg: float, reach: float
) -> np.ndarray:
    """Return an image of a model, (y, x, 3) uint8, in which the model's eyes are marked.

    Each eye gets a dot, and two lines along the left and right borders of its field of view.

    eyes: pupils [m] (eye, 3) and frames (eye, 3, 3), columns (right, up, ahead)
    fov_deg: horizontal field of view of the eyes [degrees]
    reach: length of the lines along the borders [m]
    """
    shown, half = picture.astype(np.float64), np.radians(fov_deg) / 2
    scale = picture.shape[0] / 360
    for number, (pupil, frame) in enumerate(zip(*eyes, strict=True)):
        color = COLORS[number % len(COLORS)]
        right, _, ahead = frame.T
        ends = [pupil + reach * (np.cos(half) * ahead + side * np.sin(half) * right) for side in (-1, 1)]
        places = [_pixel(point, view, picture.shape[:2], reach) for point in (pupil, *ends)]
        if places[0] is None:
            continue
        for end in places[1:]:
            if end is not None:
                _paint(shown, _off(places[0], end, picture.shape[:2]), RIM * scale / 2, color)
        off = _off(places[0], places[0], picture.shape[:2])
        _paint(shown, off, IRIS * scale, color)
        _paint(shown, off, PUPIL * scale, np.zeros(3))
    return np.rint(shown).astype(np.uint8)


def _pixel(point: np.ndarray, view: Viewpoint, size: tuple[int, int], reach: float) -> np.ndarray | None:
    """Return the position (x, y) of a point in an image [pixels]; None if it is behind the camera.

    point: position in the world [m], (3,)
    size: height and width of the image [pixels]
    reach: length of the drawn lines [m]; points that are less than 10⁻⁶ times `reach` in front of the camera count as
        behind it
    """
    right, up, back = (point - view.position) @ view.rotation
    if -back < NEAREST * reach:
        return None
    per_pixel = 2 * np.tan(np.radians(view.fovy_deg) / 2) / size[0]
    return np.array([size[1] / 2 - right / back / per_pixel, size[0] / 2 + up / back / per_pixel])


def _off(start: np.ndarray, end: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return the distance [pixels] of each pixel's centre from a line segment, array (y, x).

    start, end: ends of the segment, (x, y) [pixels]
    size: height and width of the image [pixels]
    """
    y, x = np.indices(size) + 0.5
    along = end - start
    length = float(along @ along)
    share = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / length, 0, 1) if length > 0 else 0.0
    distance: np.ndarray = np.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1])
    return distance


def _paint(shown: np.ndarray, off: np.ndarray, radius: float, color: np.ndarray) -> None:
    """Paint a line or dot into an image, with smooth edges.

    shown: the image (y, x, 3), changed in place
    off: distances of the pixels' centres from the line or dot [pixels], (y, x)
    radius: radius of the dot, or half the width of the line [pixels]
    """
    opacity = OPACITY * np.clip(radius + 0.5 - off, 0, 1)[..., None]
    shown += opacity * (color - shown)
