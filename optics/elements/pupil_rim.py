"""Rim of a pupil, found from samples of the pupil: a circle, an oval (nearly an ellipse), or a convex polygon."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.apertures.aperture import Aperture
from optics.apertures.circular import Circle
from optics.apertures.polygonal import Polygon

__all__ = ["Rim", "rim_around"]

BETTER = 0.5  # choice: an oval is chosen if its residual is less than this part of the residual of a circle
MUCH_BETTER = 0.1  # choice: the same for a Fourier series, whose residual may by chance be a third on square grids
FULL = 0.8  # choice: part of a circle that the hull must fill. A hexagon fills 0.83, a square 0.64.
LEAST_CORNERS = 8  # choice: corners of the hull that an oval, which has at least 5 parameters, needs
EXACT = 1e-4  # choice, radii: a residual below this is always accepted
# Choice: accepted residual in units of the distance between samples. If some samples are dark, it is also limited to
# half of RESOLVED, because the rim may be cut.
RAGGED = 0.5
NEXT = 3.0  # choice: distance of dark samples that limit an edge of the hull, in units of that between samples
SHORTEST = 1e-6  # choice, radii: shorter edges are omitted
RESOLVED = 0.02  # choice, radii: largest distance between the samples of a pupil that is neither circle nor ellipse
SIDES = 64  # choice: sides of the polygon that represents an oval
HARMONICS = 4  # choice: orders of the Fourier series that corrects an ellipse
CORNERS_PER_TERM = 4  # choice: corners of the hull per term of this series


@dataclass(frozen=True, eq=False)
class Rim:
    """The rim of a pupil, in positions [m] on a plane or in sines of directions (directions projected onto x and y).

    middle: centre (x, y) of the circle around the pupil.
    radius: radius of this circle.
    vertices: corners (n, 2) of the rim relative to the middle, in units of the radius; None for a circle.
    """

    middle: np.ndarray
    radius: float
    vertices: np.ndarray | None = None

    @cached_property
    def aperture(self) -> Aperture:
        return Circle() if self.vertices is None else Polygon(self.vertices)

    def contains(self, x: np.ndarray, y: np.ndarray, part: float) -> np.ndarray:
        """Return a mask of the points inside the rim after it is scaled by the factor `part` about its middle."""
        scale = 1 / (part * self.radius)
        return self.aperture.contains((x - self.middle[0]) * scale, (y - self.middle[1]) * scale)

    def onto_plane(self, distance: float) -> Rim:
        """Return this rim, given in sines of directions, converted to positions [m] on a plane.

        The result is centred on the origin.

        distance: distance [m] of the plane from the image.
        """
        return self._scaled(lambda r: distance * r / math.sqrt(1 - r * r))

    def in_sines(self, distance: float) -> Rim:
        """Return this rim, given in positions [m] on a plane, converted to sines of directions.

        The result is centred on the origin.

        distance: distance [m] of the plane from the image.
        """
        return self._scaled(lambda r: r / math.hypot(r, distance))

    def _scaled(self, of_radius: Callable[[float], float]) -> Rim:
        """Return this rim, moved to the origin, with each distance r from its middle changed to of_radius(r)."""
        radius = of_radius(self.radius)
        if self.vertices is None:
            return Rim(np.zeros(2), radius)
        r = np.linalg.norm(self.vertices, axis=1)
        new = np.array([of_radius(float(at)) for at in r * self.radius]) / radius
        return Rim(np.zeros(2), radius, self.vertices * (new / r)[:, None])


def rim_around(lit: np.ndarray, dark: np.ndarray | None = None) -> Rim:
    """Return the rim of a convex pupil from the positions (2, n) of its illuminated samples.

    The rim is a circle or an oval if one of them fits the corners of the samples' convex hull. The fit is by least
    squares to all corners, so that no single corner determines it. A single sample may lie on the rim, for example, if
    the grid has an even number of samples, one of them at the centre: the grid then extends farther to one side.

    If neither fits, the rim is the hull. If `dark` samples are also given, each edge of the hull is moved outwards. If
    a dark sample is near the edge, the edge is moved half way to the nearest one. Otherwise it is moved to the circle
    or oval around all samples, with and without light.

    dark: positions (2, m) of samples without light. None: unknown.

    Raises:
        ValueError: the samples lie on a line, or the hull is needed and its samples are too far apart.
    """
    scale = float(np.ptp(lit, axis=1).max()) or 1.0
    hull = _hull(lit.T / scale)
    corners = hull.points[hull.vertices]
    apart = math.sqrt(hull.volume / lit.shape[1])
    middle, radius, vertices, ragged = _round(hull)
    cut = dark is not None and dark.size > 0
    if ragged > max(EXACT, min(RAGGED * apart / radius, RESOLVED / 2 if cut else math.inf)):
        if apart > RESOLVED * radius:
            needed = math.ceil(lit.shape[1] * (apart / radius / RESOLVED) ** 2)
            raise ValueError(
                f"the pupil is neither a circle nor an ellipse, and its {lit.shape[1]} samples are "
                f"{apart / radius:.2g} radii apart: must be at most {RESOLVED:g} radii apart, as about {needed} are"
            )
        vertices = _cut(hull, dark.T / scale, apart) if dark is not None and cut else corners
    if vertices is None:
        return Rim(middle * scale, radius * scale)
    middle = (vertices.max(axis=0) + vertices.min(axis=0)) / 2
    radius = float(np.linalg.norm(vertices - middle, axis=1).max())
    return Rim(middle * scale, radius * scale, (vertices - middle) / radius)


def _hull(points: np.ndarray) -> Any:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        raise ValueError("the samples of the pupil lie on a line: must cover an area") from None


def _cut(hull: Any, dark: np.ndarray, apart: float) -> np.ndarray:
    """Move the edges of the hull outwards, and return the corners of the resulting polygon, (corner, 2).

    A dark sample, which is one without light, is near an edge if it lies in front of the edge, less than NEXT (3) times
    `apart` away, and less than `apart` beyond the ends of the edge. An edge is moved half way to the nearest of the
    dark samples that are near it. If there is none, the edge is moved to the circle or oval around all samples, with
    and without light.

    hull: convex hull of the illuminated samples of a pupil.
    dark: positions of the dark samples, array (sample, 2).
    apart: distance between neighbouring samples.
    """
    from scipy.spatial import HalfspaceIntersection

    every = _hull(np.concatenate([hull.points, dark]))
    middle, radius, around, _ = _round(every)
    limits = [_hull(middle + radius * _unit_polygon() if around is None else around).equations]
    for line, (start, end) in zip(hull.equations, hull.simplices, strict=True):
        beyond = dark @ line[:2] + line[2]
        from_middle = dark - (hull.points[start] + hull.points[end]) / 2
        aside = np.abs(from_middle @ np.array([-line[1], line[0]]))
        half = np.linalg.norm(hull.points[end] - hull.points[start]) / 2
        gap = beyond[(beyond > 0) & (aside < half + apart)].min(initial=math.inf)
        if gap < NEXT * apart:
            limits.append(line[None] - [0.0, 0.0, gap / 2])
    corners = HalfspaceIntersection(np.concatenate(limits), hull.points[hull.vertices].mean(axis=0)).intersections
    found = _hull(corners)
    vertices: np.ndarray = found.points[found.vertices]
    apart_enough = np.linalg.norm(vertices - np.roll(vertices, 1, axis=0), axis=1) > SHORTEST * radius
    return vertices[apart_enough]


def _round(hull: Any) -> tuple[np.ndarray, float, np.ndarray | None, float]:
    """Return centre and radius of a circle, vertices of an oval if it fits much better (else None), and the residual.

    The residual is that of the oval or, if there is none, of the circle; infinite if the hull fills too little of the
    circle. It is relative to the radius.
    """
    corners, area = hull.points[hull.vertices], hull.volume  # Qhull calls the area of a plane hull its volume
    middle, radius, ragged = _circle(corners)
    if area < FULL * math.pi * radius**2:
        ragged = math.inf
    if len(corners) >= LEAST_CORNERS and ragged > EXACT:
        oval, off = _oval(corners)
        if off < BETTER * ragged:
            return middle, radius, oval, off
    return middle, radius, None, ragged


def _circle(corners: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return the centre and radius of a circle fitted to the corners of a convex hull, and the residual of the fit.

    The radius is the largest distance of a corner from the centre. The residual is relative to this radius.

    Source: Kåsa, IEEE Trans. Instrum. Meas. 25, 8, 1976.
    """
    matrix = np.concatenate([2 * corners, np.ones((len(corners), 1))], axis=1)
    middle: np.ndarray = np.linalg.lstsq(matrix, np.sum(corners**2, axis=1), rcond=None)[0][:2]
    r = np.linalg.norm(corners - middle, axis=1)
    return middle, float(r.max()), float(np.std(r) / r.max())


