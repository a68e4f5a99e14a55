"""Hexagonal lattices of ommatidia in rows of equal length, with or without an acute zone in the middle."""

from __future__ import annotations

import math

import numpy as np

from optics.numerics.arguments import in_range, positive, whole

MOST_ALONG = 1000  # chosen limit for the ommatidia along one side
SHARPEST = 5.0  # chosen: largest density of columns in the acute zone, relative to the mean
ROW_DISTANCE = math.sqrt(3) / 2  # distance between rows, in units of the distance between neighbours


def hexagonal_rows(rows: int, columns: int, fov_deg: float, acute_zone: float = 1.0) -> np.ndarray:
    """Return viewing directions of a hexagonal lattice with rows of equal length, unit vectors (rows * columns, 3).

    The vectors are (ahead, left, up). The first row is at the top, and each row runs from left to right. The middle of
    the lattice is ahead. Without an acute zone, neighbours in a row are fov_deg / columns apart in azimuth, and every
    other row is shifted by half of this angle. Elevations follow Mercator's projection, which is conformal: without an
    acute zone, the neighbours of an ommatidium form a regular hexagon everywhere, whose size decreases with the cosine
    of the elevation.

    rows, columns: numbers of ommatidia, 1 to 1000
    fov_deg: horizontal field of view [degrees], above 0 and at most 360
    acute_zone: density of columns in the middle relative to their mean density, 1 to 5. If D is this value, an azimuth
        α of the equally spaced lattice, in units of half the field of view, becomes α/D + (1 - 1/D) α³.

    Raises:
        ValueError: an argument is out of range.
    """
    rows, columns = whole("rows", rows, 1, MOST_ALONG), whole("columns", columns, 1, MOST_ALONG)
    half = math.radians(positive("fov_deg", fov_deg, "degrees", most=360)) / 2
    in_range("acute_zone", acute_zone, 1, SHARPEST)
    shift = np.zeros((1, 1)) if rows == 1 else np.where(np.arange(rows) % 2, 0.25, -0.25)[:, None]
    even = -(2 * (np.arange(columns) + shift) + 1 - columns) / columns
    azimuth = half * (even / acute_zone + (1 - 1 / acute_zone) * even**3)
    heights = ((rows - 1) / 2 - np.arange(rows)) * ROW_DISTANCE * 2 * half / columns
    elevation = np.arctan(np.sinh(heights))[:, None]
    level = np.cos(elevation)
    found = np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation))
    return np.stack(found, axis=-1).reshape(-1, 3)


def lattice_fovy_deg(rows: int, columns: int, fov_deg: float) -> float:
    """Return the vertical field of view of the lattice of `hexagonal_rows` [degrees].

    Half a row is added above the first row and below the last one.
    """
    return math.degrees(2 * math.atan(math.sinh(rows * ROW_DISTANCE * math.radians(fov_deg) / columns / 2)))
