"""Shapes from which openings are composed by union, difference or intersection.

All may extend beyond the pupil, and disks and rectangles may lie off the axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from optics.apertures.outline import Outline
from optics.numerics.arguments import finite, in_range, point_2d, positive, reals, whole

__all__ = ["Disk", "Oblong", "Shape", "Spider"]

BEYOND = 1.5  # choice, radii: length of a spider's vanes, which exceeds any opening
MOST_VANES = 64
FARTHEST = 10.0  # choice, radii: largest distance of a centre from the axis along x and y


class Shape(Protocol):
    """Interface of shapes that can be joined, subtracted or intersected.

    Every aperture has this interface. Lengths are in units of the pupil's radius R.
    """

    @property
    def outline(self) -> Outline:
        """Edge of the shape. For some shapes, the outline contains further pieces that do not belong to the edge."""

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a mask of the points (x, y) [pupil radii] within the shape; ValueError if x or y is not real."""


@dataclass(frozen=True)
class Disk:
    """A disk of the given radius about a centre (x, y), in pupil radii.

    Raises:
        ValueError: the radius is not positive or is above 10, or a coordinate of the centre is beyond ±10.
    """

    radius: float
    centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        positive("radius", self.radius, "pupil radii")
        in_range("radius", self.radius, 0, FARTHEST)
        object.__setattr__(self, "centre", _centre(self.centre))

    @property
    def outline(self) -> Outline:
        """Edge of the disk."""
        return Outline.circles((float(self.radius),), self.centre)

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a mask of the points (x, y) [pupil radii] within the shape or on its edge.

        Raises:
            ValueError: x or y is not real.
        """
        x, y = reals("x", x), reals("y", y)
        return np.asarray(np.hypot(x - self.centre[0], y - self.centre[1]) <= self.radius)


@dataclass(frozen=True)
class Oblong:
    """A rectangle about a centre (x, y). `width` and `height` are full lengths in pupil radii.

    rotation_deg: counterclockwise rotation about the rectangle's own centre, from x towards y.

    Raises:
        ValueError: a side is not positive or is above 20, a coordinate of the centre is beyond ±10, or the angle is not
            finite.
    """

    width: float
    height: float
    centre: tuple[float, float] = (0.0, 0.0)
    rotation_deg: float = 0.0

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            value = getattr(self, name)
            positive(name, value, "pupil radii")
            in_range(name, value, 0, 2 * FARTHEST)
        object.__setattr__(self, "centre", _centre(self.centre))
        finite("rotation_deg", self.rotation_deg)

    @property
    def outline(self) -> Outline:
        """Edge of the rectangle."""
        x, y = self.width / 2, self.height / 2
        turn = np.exp(1j * np.deg2rad(self.rotation_deg))
        corners = turn * np.array([-x - 1j * y, x - 1j * y, x + 1j * y, -x + 1j * y])
        return Outline.polygon(np.column_stack([corners.real, corners.imag]) + self.centre)

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a mask of the points (x, y) [pupil radii] within the shape or on its edge.

        Raises:
            ValueError: x or y is not real.
        """
        x, y = reals("x", x), reals("y", y)
        place = (x - self.centre[0] + 1j * (y - self.centre[1])) * np.exp(-1j * np.deg2rad(self.rotation_deg))
        return np.asarray((np.abs(place.real) <= self.width / 2) & (np.abs(place.imag) <= self.height / 2))


@dataclass(frozen=True)
class Spider:
    """The vanes that support a telescope's secondary mirror. They run outwards from the centre at equal angles.

    vanes: number of vanes, 1 to 64.
    width: full width of each vane in pupil radii.
    rotation_deg: angle of the first vane from the x axis, counterclockwise.

    Raises:
        ValueError: vanes is not a whole number from 1 to 64, width is outside (0, 1], or the angle is not finite.
    """

    vanes: int
    width: float
    rotation_deg: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "vanes", whole("vanes", self.vanes, 1, MOST_VANES))
        positive("width", self.width, "pupil radii")
        in_range("width", self.width, 0, 1)
        finite("rotation_deg", self.rotation_deg)

    @property
    def rectangles(self) -> list[Oblong]:
        """The vanes, from the centre to 1.5 pupil radii."""
        angles = self.rotation_deg + 360 / self.vanes * np.arange(self.vanes)
        middles = BEYOND / 2 * np.exp(1j * np.deg2rad(angles))
        return [
            Oblong(BEYOND, self.width, (float(at.real), float(at.imag)), float(angle))
            for at, angle in zip(middles, angles, strict=True)
        ]

    @property
    def outline(self) -> Outline:
        """Edges of all vanes, including the parts within other vanes."""
        return Outline.joined([rectangle.outline for rectangle in self.rectangles])

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a mask of the points (x, y) [pupil radii] within the shape or on its edge.

        Raises:
            ValueError: x or y is not real.
        """
        return np.any([rectangle.contains(x, y) for rectangle in self.rectangles], axis=0)


def _centre(value: tuple[float, float]) -> tuple[float, float]:
    x, y = point_2d("centre", value, "lengths (x, y) in pupil radii")
    return in_range("centre", x, -FARTHEST, FARTHEST), in_range("centre", y, -FARTHEST, FARTHEST)
