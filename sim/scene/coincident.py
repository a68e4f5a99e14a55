"""Geoms whose surfaces coincide. As in MuJoCo, the geom that is defined last is visible.

If two surfaces are in the same place, rounding would decide which of them a ray hits. All renderers therefore move the
surface of the later geom outwards by a small distance, which exceeds the rounding errors of float32. The geoms to be
moved are found once, in the poses that are passed to `coincidences`. A plane is moved along its normal, so the earlier
of two planes is visible from behind.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from optics.numerics.kept_values import KeptValues
from sim.scene import shapes, surfaces
from sim.scene.model_hash import MOST_MODELS, model_hash

_TYPES = mujoco.mjtGeom
_CURVED = (_TYPES.mjGEOM_SPHERE, _TYPES.mjGEOM_ELLIPSOID, _TYPES.mjGEOM_CAPSULE, _TYPES.mjGEOM_CYLINDER)
POINTS = 120  # number of points on each geom that are compared with other geoms
# Surfaces that are closer than APART count as coincident, and LIFT separates them. Both are in units of `_scale`. At a
# distance of 20 times the size of a geom, rounding errors are a tenth of LIFT, and a third for Mitsuba's cylinder.
APART, LIFT = 5e-6, 5e-5
MOST = 1e-3  # largest lift, relative to the size of a geom
ALIGNED = 0.999  # smallest cosine between the normals of coincident surfaces
_KEPT = KeptValues(MOST_MODELS)


@dataclass(frozen=True)
class Coincidences:
    """Geoms whose surfaces coincide.

    pairs: ids of the two geoms of each pair; the geom that is defined later comes second
    lifts: distance by which the surface of a geom is moved outwards [m], by geom id; other geoms are not moved
    """

    pairs: tuple[tuple[int, int], ...]
    lifts: dict[int, float]

    def lift(self, geom: int) -> float:
        """Return the distance by which the surface of a geom is moved outwards [m]."""
        return self.lifts.get(geom, 0.0)

    def message(self, model: mujoco.MjModel) -> str | None:
        """Return a warning if geoms of different groups (such as collision and visual) coincide, otherwise None."""
        found = [pair for pair in self.pairs if len(set(model.geom_group[list(pair)])) > 1]
        if not found:
            return None
        first, last = found[0]
        names = [model.geom(geom).name or str(geom) for geom in (first, last)]
        groups = [int(model.geom_group[geom]) for geom in (first, last)]
        more = f", and {len(found) - 1} more pairs," if len(found) > 1 else ""
        return (
            f"geoms {names[0]!r} (group {groups[0]}) and {names[1]!r} (group {groups[1]}){more} are in the same place, "
            f"where the one defined last is visible: to show a single group, pass groups, such as groups=({groups[1]},)"
        )


def coincidences(data: mujoco.MjData, geoms: Sequence[int]) -> Coincidences:
    """Return which of these geoms have coinciding surfaces in the poses of `data`."""
    poses = data.geom_xpos.tobytes(), data.geom_xmat.tobytes()
    key = (model_hash(data.model), *poses, tuple(int(geom) for geom in geoms))
    found: Coincidences = _KEPT.get(key, lambda: _coincidences(data, geoms))
    return found


def _coincidences(data: mujoco.MjData, geoms: Sequence[int]) -> Coincidences:
    model, pairs, lifts = data.model, [], dict[int, float]()
    near = list(_near(data, sorted(int(geom) for geom in geoms)))
    samples = {geom: _points(data, geom) for geom in {geom for pair in near for geom in pair}}
    for first, last in near:
        scale = _scale(data, first, last)
        apart = APART * scale
        if _touches(data, *samples[first], last, apart) or _touches(data, *samples[last], first, apart):
            pairs.append((first, last))
            most = MOST * float(model.geom_rbound[last]) or np.inf
            lifts[last] = min(max(lifts.get(last, 0.0), lifts.get(first, 0.0) + LIFT * scale), most)
    return Coincidences(tuple(pairs), lifts)


def _near(data: mujoco.MjData, geoms: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Generate pairs of geoms whose bounding boxes overlap.

    In a pair, the geom that comes first in `geoms` is first. The pairs are sorted by the position of their second geom
    in `geoms`.
    """
    model, turns = data.model, data.geom_xmat[geoms].reshape(-1, 3, 3)
    box = model.geom_aabb[geoms]
    middle = data.geom_xpos[geoms] + np.einsum("gij,gj->gi", turns, box[:, :3])
    half = np.einsum("gij,gj->gi", np.abs(turns), box[:, 3:]) * (1 + 1e-4)
    for j, last in enumerate(geoms):
        near = (np.abs(middle[:j] - middle[j]) <= half[:j] + half[j]).all(axis=1)
        yield from ((geoms[int(i)], last) for i in np.flatnonzero(near))


def _scale(data: mujoco.MjData, first: int, last: int) -> float:
    """Return a length [m] that measures how inaccurately float32 places the surfaces of two geoms.

    Rounding errors of points on the surfaces are proportional to this length. It grows with the size of the smaller
    geom and with the distance of the geom `last` from the world's origin.
    """
    model = data.model
    sizes = [float(model.geom_rbound[geom]) or np.inf for geom in (first, last)]  # a plane has no bound
    size = min(*sizes, float(model.stat.extent) if np.isinf(sizes).all() else np.inf)
    return 3 * size + 0.1 * float(np.linalg.norm(data.geom_xpos[last]))


