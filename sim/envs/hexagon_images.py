"""Signals of compound eyes as images for human viewers: a map of the visual field in which ommatidia are hexagons."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial import KDTree

from sim.envs.retina_images import BETWEEN, GAP, hues_of, shares_of
from sim.eyes.compound_eye import CompoundEye
from sim.scene.color import encode_srgb

SIZE = 480, 960  # choice: largest height and width of a map in pixels; hexagons of a thousand ommatidia stay visible
RIM = 0.93  # choice: radius of a drawn hexagon, relative to a hexagon that touches its neighbours
OUTER = 0.95  # choice: largest radius of a hexagon at the map's edge, relative to its circumscribed circle
ALONE = 0.05  # choice: radius [rad] of the hexagon of a single ommatidium


def hexagon_map(frame: np.ndarray, eye: CompoundEye) -> np.ndarray:
    """Return an sRGB image (y, x, 3) uint8 of the signals of a compound eye, with one map per mount.

    A mount is a position and direction of the eye on the animal. Each map is Hammer's equal-area projection of the
    sphere: ahead is in the middle, left is on the left, and up is at the top. A map shows the part of the sphere that
    has ommatidia. A pixel has the colour of the ommatidium with the nearest direction, which gives hexagons on a
    hexagonal lattice. Pixels at the edges of hexagons and around the eye's field are grey. Each receptor type is shown
    in the same colour as in `retina_images.side_by_side`. A white surface in full daylight is shown as white.

    frame: signals of the ommatidia of all mounts, one mount after the other, (ommatidium, channel)
    """
    linear = np.einsum("enc,nck->enk", frame.reshape(-1, len(eye), frame.shape[-1]), _palette(eye))
    colours = np.rint(255 * encode_srgb(np.clip(linear, 0, 1))).astype(np.uint8)
    numbers = _numbers(eye)
    images = np.insert(colours, len(eye), BETWEEN, axis=1)[:, numbers]
    gap = np.full((len(numbers), GAP, 3), BETWEEN, np.uint8)
    return np.concatenate([part for image in images for part in (gap, image)][1:], axis=1)


def _palette(eye: CompoundEye) -> np.ndarray:
    """Return the linear sRGB colour that shows a signal of 1, for each receptor of an eye, (ommatidium, channel, 3)."""
    hues = hues_of(eye.receptors)
    types = np.arange(eye.channels)[None] if eye.types is None else eye.types
    mine = hues[types]
    shares = mine if eye.channels == 1 else np.stack([shares_of(one) for one in mine])
    return np.broadcast_to(shares, (len(eye), eye.channels, 3))


@lru_cache(maxsize=8)
def _numbers(eye: CompoundEye) -> np.ndarray:
    """Return the index of the ommatidium to which each pixel of a map of the eye's visual field belongs, (y, x).

    On the map, ommatidia are hexagons. Pixels between and around the hexagons belong to no ommatidium. Their value is
    len(eye), the number of ommatidia.
    """
    tree = KDTree(eye.directions)
    two = min(2, len(eye))
    apart = tree.query(eye.directions, k=[two])[0][:, 0] if two == 2 else np.array([ALONE * np.sqrt(3)])
    corner = apart / np.sqrt(3)  # a hexagon's circumscribed circle
    places = _projected(eye.directions)
    low, high = places.min(axis=0) - 2 * corner.max(), places.max(axis=0) + 2 * corner.max()
    scale = min(SIZE[0] / (high[1] - low[1]), SIZE[1] / (high[0] - low[0]))
    width, height = (max(1, round(side * scale)) for side in high - low)
    x = low[0] + (np.arange(width) + 0.5) / scale
    y = high[1] - (np.arange(height) + 0.5) / scale
    ways, inside = _unprojected(*np.meshgrid(x, y))
    distance, number = tree.query(ways)
    margin = _margin(eye.directions, tree, ways, number)
    seen = inside & (distance <= OUTER * corner[number]) & (margin >= 1 - RIM)
    return np.where(seen, number, len(eye))


def _margin(directions: np.ndarray, tree: KDTree, ways: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Return the distance of each pixel's direction from the border between its two nearest ommatidia.

    The border consists of the directions that are equally far from the viewing directions of both ommatidia. The unit
    is half of the distance between these two viewing directions. The result is 1 at the direction of the nearest
    ommatidium, and 0 on the border.

    directions: viewing directions of the ommatidia, unit vectors (n, 3)
    tree: tree of these directions, for searches
    ways: directions of the pixels, unit vectors (..., 3)
    number: index of the ommatidium nearest to each pixel, (...)
    """
    if len(directions) == 1:
        return np.ones(number.shape)
    second = tree.query(ways, k=[2])[1][..., 0]
    step = directions[second] - directions[number]
    square = (step**2).sum(axis=-1)
    found: np.ndarray = 1 - 2 * ((ways - directions[number]) * step).sum(axis=-1) / square
    return found


def _projected(directions: np.ndarray) -> np.ndarray:
    """Return Hammer's projection (right, up), (n, 2), of directions (ahead, left, up), unit vectors (n, 3)."""
    ahead, left, up = directions.T
    half, cosine = np.arctan2(-left, ahead) / 2, np.hypot(ahead, left)  # half the longitude; cosine of the latitude
    root = np.sqrt(2 / (1 + cosine * np.cos(half)))
    return np.stack([2 * root * cosine * np.sin(half), root * up], axis=1)


def _unprojected(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions (..., 3) of points of Hammer's projection, and a mask of the points on the map."""
    square = (x / 4) ** 2 + (y / 2) ** 2
    inside = square <= 0.5
    z = np.sqrt(np.maximum(1 - square, 0))
    # Products of the cosine of the latitude with the cosine and the sine of half the longitude.
    along, across = 2 * z**2 - 1, z * x / 2
    cosine, longitude = np.hypot(along, across), 2 * np.arctan2(across, along)
    return np.stack([cosine * np.cos(longitude), -cosine * np.sin(longitude), z * y], axis=-1), inside
