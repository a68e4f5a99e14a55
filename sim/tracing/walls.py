"""The static part of a world in closed form: upright walls on a floor.

Walls are axis-aligned boxes that reach from the floor to above the eyes. Their tops and bottoms are not visible from
the eyes. A ray therefore hits a wall where the ray enters the wall's footprint, unless the ray is above the wall's top
at this point. Texture coordinates are affine on every face, and follow from the triangles of the Mitsuba scene
(`sim.mirror`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from optics.numerics.kept_values import KeptValues
from optics.numerics.read_only import ReadOnlyArrays
from sim.scene import shapes, surfaces
from sim.scene.model_hash import MOST_MODELS, model_hash

SIDES = 4  # sides of a wall, which face -x, +x, -y, +y
FACES = 6  # faces of a box, with four corners each
# Largest deviation of a wall's rotation from quarter turns, and of faces from a common height or grid [m].
ALIGNED = 1e-6
_KEPT = KeptValues(MOST_MODELS)


class NoClosedForm(ValueError):
    """A world cannot be rendered by formulas in closed form. The message states the reason.

    Such formulas exist only for worlds that consist of upright walls, a floor and spheres.
    """


@dataclass(frozen=True)
class Walls(ReadOnlyArrays):
    """Walls and floor of a world.

    lower, upper: corners of the walls' footprints [m], (n, 2)
    top: height of each wall's top [m], (n,)
    floor: height of the floor [m]
    floor_lower, floor_upper: corners of the floor [m], (2,)
    uv: for each face, the matrix that converts a point (x, y, z, 1) [m] to texture coordinates (u, v), (4 n + 1, 2, 4);
        the floor comes last
    geoms: geom id of each face, (4 n + 1,)
    """

    lower: np.ndarray
    upper: np.ndarray
    top: np.ndarray
    floor: float
    floor_lower: np.ndarray
    floor_upper: np.ndarray
    uv: np.ndarray
    geoms: np.ndarray

    def __len__(self) -> int:
        return len(self.top)


def walls_of(model: mujoco.MjModel, geoms: Sequence[int], eyes: np.ndarray) -> Walls:
    """Return the walls and the floor of a world.

    geoms: ids of the static geoms: boxes are walls, and a plane is the floor
    eyes: heights of the pupils [m]

    Raises:
        NoClosedForm: a geom is neither a box nor a plane; there is not exactly one plane, or it is tilted, or its sides
            are not parallel to the axes; or the eyes are not above it. Other causes are that a box is not aligned with
            the axes, does not stand on the floor, extends beyond it, ends below the eyes or has a cube texture.
    """
    lowest, highest = float(eyes.min()), float(eyes.max())
    key = model_hash(model), tuple(int(geom) for geom in geoms), lowest, highest
    found: Walls = _KEPT.get(key, lambda: _walls(model, geoms, lowest, highest))
    return found


def _walls(model: mujoco.MjModel, geoms: Sequence[int], lowest: float, highest: float) -> Walls:
    """Return the walls and the floor of a world, see `walls_of`.

    lowest, highest: heights of the lowest and the highest pupil [m]
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    floors = [g for g in geoms if surfaces.geom_type(model, g) == mujoco.mjtGeom.mjGEOM_PLANE]
    boxes = [g for g in geoms if surfaces.geom_type(model, g) == mujoco.mjtGeom.mjGEOM_BOX]
    others = set(geoms) - {*floors, *boxes}
    if others:
        raise NoClosedForm(f"geom {model.geom(others.pop()).name!r} is neither a plane nor a box")
    if len(floors) != 1:
        raise NoClosedForm(f"{len(floors)} floors")
    floor = _rectangle(model, data, floors[0])
    height = float(floor[0, 2])
    sides = [_box(model, data, g) for g in boxes]
    corners = np.array([[low, high] for low, high, _ in sides]).reshape(-1, 2, 3)
    if (np.abs(corners[:, 0, 2] - height) > ALIGNED).any() or (corners[:, 1, 2] <= highest).any():
        raise NoClosedForm("a wall does not stand on the floor, or ends below the eyes")
    if lowest <= height:
        raise NoClosedForm("the eyes are not above the floor")
    floor_lower, floor_upper = floor[:, :2].min(axis=0), floor[:, :2].max(axis=0)
    if (corners[..., :2] < floor_lower - ALIGNED).any() or (corners[..., :2] > floor_upper + ALIGNED).any():
        raise NoClosedForm("a wall extends beyond the floor")
    return Walls(
        lower=corners[:, 0, :2],
        upper=corners[:, 1, :2],
        top=corners[:, 1, 2],
        floor=height,
        floor_lower=floor_lower,
        floor_upper=floor_upper,
        uv=np.array([*(uv for _, _, faces in sides for uv in faces), _floor_uv(floor)]),
        geoms=np.array([*(g for g in boxes for _ in range(SIDES)), floors[0]]),
    )


