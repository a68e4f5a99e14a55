"""Openings composed of several shapes: their union, difference or intersection."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce
from math import sqrt

import numpy as np

from optics.apertures.aperture import Aperture, Nodes, SoftAperture
from optics.apertures.boundary import Boundary, boundary
from optics.apertures.outline import Outline
from optics.apertures.polygonal import Polygon
from optics.apertures.shapes import Disk, Shape
from optics.apertures.soft_edge import SoftEdge
from optics.apertures.soft_outline import SoftOutline
from optics.apertures.strips import strips
from optics.numerics.arguments import finite, in_range, is_sized, one_of, reals, shown, whole

__all__ = ["Combined", "difference", "hexagonal_segments", "intersection", "union"]

MOST_RINGS = 12  # choice: largest number of rings, which have 469 segments
SMALLEST = 1e-9  # choice, R²: smallest area of an opening

RULES: dict[str, Callable[[list[np.ndarray]], np.ndarray]] = {
    "union": lambda inside: reduce(np.logical_or, inside),
    "intersection": lambda inside: reduce(np.logical_and, inside),
    "difference": lambda inside: inside[0] & ~reduce(np.logical_or, inside[1:]),
}


@dataclass(frozen=True, eq=False)
class Combined(Aperture):
    """Union, difference or intersection of shapes, clipped to the pupil's circle.

    rule: "union", "difference" or "intersection".
    shapes: apertures, or `Disk`, `Oblong`, `Spider` and `Bitmap`. They may extend beyond the circle. For "difference",
        all others are subtracted from the first.

    Raises:
        ValueError: the rule is unknown, an argument is not a shape, shapes are missing (a difference needs two), the
            open area is below 1e-9 squared pupil radii, or edges almost coincide.
    """

    rule: str
    shapes: tuple[Shape, ...]

    def __post_init__(self) -> None:
        one_of("rule", self.rule, RULES)
        if not is_sized(self.shapes):
            raise ValueError(f"shapes = {shown(self.shapes)}: must be several, such as (Disk(0.2), Circle())")
        least = 2 if self.rule == "difference" else 1
        if len(self.shapes) < least:
            raise ValueError(f"{len(self.shapes)} shapes: a {self.rule} must have {least} or more")
        for shape in self.shapes:
            if isinstance(shape, type) or not (hasattr(shape, "outline") and hasattr(shape, "contains")):
                raise ValueError(f"shape = {shown(shape)}: must be an aperture, a Disk, an Oblong or a Spider")
        if self.area < SMALLEST:
            raise ValueError(f"{self.rule} of {len(self.shapes)} shapes: must leave something open within the pupil")

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, y = np.broadcast_arrays(reals("x", x), reals("y", y))
        return np.asarray(RULES[self.rule]([shape.contains(x, y) for shape in self.shapes]) & (np.hypot(x, y) <= 1))

    @cached_property
    def _boundary(self) -> Boundary:
        pieces = Outline.joined([*(shape.outline for shape in self.shapes), Disk(1.0).outline])
        return boundary(pieces, self.contains)

    @property
    def outline(self) -> Outline:
        return self._boundary.outline

    @property
    def area(self) -> float:
        return self._boundary.area

    @property
    def rotationally_symmetric(self) -> bool:
        return False

    @cached_property
    def half_widths(self) -> tuple[float, float]:
        return self._boundary.half_widths

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        x, y = self.half_widths
        parts = list(strips(self.outline, (-x, x, -y, y), cycles, digits))
        return Nodes(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        return SoftOutline(edge, self._boundary.segments, self._boundary.arcs)


def union(*shapes: Shape) -> Combined:
    """Return an aperture that is open wherever at least one of the shapes is open, within the pupil.

    Raises:
        ValueError: see `Combined`.
    """
    return Combined("union", shapes)


def difference(shape: Shape, *closed: Shape) -> Combined:
    """Return an aperture whose open part is the part of the first shape within the pupil and outside all other shapes.

    `difference(Annulus(0.3), Spider(4, 0.02))` is the aperture of a telescope.

    Raises:
        ValueError: see `Combined`.
    """
    return Combined("difference", (shape, *closed))


def intersection(*shapes: Shape) -> Combined:
    """Return an aperture that is open wherever all shapes are open, within the pupil.

    Raises:
        ValueError: see `Combined`.
    """
    return Combined("intersection", shapes)


def hexagonal_segments(
    rings: int, gap: float = 0.0, rotation_deg: float = 0.0, without: tuple[int, ...] = ()
) -> Combined:
    """Return a segmented mirror: rings of hexagons around a central hexagon.

    The outermost corners of the complete mirror, including omitted segments, lie on the pupil's rim.

    rings: number of rings, 0 to 12.
    gap: gap between neighbours, in units of the distance between their centres.
    rotation_deg: counterclockwise rotation of the mirror. At 0 the hexagons have corners in the direction of x.
    without: numbers of omitted segments. Segment 0 is the central one. Numbers continue ring by ring. In each ring,
        they run counterclockwise from the segment in the direction `rotation_deg` + 30 degrees. The mirror of the James
        Webb telescope has 2 rings without segment 0.

    Raises:
        ValueError: rings is outside 0 to 12, gap is outside [0, 0.999], the angle is not finite, a segment in `without`
            does not exist, or no segment is left.
    """
    rings = whole("rings", rings, 0, MOST_RINGS)
    in_range("gap", gap, 0, 0.999)
    turn = np.exp(1j * np.deg2rad(finite("rotation_deg", rotation_deg)))
    centres = [0j]
    for ring in range(1, rings + 1):
        corners = ring * np.exp(1j * np.pi * (np.arange(7) / 3 + 1 / 6))
        for first, last in itertools.pairwise(corners):
            centres += [first + (last - first) * step / ring for step in range(ring)]
    if isinstance(without, str) or not is_sized(without):
        raise ValueError(f"without = {shown(without)}: must hold numbers of segments, such as (0,)")
    for number in without:
        whole("without", number, 0, len(centres) - 1)
    corners = (1 - gap) / sqrt(3) * np.exp(1j * np.pi / 3 * np.arange(6))
    kept = [centre for number, centre in enumerate(centres) if number not in set(without)]
    if not kept:
        raise ValueError(f"without = {shown(without)}: must leave a segment")
    outermost = max(abs(centre + corner) for centre in centres for corner in corners)
    places = [turn * (centre + corners) / outermost for centre in kept]
    return union(*(Polygon(np.column_stack([at.real, at.imag])) for at in places))
