"""Polygonal apertures: any simple polygon, and the slit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.apertures.aperture import Aperture, Nodes, SoftAperture
from optics.apertures.outline import Outline
from optics.apertures.soft_edge import SoftEdge
from optics.apertures.soft_polygon import SoftPolygon
from optics.apertures.triangulation import crossing, kernel_point, triangle_nodes, triangles
from optics.numerics.arguments import finite, positive, reals, shown, whole, without_derivative
from optics.numerics.number_types import full_precision
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count

__all__ = ["Polygon", "Slit"]

# Largest distance of a vertex from the centre: 1, and a margin for rounding.
RIM = 1 + 1e-9
MOST_SIDES = 10_000  # choice: the search for crossing edges then takes seconds; its time grows with the square


@dataclass(frozen=True, eq=False)
class Polygon(Aperture):
    """A simple polygon (its edges meet only at its vertices), convex or not.

    vertices: (n, 2), x and y in pupil radii, clockwise or counterclockwise. They are stored counterclockwise.

    Raises:
        ValueError: vertices are not numbers of shape (n, 2), are fewer than 3, or are not all finite and within the
            unit circle. An edge is shorter than 1e-9 pupil radii, or edges cross or touch.
    """

    vertices: np.ndarray

    def __post_init__(self) -> None:
        vertices = _checked(self.vertices)
        if _twice_area(vertices) < 0:
            vertices = vertices[::-1].copy()
        vertices.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)

    @classmethod
    def regular(cls, n: int, rotation_deg: float = 0.0) -> Polygon:
        """Return a regular polygon with n sides whose vertices lie on the unit circle.

        rotation_deg: angle of the first vertex from the x axis, counterclockwise.

        Raises:
            ValueError: n is not a whole number from 3 to 10,000, or rotation_deg is not finite.
        """
        turned = np.deg2rad(finite("rotation_deg", rotation_deg))
        angle = turned + 2 * np.pi * np.arange(whole("n", n, 3, MOST_SIDES)) / n
        return cls(np.column_stack([np.cos(angle), np.sin(angle)]))

    @property
    def area(self) -> float:
        return _twice_area(self.vertices) / 2

    @property
    def rotationally_symmetric(self) -> bool:
        return False

    @property
    def half_widths(self) -> tuple[float, float]:
        x, y = np.abs(self.vertices).max(axis=0)
        return float(x), float(y)

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a mask of the points inside: those from which a ray towards +x crosses an odd number of edges.

        x, y: positions in pupil radii, in arrays whose shapes broadcast.

        Raises:
            ValueError: a position is not a real number.
        """
        x, y = np.broadcast_arrays(reals("x", x), reals("y", y))
        inside = np.zeros(x.shape, dtype=bool)
        for (x0, y0), (x1, y1) in zip(self.vertices, np.roll(self.vertices, -1, axis=0), strict=True):
            if y0 != y1:
                inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
        return inside

    @property
    def outline(self) -> Outline:
        return Outline.polygon(self.vertices)

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        centre = kernel_point(self.vertices)
        if centre is None:
            parts = triangles(self.vertices)
        else:
            following = np.roll(self.vertices, -1, axis=0)
            parts = np.stack([np.broadcast_to(centre, following.shape), self.vertices, following], axis=1)
        return Nodes(*triangle_nodes(np.asarray(parts), cycles, digits))

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        return SoftPolygon(edge, self.vertices)


@dataclass(frozen=True)
class Slit(Aperture):
    """A centred rectangle of full `width` along x and `height` along y, in pupil radii.

    Raises:
        ValueError: a side is not positive, or the diagonal is longer than the unit circle's diameter.
    """

    width: float
    height: float

    def __post_init__(self) -> None:
        positive("width", self.width, "pupil radii")
        positive("height", self.height, "pupil radii")
        if np.hypot(self.width, self.height) > 2 * RIM:
            raise ValueError(
                f"(width, height) = ({shown(self.width)}, {shown(self.height)}): must fit into the unit circle, "
                "width² + height² at most 4"
            )

    @property
    def area(self) -> float:
        return self.width * self.height

    @property
    def rotationally_symmetric(self) -> bool:
        return False

    @property
    def mirror_symmetric(self) -> bool:
        return True

    @property
    def half_widths(self) -> tuple[float, float]:
        return self.width / 2, self.height / 2

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray((np.abs(reals("x", x)) <= self.width / 2) & (np.abs(reals("y", y)) <= self.height / 2))

    @property
    def outline(self) -> Outline:
        return Outline.polygon(self._corners)

    @property
    def _corners(self) -> np.ndarray:
        x, y = self.half_widths
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        """Return the tensor product of Gauss-Legendre nodes."""
        u, u_weight = gauss_legendre(gauss_legendre_count(cycles * self.width, digits + 0.3))
        v, v_weight = gauss_legendre(gauss_legendre_count(cycles * self.height, digits + 0.3))
        x, y = np.meshgrid((u - 0.5) * self.width, (v - 0.5) * self.height)
        return Nodes(x.ravel(), y.ravel(), np.outer(v_weight, u_weight).ravel() * self.area)

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        return SoftPolygon(edge, self._corners)


def _twice_area(vertices: np.ndarray) -> float:
    """Return twice the signed area, by the shoelace formula."""
    x, y = vertices.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _checked(value: Any) -> np.ndarray:
    """Return the vertices as an (n, 2) array; ValueError unless they form a simple polygon within the unit circle."""
    value = full_precision("vertices", without_derivative("vertices", value))
    try:
        vertices = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"vertices = {shown(value)}: must be numbers of shape (n, 2)") from None
    if vertices.ndim != 2 or vertices.shape[1] != 2 or len(vertices) < 3:
        raise ValueError(f"vertices has shape {vertices.shape}: must be (n, 2) with n at least 3")
    if not np.isfinite(vertices).all():
        raise ValueError("vertices holds NaN or infinity: must be finite")
    outermost = float(np.hypot(*vertices.T).max())
    if outermost > RIM:
        raise ValueError(f"vertices reach out to {outermost:.6g} R: must lie within the unit circle")
    shortest = float(np.hypot(*(np.roll(vertices, -1, axis=0) - vertices).T).min())
    if shortest < 1e-9:
        raise ValueError(f"vertices holds an edge of length {shortest:.3g} R: edges must be at least 1e-9 R long")
    meeting = crossing(vertices)
    if meeting is not None:
        raise ValueError(f"vertices: edges {meeting[0]} and {meeting[1]} cross or touch, must meet only at shared ends")
    return vertices
