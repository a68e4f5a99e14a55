"""Receptors on the tangent plane of an eye's visual field: sizes, directions, and division of a receptor."""

from __future__ import annotations

import math

import numpy as np

import optics


def from_receptors(eye: optics.Eye, counted: np.ndarray) -> np.ndarray:
    """Return points of the tangent plane, (n, 2): x to the right and y down.

    The unit of x is the average width of a receptor, and the unit of y is the average height.

    counted: the same points in coordinates in which every receptor has the size 1. These coordinates differ from those
        of the result only if the eye's receptors differ in size (`optics.Eye(density=...)`).
    """
    return counted if eye.lattice is None else eye.lattice.places(counted)


def to_receptors(eye: optics.Eye, plane: np.ndarray) -> np.ndarray:
    """Convert points of the tangent plane to coordinates in which every receptor has the size 1, (..., 2).

    This is the inverse of `from_receptors`.

    plane: points, x to the right in average receptor widths, y down in average receptor heights, (..., 2)
    """
    return plane if eye.lattice is None else eye.lattice.counted(plane)


def directions_of(eye: optics.Eye, plane: np.ndarray) -> np.ndarray:
    """Return unit vectors (ray, 3) in the eye's frame towards points of the tangent plane.

    plane: points, x to the right in average receptor widths, y down in average receptor heights, (ray, 2)
    """
    v = on_tangent_plane(eye, plane)
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(np.float32)


def on_tangent_plane(eye: optics.Eye, plane: np.ndarray) -> np.ndarray:
    """Convert points of the tangent plane to the eye's frame, (ray, 3).

    The plane is perpendicular to the eye's axis, at the distance 1.

    plane: points, x to the right in average receptor widths, y down in average receptor heights, (ray, 2)
    """
    height, width = tangent_size(eye)
    return np.stack([plane[:, 0] * width, -plane[:, 1] * height, np.ones(len(plane))], axis=-1)


def tangent_size(eye: optics.Eye) -> tuple[float, float]:
    """Return the average height and width of a receptor on the plane at distance 1 along the axis."""
    height, width = eye.receptor_size
    return height / eye.sensor_distance, width / eye.sensor_distance


def parts_of(count: int, in_rows: bool, aspect: float = 1.0) -> tuple[int, int]:
    """Return the rows and columns of a receptor that is divided into this number of parts.

    With `in_rows`, the parts are as nearly square as possible; if two numbers of rows are equally good, the result is
    the smaller one. Without `in_rows`, there is a single row.

    aspect: height of a receptor divided by its width
    """
    if not in_rows:
        return 1, count
    divisors = [n for n in range(1, count + 1) if count % n == 0]
    rows = min(divisors, key=lambda n: (round(abs(math.log(n * n / (count * aspect))), 9), n))
    return rows, count // rows


def aspect_of(eye: optics.Eye) -> float:
    """Return the height of a receptor divided by its width."""
    height, width = eye.receptor_size
    return height / width


def extent_of(eye: optics.Eye, size: tuple[float, float]) -> tuple[float, float]:
    """Return the width and height of a rectangle on the tangent plane, divided by the plane's distance from the eye.

    size: width of the rectangle in average receptor widths, and height in average receptor heights
    """
    height, width = tangent_size(eye)
    return width * size[0], height * size[1]
