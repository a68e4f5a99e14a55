"""All that moves in a world, met by rays inside the renderer's kernel: primitives in closed form, meshes by Mitsuba.

Each mesh is a scene of its own, in the geom's frame, and rays are taken there: nothing is rebuilt when it moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.autodiff import Array
from sim.robots.poses import Poses
from sim.robots.primitives import PRIMITIVES, Primitive
from sim.scene import shapes, surfaces
from sim.scene.device_arrays import floats, three, whole_numbers
from sim.scene.variant import MitsubaObject

_TYPES = mujoco.mjtGeom
_KINDS = {
    _TYPES.mjGEOM_SPHERE: "ellipsoid",
    _TYPES.mjGEOM_ELLIPSOID: "ellipsoid",
    _TYPES.mjGEOM_CAPSULE: "capsule",
    _TYPES.mjGEOM_CYLINDER: "cylinder",
    _TYPES.mjGEOM_BOX: "box",
}
# Of four floats for each mover: a sphere around it; then an axis of its frame in the world and a coordinate of its
# origin, three times.
ROWS = 4
MESHES = 32  # scenes in one kernel, at most


@dataclass(frozen=True)
class Hit:
    """t: distance [m], infinite where nothing is met · which: mover · normal: unit, in the world · uv: of meshes"""

    t: Array
    which: Array
    normal: Array
    uv: Array


@dataclass(frozen=True)
class _Frame:
    """axes: of a mover in the world (3 Vector3f) · origin (Vector3f)"""

    axes: tuple[Array, Array, Array]
    origin: Array

    def taken(self, v: Array) -> Array:
        """A direction in the mover's frame."""
        return mi.Vector3f(*(dr.dot(axis, v) for axis in self.axes))

    def given(self, v: Array) -> Array:
        """The mover's direction in the world."""
        return self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z


class Movers:
    """The geoms of a model that move, primitives first, by kind.

    geoms: their ids, (mover,) · n_primitives: of them
    meshes: Mitsuba scenes of the others
    inputs: arrays for the kernel, by name

    Raises:
        ValueError: more than MESHES meshes.
    """

    def __init__(self, model: mujoco.MjModel, geoms: list[int], meshes: dict[int, MitsubaObject]) -> None:
        if len(meshes) > MESHES:
            raise ValueError(f"the model has {len(meshes)} moving meshes: must be {MESHES} at most; hide some by group")
        by_kind = {name: [g for g in geoms if g not in meshes and kind_of(model, g) == name] for name in PRIMITIVES}
        primitives = [g for group in by_kind.values() for g in group]
        self.geoms, self.n_primitives = np.array([*primitives, *meshes], int), len(primitives)
        self.meshes = list(meshes.values())
        sizes = np.zeros((len(self.geoms) + 1, 4))  # one more: never empty
        sizes[: len(self.geoms), :3] = model.geom_size[self.geoms]
        round_ = [i for i, g in enumerate(primitives) if model.geom_type[g] == _TYPES.mjGEOM_SPHERE]
        sizes[round_, :3] = sizes[round_, :1]
        self._reach = model.geom_rbound[self.geoms]  # of each from its origin [m]
        self._ends = np.cumsum([0, *(len(group) for group in by_kind.values())])
        self.inputs = {"mover_sizes": floats(sizes), "mover_ends": whole_numbers(self._ends)}

    def __len__(self) -> int:
        return len(self.geoms)

    @property
    def n_rows(self) -> int:
        """Of four floats each, in one world."""
        return 1 + ROWS * len(self)

    def rows(self, poses: Poses) -> np.ndarray:
        """What the kernel reads of a world: a sphere around all movers, then each, (world, 4 n_rows) float32."""
        rows = np.zeros((poses.n, self.n_rows, 4), np.float32)
        if len(self):
            places = poses.geom_xpos[:, self.geoms]
            rows[:, 0, :3] = centre = places.mean(axis=1)
            rows[:, 0, 3] = (np.linalg.norm(places - centre[:, None], axis=-1) + self._reach).max(axis=1)
            each = rows[:, 1:].reshape(poses.n, len(self), ROWS, 4)
            each[:, :, 0, :3], each[:, :, 0, 3] = places, self._reach
            each[:, :, 1:, :3] = np.swapaxes(poses.geom_xmat[:, self.geoms], -1, -2)
            each[:, :, 1:, 3] = places
        return rows.reshape(poses.n, -1)

    def nearest(self, ray: Array, farthest: Array, rows: Array, first: Array, inputs: dict[str, Array]) -> Hit:
        """The one that a ray meets first, nearer than `farthest`; first: of the world's rows."""
        none = farthest, mi.UInt32(len(self)), mi.Vector3f(0, 0, 1), mi.Point2f(0)
        if not len(self):
            return Hit(*none)
        near = _may_meet(ray, rows, first)
        found = dr.if_stmt((), near, lambda: self._nearest(ray, farthest, rows, first + 1, inputs), lambda: none)
        return Hit(*found)

    def block(self, ray: Array, farthest: Array, rows: Array, first: Array, inputs: dict[str, Array]) -> Array:
        """Whether any lies on a ray, nearer than `farthest`."""
        near = _may_meet(ray, rows, first) & (farthest > 0)
        return dr.if_stmt((), near, lambda: self._block(ray, farthest, rows, first + 1, inputs), lambda: mi.Bool(False))

    def _nearest(
        self, ray: Array, farthest: Array, rows: Array, first: Array, inputs: dict[str, Array]
    ) -> tuple[Array, ...]:
        """first: row of the first mover"""
        t, which = farthest, mi.UInt32(len(self))
        for i, primitive in self._kinds():

            def step(k: Array, t: Array, which: Array, hit: Callable[..., Array] = primitive.hit) -> tuple[Array, ...]:
                found = _met(hit, ray, rows, first, k, inputs)
                nearer = found < t
                return k + 1, dr.select(nearer, found, t), dr.select(nearer, k, which)

            _, t, which = _loop(i, inputs, step, t, which)
        uv = mi.Point2f(0)
        normal = self._normals(ray(dr.select(which < len(self), t, 0)), which, rows, first, inputs)
        for m, scene in enumerate(self.meshes):
            k = self.n_primitives + m
            frame = _frame(rows, first, mi.UInt32(k))
            si = scene.ray_intersect(_local_ray(ray, frame), mi.RayFlags.All, True)
            nearer = si.is_valid() & (si.t < t)
            t, which = dr.select(nearer, si.t, t), dr.select(nearer, k, which)
            normal = dr.select(nearer, frame.given(mi.Vector3f(si.n)), normal)
            uv = dr.select(nearer, si.uv, uv)
        return t, which, normal, uv

    def _block(self, ray: Array, farthest: Array, rows: Array, first: Array, inputs: dict[str, Array]) -> Array:
        blocked = mi.Bool(False)
        for i, primitive in self._kinds():

            def step(k: Array, blocked: Array, hit: Callable[..., Array] = primitive.hit) -> tuple[Array, ...]:
                return k + 1, blocked | (_met(hit, ray, rows, first, k, inputs) < farthest)

            _, blocked = _loop(i, inputs, step, blocked)
        for m, scene in enumerate(self.meshes):
            local = _local_ray(ray, _frame(rows, first, mi.UInt32(self.n_primitives + m)))
            local.maxt = farthest
            blocked |= scene.ray_test(local, ~blocked)
        return blocked

    def _kinds(self) -> list[tuple[int, Primitive]]:
        """Those that there are, by number."""
        return [(i, p) for i, p in enumerate(PRIMITIVES.values()) if self._ends[i] < self._ends[i + 1]]

    def _normals(self, point: Array, which: Array, rows: Array, first: Array, inputs: dict[str, Array]) -> Array:
        """Of primitives, at points on them."""
        k = dr.minimum(which, max(self.n_primitives - 1, 0))
        frame, size = _frame(rows, first, k), _size(inputs, k)
        local = frame.taken(point - frame.origin)
        normal = mi.Vector3f(0, 0, 1)
        for i, primitive in self._kinds():
            mine = (k >= dr.gather(mi.UInt32, inputs["mover_ends"], i)) & (
                k < dr.gather(mi.UInt32, inputs["mover_ends"], i + 1)
            )
            normal = dr.select(mine, primitive.normal(local, size), normal)
        return dr.normalize(frame.given(normal))