def _oval(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Return a polygon that represents an oval around the corners of a convex hull, and the relative residual.

    The oval encloses all corners, and the polygon has approximately the same area as the oval. The oval is an ellipse
    that is fitted to the corners. Its radius is multiplied by a Fourier series of the angle if this improves the fit
    much, because the image of a round stop is an ellipse only to first order. The residual is infinite if the best
    conic is not an ellipse.
    """
    origin = corners.mean(axis=0)
    x, y = (corners - origin).T
    conic = np.linalg.lstsq(np.stack([x * x, x * y, y * y, x, y], axis=1), np.ones(len(x)), rcond=None)[0]
    form = np.array([[conic[0], conic[1] / 2], [conic[1] / 2, conic[2]]])
    if not np.linalg.eigvalsh(form).min() > 0:
        return corners, math.inf
    middle = -np.linalg.solve(form, conic[3:]) / 2
    to_circle = np.linalg.cholesky(form / (1 + middle @ form @ middle)).T
    on_circle = to_circle @ (corners - origin - middle).T
    r, angle, best = np.hypot(*on_circle), np.arctan2(on_circle[1], on_circle[0]), None
    turns = 2 * np.pi * np.arange(SIDES) / SIDES
    for terms in (0, HARMONICS):
        series = _series(terms, angle)
        if len(corners) < CORNERS_PER_TERM * len(series) and terms:
            continue
        found = np.linalg.lstsq(series.T, r, rcond=None)[0]
        beyond = r / (found @ series)
        off = float(np.std(beyond))
        if best is None or off < MUCH_BETTER * best[1]:
            best = found @ _series(terms, turns) * beyond.max(), off
    assert best is not None
    vertices = np.linalg.solve(to_circle, best[0] * _unit_polygon().T)
    return origin + middle + vertices.T, best[1]


def _unit_polygon() -> np.ndarray:
    """Return the corners of a regular polygon with the area of the unit circle, (SIDES, 2)."""
    turns = 2 * np.pi * np.arange(SIDES) / SIDES
    corners: np.ndarray = np.stack([np.cos(turns), np.sin(turns)], axis=1) * math.sqrt(turns[1] / math.sin(turns[1]))
    return corners


def _series(terms: int, angle: np.ndarray) -> np.ndarray:
    """Return 1, cos mφ and sin mφ up to m = terms, (2 terms + 1, n)."""
    m = np.arange(1, terms + 1)[:, None]
    return np.concatenate([np.ones((1, len(angle))), np.cos(m * angle), np.sin(m * angle)])
