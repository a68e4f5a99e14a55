"""Lengths and directions of an eye, and checks of its pupil's width."""

from __future__ import annotations

import math
from typing import Any

from optics.elements.pupil import MIDDLE, Pupil
from optics.numerics.arguments import in_range, of_kind, point_2d, positive
from optics.numerics.autodiff import Scalar, is_differentiable, number

__all__ = [
    "behind_pupil",
    "check_pupil",
    "check_vertical",
    "direction",
    "etendue",
    "focal_length",
    "receptor_size",
    "tangents",
]

WIDEST_DEG = 80


def focal_length(width: float, fov_deg: Scalar) -> Scalar:
    """Return the focal length f [m] at which a retina of width L has this field of view, L / (2 tan(fov/2))."""
    if is_differentiable(fov_deg):
        import drjit as dr

        sine, cosine = dr.sincos(dr.deg2rad(fov_deg) / 2)  # dr.tan uses dr.rcp beyond 45 degrees: error 1e-6 on a GPU
        return width * cosine / (2 * sine)
    return width / (2 * math.tan(math.radians(fov_deg) / 2))


def receptor_size(
    resolution: tuple[int, int], width: float, fov_deg: Scalar, vertical_fov_deg: float | None
) -> tuple[float, float]:
    """Return the height and width [m] of a receptor on a retina of this width [m].

    Receptors are square if `vertical_fov_deg` is None.

    resolution: number of receptors (height, width).
    """
    rows, columns = resolution
    if vertical_fov_deg is None:
        return width / columns, width / columns
    height = 2 * number(focal_length(width, fov_deg)) * math.tan(math.radians(vertical_fov_deg) / 2)
    return height / rows, width / columns


def behind_pupil(pupil: Pupil | None, focal: Scalar) -> Scalar:
    """Return the distance [m] from pupil to retina: `focal` n/n₀, with the indices n behind and n₀ before the pupil.

    The indices are those at 550 nm. Without a pupil, or with the same medium on both sides, the distance is `focal`.
    """
    if pupil is None or pupil.object_n is None:
        return focal
    return focal * (pupil.index_behind(MIDDLE) / pupil.index_before(MIDDLE))


def check_pupil(pupil: Pupil | None, width: float, full_aperture: float | None) -> None:
    """Raise a ValueError unless `pupil` is None, or a Pupil that is at most as wide as `full_aperture` [m].

    width: width [m] of the retina. If `full_aperture` is None, the pupil must not be wider than this width.
    """
    if full_aperture is not None:
        positive("full_aperture", full_aperture)
    if pupil is None:
        return
    its = " (it has one, its `pupil`)" if isinstance(getattr(pupil, "pupil", None), Pupil) else ""
    of_kind("pupil", pupil, Pupil, f"Pupil(25e-6), or None for the perfect lens{its}")
    name, widest = ("sensor_width", width) if full_aperture is None else ("full_aperture", full_aperture)
    if 2 * number(pupil.aperture_radius) > widest * (1 + 1e-9):
        raise ValueError(
            f"pupil.aperture_radius = {pupil.radius:g}: must be at most {name} / 2 = {widest / 2:g} m (for a patch of "
            "the retina, pass the diameter of the whole eye's widest pupil as full_aperture)"
        )


def check_vertical(vertical_fov_deg: float | None, fov_deg: Scalar) -> None:
    """Raise a ValueError unless the vertical field of view [degrees] is None or valid.

    Only None is valid if `fov_deg` carries a derivative.
    """
    if vertical_fov_deg is None:
        return
    in_range("vertical_fov_deg", vertical_fov_deg, 1e-3, 170)
    if is_differentiable(fov_deg):
        raise ValueError(
            "vertical_fov_deg is given and fov_deg is a Dr.Jit array: must be None, so that receptors keep their size "
            "while the focal length changes"
        )


def etendue(widest_pupil: float, receptor_area: float, focal: float) -> float:
    """Return the etendue [m² sr] of a receptor that receives light from the eye's widest pupil.

    It is the receptor's area, times the pupil's area divided by the squared focal length. The widest pupil is the one
    whose throughput is 1 by definition.

    widest_pupil: diameter [m] of the widest pupil.
    receptor_area: area [m²] of the receptor on the retina.
    focal: focal length [m].
    """
    return math.pi / 4 * receptor_area * (widest_pupil / focal) ** 2


def direction(name: str, value: Any) -> tuple[float, float]:
    """Return the angles (right, up) [degrees] of a direction, or raise a ValueError if one is beyond ±80°.

    name: name of the argument, for error messages.
    """
    right, up = point_2d(name, value, "angles (right, up) [degrees]")
    return in_range(name, right, -WIDEST_DEG, WIDEST_DEG), in_range(name, up, -WIDEST_DEG, WIDEST_DEG)


def tangents(direction_deg: tuple[float, float]) -> tuple[float, float]:
    """Return the tangents (right, down) of a direction that is given as angles (right, up) [degrees]."""
    return math.tan(math.radians(direction_deg[0])), -math.tan(math.radians(direction_deg[1]))