def _points(data: mujoco.MjData, geom: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points on the surface of a geom, away from edges, and outward normals, in the world, (n, 3) each."""
    model, rng = data.model, np.random.default_rng(geom)
    triangles, kind = shapes.untextured(model, geom), surfaces.geom_type(model, geom)
    if kind in _CURVED:
        assert triangles.normals is not None
        chosen = rng.integers(len(triangles.vertices), size=POINTS)
        points, normals = triangles.vertices[chosen].copy(), triangles.normals[chosen]
        upright, level = np.abs(normals[:, 2]) > 1 - 1e-9, np.abs(normals[:, 2]) < 1e-9
        shrunk = rng.uniform(0.05, 0.95, POINTS)
        if kind != _TYPES.mjGEOM_ELLIPSOID and kind != _TYPES.mjGEOM_SPHERE:
            points[level, 2] *= shrunk[level]  # along the side
        if kind == _TYPES.mjGEOM_CYLINDER:
            points[upright, :2] *= shrunk[upright, None]  # on an end
    else:
        corners = triangles.vertices[triangles.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(cross, axis=1)
        chosen = rng.choice(len(area), POINTS, p=area / area.sum())
        points = np.einsum("nk,nki->ni", rng.dirichlet((1, 1, 1), POINTS), corners[chosen])
        normals = cross[chosen] / area[chosen, None]
    turn = data.geom_xmat[geom].reshape(3, 3)
    return points @ turn.T + data.geom_xpos[geom], normals @ turn.T


def _touches(data: mujoco.MjData, points: np.ndarray, normals: np.ndarray, geom: int, apart: float) -> bool:
    """Return whether another geom's surface touches this geom's surface in at least one point.

    It does if the distance is at most `apart` and the normals of the two surfaces are nearly parallel there.

    points, normals: points of the other surface [m], and its normals there, unit vectors, in the world's frame, (n, 3)
    apart: distance [m]
    """
    model, turn = data.model, data.geom_xmat[geom].reshape(3, 3)
    kind, box = surfaces.geom_type(model, geom), model.geom_aabb[geom]
    local = (points - data.geom_xpos[geom]) @ turn
    near = (np.abs(local - box[:3]) <= box[3:] + apart).all(axis=1)
    if kind == _TYPES.mjGEOM_PLANE:
        near &= (np.abs(local[:, 2]) <= apart) & (normals @ turn[:, 2] > ALIGNED)
    above = 10 * apart
    for k in np.flatnonzero(near):
        found = np.zeros(3)
        distance = _ray_distance(data, geom, kind, points[k] + above * normals[k], -normals[k], found)
        if abs(distance - above) <= apart and found @ normals[k] > ALIGNED:
            return True
    return False


def _ray_distance(
    data: mujoco.MjData, geom: int, kind: mujoco.mjtGeom, start: np.ndarray, direction: np.ndarray, normal: np.ndarray
) -> float:
    """Return the distance [m] of a geom along a ray, negative for a miss, and write the normal there to `normal`.

    kind: type of the geom
    start, direction: start of the ray [m], and its direction, a unit vector, in the world's frame, (3,)
    normal: array (3,) that receives the surface's unit normal
    """
    if kind == _TYPES.mjGEOM_MESH:
        return float(mujoco.mj_rayMesh(data.model, data, geom, start, direction, normal))
    if kind == _TYPES.mjGEOM_SDF:  # MuJoCo ends the process if it casts a ray at the mesh of a signed distance field
        return _ray_distance_to_triangles(data, geom, start, direction, normal)
    if kind == _TYPES.mjGEOM_HFIELD:
        return float(mujoco.mj_rayHfield(data.model, data, geom, start, direction, normal))
    place, turn, size = data.geom_xpos[geom], data.geom_xmat[geom], data.model.geom_size[geom]
    return float(mujoco.mju_rayGeom(place, turn, size, start, direction, kind, normal))


def _ray_distance_to_triangles(
    data: mujoco.MjData, geom: int, start: np.ndarray, direction: np.ndarray, normal: np.ndarray
) -> float:
    """Return the result of `_ray_distance` for the triangles of a geom (Möller and Trumbore 1997)."""
    triangles, turn = shapes.untextured(data.model, geom), data.geom_xmat[geom].reshape(3, 3)
    o, d = (start - data.geom_xpos[geom]) @ turn, direction @ turn
    corners = triangles.vertices[triangles.faces]
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across, from_corner = np.cross(d, other), o - corners[:, 0]
    volume = np.einsum("mi,mi->m", one, across)
    along = np.cross(from_corner, one)
    per = 1 / np.where(volume == 0, np.inf, volume)
    u, v = np.einsum("mi,mi->m", from_corner, across) * per, along @ d * per
    t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (volume != 0), np.einsum("mi,mi->m", other, along) * per, -1)
    if (t < 0).all():
        return -1.0
    first = int(np.argmin(np.where(t < 0, np.inf, t)))
    outwards = np.cross(one[first], other[first])
    normal[:] = turn @ (outwards / np.linalg.norm(outwards))
    return float(t[first])
