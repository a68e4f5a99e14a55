"""Eyes with a single receptor, made from one receptor of an eye to compute the limits of vision of that receptor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from optics.eye.eye_spec import EyeSpec
from optics.eye.geometry import direction, tangents
from optics.numerics.autodiff import number

__all__ = ["receptor_in", "spacing_range"]

AnyEye = TypeVar("AnyEye", bound=EyeSpec)


def receptor_in(eye: AnyEye, direction_deg: tuple[float, float] | None) -> AnyEye:
    """Return an eye with the optics of `eye` and only one of its receptors, the one that faces a given direction.

    direction_deg: angles (right, up) from the axis. None: the middle of the field.

    Raises:
        ValueError: the direction is outside the field of `eye`.
    """
    toward = eye.eccentricity_deg if direction_deg is None else direction("direction_deg", direction_deg)
    distance, sizes = number(eye.sensor_distance), np.array(eye.receptor_size[::-1])
    place = (np.array(tangents(toward)) - tangents(eye.eccentricity_deg)) * distance / sizes
    if np.any(np.abs(place) > np.array(eye.resolution[::-1]) / 2 * (1 + 1e-9)):
        raise ValueError(
            f"direction_deg = {toward}: must lie in the field, {number(eye.fov_deg):.4g} x {eye.fovy_deg:.4g} degrees "
            f"around {eye.eccentricity_deg}"
        )
    width, height = sizes
    if eye.lattice is not None:
        row, column = _receptor_at(eye, place)
        height, width = eye.lattice.sides[:, row, column] * sizes[::-1]
    return replace(
        eye,
        resolution=(1, 1),
        sensor_width=float(width),
        fov_deg=_angle(width, distance),
        vertical_fov_deg=_angle(height, distance),
        full_aperture=eye.widest_pupil,
        eccentricity_deg=toward,
        density=None,
    )


def spacing_range(eye: EyeSpec) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the smallest and largest angles between receptors [degrees], horizontally and vertically."""
    down, across = eye.receptor_angles_deg
    return (float(across.min()), float(across.max())), (float(down.min()), float(down.max()))


def _receptor_at(eye: EyeSpec, place: np.ndarray) -> tuple[int, int]:
    assert eye.lattice is not None
    column, row = eye.lattice.counted(place[None])[0] + np.array(eye.resolution[::-1]) / 2
    inside = (np.clip(math.floor(at), 0, n - 1) for at, n in zip((row, column), eye.resolution, strict=True))
    i, j = map(int, inside)
    return i, j


def _angle(length: float, distance: float) -> float:
    return 2 * math.degrees(math.atan(float(length) / (2 * distance)))