def _rectangle(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Return the three points of a plane at which Mitsuba's (u, v) is (0, 0), (1, 0) and (0, 1), (3, 3) [m].

    Raises:
        NoClosedForm: the plane is tilted, or its sides are not parallel to the axes.
    """
    corners = np.array([[-1, -1], [1, -1], [-1, 1]]) * shapes.plane_sides(model, geom)
    pose = shapes.pose(data, geom)
    points = corners @ pose[:3, :2].T + pose[:3, 3]
    if np.abs(pose[:3, 2] - [0, 0, 1]).max() > ALIGNED or np.abs(np.abs(pose[:2, :2]).max(axis=0) - 1).max() > ALIGNED:
        raise NoClosedForm(f"plane {model.geom(geom).name!r} is not level, or turned")
    return np.asarray(points)


def _floor_uv(corners: np.ndarray) -> np.ndarray:
    return _affine(corners, np.array([[0.0, 0], [1, 0], [0, 1]]))


def _box(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return the lower and upper corner of a box [m], (3,), and the texture coordinates on its sides.

    The coordinates are affine functions (2, 4) of the point, for the sides -x, +x, -y, +y.

    Raises:
        NoClosedForm: the box is not aligned with the axes, or has a cube texture.
    """
    pose = shapes.pose(data, geom)
    if np.abs(np.abs(pose[:3, :3]).max(axis=0) - 1).max() > ALIGNED:
        raise NoClosedForm(f"box {model.geom(geom).name!r} is not aligned with the axes")
    (part,) = shapes.parts(model, geom)
    triangles = part.triangles
    assert triangles is not None
    if len(triangles.vertices) != 4 * FACES:
        raise NoClosedForm(f"box {model.geom(geom).name!r} has a cube texture")
    vertices = triangles.vertices @ pose[:3, :3].T + pose[:3, 3]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    uv = np.zeros((len(vertices), 2)) if triangles.uv is None else triangles.uv
    faces = [(low, 0), (high, 0), (low, 1), (high, 1)]
    found = []
    for bound, axis in faces:
        # The corners of a box are listed face by face, four each.
        quads = vertices.reshape(-1, 4, 3)
        face = int(np.argmin(np.abs(quads[:, :, axis] - bound[axis]).max(axis=1)))
        found.append(_affine(quads[face], uv.reshape(-1, 4, 2)[face]))
    return low, high, found


def _affine(points: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Return the affine map (2, 4) from (x, y, z, 1) to texture coordinates on a plane.

    The map is constant along the plane's normal.

    points: points of the plane, (n, 3)
    uv: texture coordinates at these points, (n, 2)
    """
    along = points[1:] - points[0]
    linear = np.linalg.lstsq(along, uv[1:] - uv[0], rcond=None)[0].T
    return np.column_stack([linear, uv[0] - linear @ points[0]])