def kind_of(model: mujoco.MjModel, geom: int) -> str | None:
    """Name of the primitive that a geom is; None: a mesh, or something whose texture wants triangles."""
    return None if shapes.is_textured(model, geom) else _KINDS.get(surfaces.geom_type(model, geom))


def _met(hit: Callable[..., Array], ray: Array, rows: Array, first: Array, k: Array, inputs: dict[str, Array]) -> Array:
    """Where a ray meets mover k [m]. Most rays miss the sphere around it, and their neighbours do, too."""

    def within() -> Array:
        frame = _frame(rows, first, k)
        return hit(frame.taken(ray.o - frame.origin), frame.taken(ray.d), _size(inputs, k))

    found: Array = dr.if_stmt((), _may_meet(ray, rows, first + k * ROWS), within, lambda: mi.Float(dr.inf))
    return found


def _frame(rows: Array, first: Array, k: Array) -> _Frame:
    fours = [list(dr.gather(mi.Vector4f, rows, first + k * ROWS + i)) for i in range(1, ROWS)]
    a, b, c = (mi.Vector3f(*four[:3]) for four in fours)
    return _Frame((a, b, c), mi.Vector3f(*(four[3] for four in fours)))


def _may_meet(ray: Array, rows: Array, first: Array) -> Array:
    """Whether a ray meets the sphere of this row."""
    x, y, z, radius = dr.gather(mi.Vector4f, rows, first)
    way, square = mi.Vector3f(x, y, z) - ray.o, radius * radius
    along = dr.dot(way, ray.d)
    away = dr.squared_norm(way)
    return (away < square) | ((along > 0) & (away - along * along < square))


def _size(inputs: dict[str, Array], k: Array) -> Array:
    return three(inputs["mover_sizes"], k)


def _loop(kind: int, inputs: dict[str, Array], step: Callable[..., Any], *state: Array) -> tuple[Array, ...]:
    """A step for each mover of a kind."""
    end = dr.gather(mi.UInt32, inputs["mover_ends"], kind + 1)
    start = dr.gather(mi.UInt32, inputs["mover_ends"], kind)
    found: tuple[Array, ...] = dr.while_loop((start, *state), lambda k, *_: k < end, step, label="movers")
    return found


def _local_ray(ray: Array, frame: _Frame) -> Array:
    return mi.Ray3f(mi.Point3f(frame.taken(ray.o - frame.origin)), frame.taken(ray.d))
