"""Viewing directions of ommatidia: hexagonal patches, whole heads, and measured directions.

Directions are unit vectors (ahead, left, up) in the frame of an eye whose `sim.Mount` has azimuth, elevation and
roll 0.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import optics
from optics.numerics.arguments import finite, in_range, is_sized, reals

MOST_OMMATIDIA = 10**6  # chosen limit; the largest eyes of dragonflies have 30,000
OFF_UNIT = 1e-3  # largest deviation of a vector's length from 1
FINEST_DEG = 0.2302  # chosen: smallest angle between neighbours of a whole head; it gives 900,000 ommatidia


def unit_directions(name: str, given: Any) -> np.ndarray:
    """Return viewing directions as unit vectors (n, 3).

    name: name of the argument, for error messages
    given: unit vectors (ahead, left, up), (n, 3), or angles [degrees] (azimuth to the left, elevation upwards), (n, 2)

    Raises:
        ValueError: the shape is wrong, there are no directions or more than 10⁶, or a value is not finite.
            Elevations must be within ±90 degrees, and the length of a vector must be 1 to within 0.001.
    """
    if is_sized(given) and len(given) > MOST_OMMATIDIA:
        raise ValueError(f"{name}: {len(given)} ommatidia: must be at most {MOST_OMMATIDIA}")
    found = reals(name, given)
    if found.size == 0:
        raise ValueError(f"{name}: no ommatidium: must contain at least one direction")
    if found.ndim != 2 or found.shape[1] not in (2, 3):
        raise ValueError(
            f"{name} has shape {found.shape}: must be unit vectors (n, 3), or (azimuth, elevation) in degrees (n, 2)"
        )
    if not np.isfinite(found).all():
        bad = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
        raise ValueError(f"{name}[{bad}] = {found[bad].tolist()}: must be finite")
    return _from_angles(name, found) if found.shape[1] == 2 else _normalized(name, found)


def _from_angles(name: str, degrees: np.ndarray) -> np.ndarray:
    steepest = int(np.abs(degrees[:, 1]).argmax())
    if abs(degrees[steepest, 1]) > 90:
        raise ValueError(f"{name}[{steepest}]: elevation = {degrees[steepest, 1]:g} degrees: must lie in [-90, 90]")
    azimuth, elevation = np.radians(degrees).T
    return np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)


def _normalized(name: str, vectors: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(vectors, axis=1)
    worst = int(np.abs(lengths - 1).argmax())
    if abs(lengths[worst] - 1) > OFF_UNIT:
        raise ValueError(f"{name}[{worst}] has length {lengths[worst]:g}: must be a unit vector, within {OFF_UNIT:g}")
    found: np.ndarray = vectors / lengths[:, None]
    return found


def facet_frames(directions: np.ndarray) -> np.ndarray:
    """Return the rotation matrices of facets, (n, 3, 3).

    The columns of a matrix are unit vectors to the facet's right, to its top, and along its axis. Their components are
    relative to the eye (right, up, ahead). A facet is turned like a `sim.Mount` with the same azimuth and elevation:
    its x axis, to the right, is horizontal.

    directions: axes of the facets, unit vectors (ahead, left, up), (n, 3)
    """
    ahead, left, up = directions.T
    level = np.hypot(ahead, left)
    safe = np.where(level > 0, level, 1)
    cos, sin = np.where(level > 0, ahead / safe, 1.0), np.where(level > 0, left / safe, 0.0)
    top = np.stack([up * sin, level, -up * cos], axis=-1)
    rightwards = np.stack([cos, np.zeros_like(cos), sin], axis=-1)
    return np.stack([rightwards, top, np.stack([-left, up, ahead], axis=-1)], axis=-1)


def hexagonal_patch(
    rings: int, interommatidial_deg: float, azimuth_deg: float = 0.0, elevation_deg: float = 0.0
) -> np.ndarray:
    """Return viewing directions in hexagonal rings around a centre, unit vectors (ahead, left, up), (n, 3).

    15 rings have 721 ommatidia, about as many as an eye of *Drosophila*. The hexagonal lattice is mapped to the sphere
    by Lambert's equal-area projection, so every ommatidium has the same solid angle.

    rings: number of rings around the central ommatidium, 0 to 60
    interommatidial_deg: angle between neighbours at the centre [degrees], above 0
    azimuth_deg: azimuth of the centre [degrees], to the left
    elevation_deg: elevation of the centre [degrees], upwards, in [-90, 90]

    Raises:
        ValueError: an argument is out of range, or the lattice does not fit on a sphere.
    """
    right, up = optics.hexagonal_directions(rings, interommatidial_deg).T
    radius = np.hypot(right, up)
    if radius.max() >= 2:
        raise ValueError(
            f"interommatidial_deg = {interommatidial_deg:g}: must be smaller, {rings} rings do not fit on a sphere"
        )
    angle, turn = 2 * np.arcsin(radius / 2), np.arctan2(up, right)
    local = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)], axis=-1)
    centre = _from_angles(
        "centre", np.array([[finite("azimuth_deg", azimuth_deg), in_range("elevation_deg", elevation_deg, -90, 90)]])
    )
    found = local @ facet_frames(centre)[0].T
    return np.stack([found[:, 2], -found[:, 0], found[:, 1]], axis=-1)


def whole_head(interommatidial_deg: float) -> np.ndarray:
    """Return viewing directions all around a head, unit vectors (n, 3).

    The vectors are (ahead, left, up), in no particular order. They are the 10 f² + 2 nodes of an icosahedron whose
    edges are divided into f parts. All but twelve of them have six neighbours. The number f is the smallest for which
    the mean angle between neighbours is at most `interommatidial_deg`; 5.8 degrees give 1442 ommatidia.

    interommatidial_deg: largest mean angle between neighbours [degrees]

    Raises:
        ValueError: the angle is below 0.2302 or above 180 degrees.
    """
    apart = math.radians(in_range("interommatidial_deg", interommatidial_deg, FINEST_DEG, 180.0))
    # Mean angle if the cells of all nodes, hexagons of area (√3/2) Δφ², cover the sphere.
    nodes = 8 * math.pi / math.sqrt(3) / apart**2
    parts = max(1, math.ceil(math.sqrt(max(nodes - 2, 0) / 10)))
    corners, faces = _icosahedron()
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(parts + 1), np.arange(parts + 1)))
    i, j = i[i + j <= parts], j[i + j <= parts]
    shares = np.stack([i, j, parts - i - j], axis=-1) / parts
    points = np.concatenate([shares @ corners[face] for face in faces])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    _, first = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True)
    found: np.ndarray = points[np.sort(first)]
    return found


def _icosahedron() -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of an icosahedron, unit vectors (12, 3), and its faces as indices of corners, (20, 3)."""
    golden = (1 + math.sqrt(5)) / 2
    corners = np.array(
        [np.roll([0.0, y, z * golden], turn) for turn in range(3) for y in (-1, 1) for z in (-1, 1)]
    ) / math.hypot(1, golden)
    near = np.abs(corners @ corners.T - 1 / math.sqrt(5)) < 1e-9
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    return corners, np.array(faces)
