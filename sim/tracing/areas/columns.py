"""The walls that are visible in an area, a small rectangle of an upright eye's visual field (`patch.Area`).

At most two faces of walls are taken into account: the face that is visible at the area's left border, and the face at
its right border. If these are different faces, a corner or an edge lies between them. The column in which the edge is
visible is computed from the ends of the faces.

A column is a vertical line in the area. Its position a runs from -1/2 at the left border to 1/2 at the right border.
A ray of column a leaves the pupil with the horizontal direction `Area.level(a)` and hits a face at the distance t. This
distance is measured along the eye's axis, so the horizontal position of the hit is p + t · `Area.level(a)`, where p is
the horizontal position of the pupil. If the pupil is at the height z, the foot of the face is visible at the slope
(floor - z)/t, and its top at the slope (top - z)/t. The inverse distance 1/t is linear in a, so there are closed forms
for the fractions of the area that floor, wall and sky fill.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats
from sim.tracing.areas.half_planes import mean_clamped
from sim.tracing.areas.patch import Area, Patch, Rectangle
from sim.tracing.wall_intersection import CellTables, Footprints
from sim.tracing.walls import SIDES, Walls

LEAST_NEARNESS = 1e-6  # smallest inverse distance [1/m], which also prevents divisions by 0
NOTHING = 1e-12  # smallest height of a part of an area, which prevents divisions by 0
RIM = 4  # number of sides of the floor; its rim counts as a wall in directions without a wall


@dataclass(frozen=True)
class Face:
    """A face of a wall.

    index: index of the face
    left, right: ends of the face, as seen from the front (Point2f)
    """

    index: Array
    left: Array
    right: Array


@dataclass(frozen=True)
class Piece:
    """The part of a wall's face that is visible between two columns of an area.

    An area is a rectangle of the visual field, and a column is a vertical line in it. The column's position runs from
    -1/2 at the area's left border to 1/2 at its right border.

    start, end: positions of the first and the last column
    inverse_distance: 1/t in the area's middle column, and its change per unit of the position [1/m], where t is the
        face's distance along the eye's axis
    floor_share, wall_share, sky_share: floor, wall and sky between the two columns, as fractions of the whole area
    """

    face: Face
    start: Array
    end: Array
    inverse_distance: tuple[Array, Array]
    floor_share: Array
    wall_share: Array
    sky_share: Array

    @property
    def middle(self) -> Array:
        """Horizontal position midway between `start` and `end` in an area, a rectangle of the visual field.

        Positions run from -1/2 at the area's left border to 1/2 at its right border.
        """
        return (self.start + self.end) / 2

    def inverse_distance_at(self, a: Array) -> Array:
        """Return the inverse distance 1/t [1/m] of this piece of a wall at one horizontal position in an area.

        An area is a rectangle of the visual field. The distance t is measured along the eye's axis. If p is the x and y
        of the pupil, the x and y of the wall at this position are p + t · `Area.level(a)`.

        a: horizontal position, from -1/2 (left border of the area) to 1/2 (right border)
        """
        return dr.maximum(dr.fma(self.inverse_distance[1], a, self.inverse_distance[0]), LEAST_NEARNESS)

    def place(self, area: Area, a: Array) -> Array:
        """Return the x and y (Point2f) of the wall's face at one horizontal position in an area of the visual field.

        a: horizontal position, from -1/2 (left border of the area) to 1/2 (right border)
        """
        return area.origin.xy + area.level(a) / self.inverse_distance_at(a)

    def patch(self, area: Area, floor: float, top: float) -> Patch:
        """Return the part of the wall's face that is visible in an area, a rectangle of the visual field.

        floor, top: heights of the floor and of the wall's top [m]
        """
        near = self.inverse_distance_at(self.middle)
        bottom, ceiling = (area.up + sign * area.height / 2 for sign in (-1, 1))
        low = dr.maximum((floor - area.origin.z) * near, bottom)
        high = dr.maximum(dr.minimum((top - area.origin.z) * near, ceiling), low)
        far = dr.rcp(near)
        level = area.level(self.middle)
        point = area.origin + mi.Vector3f(level.x, level.y, (low + high) / 2) * far
        point.z = dr.clip(point.z, floor, top)
        along = self.place(area, self.end) - self.place(area, self.start)
        side = dr.normalize(self.face.right - self.face.left)
        return Patch(
            point,
            mi.Normal3f(side.y, -side.x, 0),
            mi.Vector3f(along.x, along.y, 0),
            mi.Vector3f(0, 0, (high - low) * far),
        )


class Columns:
    """Search for the parts of walls that are visible in given rectangles of the visual field.

    All walls of the world have the same height.

    top: height of the walls' tops [m]

    Attribute `face_ends`: table of the x and y of the left and right end of each face, an input of the rendering
        program.
    """

    def __init__(self, walls: Walls, footprints: Footprints) -> None:
        self._footprints, self._floor = footprints, walls.floor
        self.top = float(walls.top.max(initial=walls.floor))
        self._lower, self._upper = (list(map(float, corner)) for corner in (walls.floor_lower, walls.floor_upper))
        self._rim = SIDES * len(walls)
        self.face_ends = floats(_face_ends(walls))

    def pieces(self, area: Area, faces: tuple[Array, Array], face_ends: Array) -> tuple[Piece, Piece]:
        """Return the visible parts of the two faces that appear at the area's left and right borders.

        An edge between the faces separates the parts. If the same face is visible at both borders, the right part is
        empty.

        faces: indices of the faces at the left and the right border, see `first_faces`
        face_ends: the attribute `face_ends`, passed as an argument of the kernel
        """
        half = mi.Float(0.5)
        left, right = (self._face(index, face_ends) for index in faces)
        edge = dr.select(left.index == right.index, half, self._edge(area, left, right))
        return self._piece(area, left, -half, edge), self._piece(area, right, edge, half)

    def first_faces(self, origin: Array, level: Array, cells: CellTables | None) -> Array:
        """Return the index of the face that a ray in the horizontal direction `level` (Vector2f) hits first.

        If the ray hits no wall, return the index of the side through which it leaves the rectangular floor. The four
        sides of the floor have the indices after those of the faces.

        cells: see `Footprints`
        """
        ray = mi.Ray3f(origin, mi.Vector3f(level.x, level.y, 0))
        t, face, _ = self._footprints.hit(ray, cells)
        return dr.select(dr.isfinite(t), face, self._rim + self._side_of_floor(ray))

    @staticmethod
    def _face(face: Array, face_ends: Array) -> Face:
        ends = dr.gather(mi.Vector4f, face_ends, face)
        return Face(face, mi.Point2f(ends.x, ends.y), mi.Point2f(ends.z, ends.w))

    def _side_of_floor(self, ray: Array) -> Array:
        """Return the index of the side through which a ray leaves the floor: -x, +x, -y, +y."""
        t = [
            (dr.select(d > 0, upper, lower) - o) / dr.select(dr.abs(d) < LEAST_NEARNESS, LEAST_NEARNESS, d)
            for o, d, lower, upper in zip(ray.o, ray.d, self._lower, self._upper, strict=False)
        ]
        x, y = (dr.select(d > 0, mi.UInt32(1), mi.UInt32(0)) for d in (ray.d.x, ray.d.y))
        return dr.select(t[0] < t[1], x, y + 2)

    def _edge(self, area: Area, left: Face, right: Face) -> Array:
        """Return the horizontal position in an area, from -1/2 to 1/2, of the edge between two visible walls.

        The edge is the corner that the walls have in common, or else the end of the wall that is nearer to the eye. If
        there is a gap between the walls, the surface in the gap is unknown, and the edge is put in the gap's middle.
        """
        ends = dr.minimum(_column_of(area, left.right, 1.0), 0.5)
        begins = dr.maximum(_column_of(area, right.left, -1.0), -0.5)
        (l0, l1), (r0, r1) = _inverse_distance(area, left), _inverse_distance(area, right)
        middle = (ends + begins) / 2
        slope = l1 - r1
        corner = (r0 - l0) / dr.select(dr.abs(slope) < LEAST_NEARNESS, LEAST_NEARNESS, slope)
        left_nearer = dr.fma(slope, middle, l0 - r0) > 0
        edge = dr.select(left_nearer, ends, begins)
        edge = dr.select((corner > begins) & (corner < ends), corner, edge)
        return dr.clip(dr.select(begins >= ends, middle, edge), -0.5, 0.5)

    def _piece(self, area: Area, face: Face, start: Array, end: Array) -> Piece:
        none = mi.Float(0)
        piece = Piece(face, start, end, _inverse_distance(area, face), none, none, none)
        return self.behind(area, piece, Rectangle(mi.Float(0), mi.Float(0), mi.Float(1), mi.Float(1)))

    def behind(self, area: Area, piece: Piece, part: Rectangle) -> Piece:
        """Return a piece of a wall's face, cut to what is visible in a smaller rectangle within the area.

        The shares of the result count only floor, wall and sky in the smaller rectangle. They are fractions of the
        whole area.

        part: the smaller rectangle, in units of the area's sides
        """
        start, end = (dr.clip(part.a + sign * part.width / 2, piece.start, piece.end) for sign in (-1, 1))
        near = [piece.inverse_distance_at(a) for a in (start, end)]
        bottom, ceiling = (area.up + (part.b + sign * part.height / 2) * area.height for sign in (-1, 1))
        depth, climb = self._floor - area.origin.z, self.top - area.origin.z
        share, per = (end - start) * part.height, dr.rcp(dr.maximum(area.height * part.height, NOTHING))
        below = share * mean_clamped(*((depth * n - bottom) * per for n in near))
        above = share * mean_clamped(*((ceiling - climb * n) * per for n in near))
        beside = dr.select(piece.face.index < self._rim, dr.maximum(share - below - above, 0), 0)
        return replace(piece, start=start, end=end, floor_share=below, wall_share=beside, sky_share=above)


def _inverse_distance(area: Area, face: Face) -> tuple[Array, Array]:
    """Return a wall face's inverse distance 1/t [1/m] in an area's middle column, and its change across the area.

    An area is a rectangle of the visual field. The change is 1/t at the area's right border minus 1/t at its left
    border. The face is extended to the left and right without end, so that 1/t exists everywhere in the area.
    """
    side = face.right - face.left
    scale = dr.rcp(_cross(face.left - area.origin.xy, side))
    return _cross(area.ahead, side) * scale, _cross(area.right, side) * scale


def _column_of(area: Area, point: Array, beyond: float) -> Array:
    """Return the horizontal position at which a point is visible in an area, a rectangle of the visual field.

    The position runs from -1/2 at the area's left border to 1/2 at its right border.

    point: x and y of the point (Point2f)
    beyond: return value if the point is behind the eye: -1 or 1, outside the area
    """
    way = point - area.origin.xy
    across = _cross(area.right, way)
    return dr.select(across > 0, -_cross(area.ahead, way) / dr.select(across > 0, across, 1), beyond)


def _cross(a: Array, b: Array) -> Array:
    return dr.fma(a.x, b.y, -a.y * b.x)


def _face_ends(walls: Walls) -> np.ndarray:
    """Return the x and y of the left end, and of the right end, of each face, (face, 4).

    Left and right are those of a viewer in front of the wall. The last four rows contain the four sides of the
    rectangular floor, with left and right as for a viewer on the floor.
    """
    found = []
    for (x0, y0), (x1, y1) in zip(walls.lower, walls.upper, strict=True):
        # Faces in the order -x, +x, -y, +y.
        found += [(x0, y1, x0, y0), (x1, y0, x1, y1), (x0, y0, x1, y0), (x1, y1, x0, y1)]
    (x0, y0), (x1, y1) = walls.floor_lower, walls.floor_upper
    found += [(x0, y0, x0, y1), (x1, y1, x1, y0), (x1, y0, x0, y0), (x0, y1, x1, y1)]
    return np.array(found)
