"""Intersections of rays with moving geoms in the renderer's kernel: primitives in closed form, meshes by Mitsuba.

Each mesh has its own scene in the geom's frame, and rays are transformed to this frame. When a mesh moves, its scene is
not rebuilt. On a GPU, each mesh is intersected in a separate kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.appearances import Appearance
from sim.scene.device_arrays import whole_numbers
from sim.scene.poses import Poses
from sim.scene.primitive_geoms import kind_of
from sim.scene.variant import MitsubaObject, computed, on_gpu
from sim.tracing.primitives import PRIMITIVES, Primitive
from sim.tracing.world_rows import WorldRows

_TYPES = mujoco.mjtGeom
# Rows of four floats for each mover: a sphere around its origin; then, three times, an axis of its frame in the world
# and one of its sizes.
ROWS = 4
MESHES = 32  # largest number of meshes; on a CPU all of them are scenes in one kernel
# Largest distance of a geom's surface from its origin [m] as a function of the half sizes (..., 3), for each kind.
_REACH: dict[mujoco.mjtGeom, Callable[[np.ndarray], np.ndarray]] = {
    _TYPES.mjGEOM_SPHERE: lambda size: size[..., 0],
    _TYPES.mjGEOM_ELLIPSOID: lambda size: size.max(axis=-1),
    _TYPES.mjGEOM_CAPSULE: lambda size: size[..., 0] + size[..., 1],
    _TYPES.mjGEOM_CYLINDER: lambda size: np.hypot(size[..., 0], size[..., 1]),
    _TYPES.mjGEOM_BOX: lambda size: np.linalg.norm(size, axis=-1),
}


@dataclass(frozen=True)
class Hit:
    """First hit of a ray. t: distance [m], infinite without a hit · which: number of the mover · normal: unit vector in
    the world · uv: texture coordinates of meshes."""

    t: Array
    which: Array
    normal: Array
    uv: Array


@dataclass(frozen=True)
class _Frame:
    """A mover's frame. axes: its axes in the world (3 Vector3f) · origin: its origin in the world (Vector3f)."""

    axes: tuple[Array, Array, Array]
    origin: Array

    def taken(self, v: Array) -> Array:
        """Return a direction of the world in the mover's frame."""
        return mi.Vector3f(*(dr.dot(axis, v) for axis in self.axes))

    def given(self, v: Array) -> Array:
        """Return a direction of the mover's frame in the world."""
        return self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z


@dataclass(frozen=True)
class MoverRows(WorldRows):
    """Rows of one world: a sphere around all movers, then ROWS rows for each mover. ends: see `Movers`."""

    ends: Array


class Movers:
    """The moving geoms of a model, primitives first, by kind. A geom with drawn materials has a mover per appearance.

    looks: appearance of each mover · geoms: geom id of each mover, (mover,) · n_primitives: number of primitives
    resizable: ids of geoms whose sizes may differ between worlds: geoms that are primitives in all their appearances
    meshes: Mitsuba scenes of the other movers
    ends: number of the first mover of each kind, for the kernel

    Raises:
        ValueError: more than MESHES meshes.
    """

    def __init__(
        self, model: mujoco.MjModel, looks: Sequence[Appearance], meshes: dict[Appearance, MitsubaObject]
    ) -> None:
        if len(meshes) > MESHES:
            raise ValueError(f"the model has {len(meshes)} moving meshes: must be at most {MESHES}; hide some by group")
        closed = [look for look in looks if look not in meshes]
        by_kind = {name: [each for each in closed if kind_of(each.model, each.geom) == name] for name in PRIMITIVES}
        primitives = [look for group in by_kind.values() for look in group]
        self.looks, self.n_primitives = [*primitives, *meshes], len(primitives)
        self.geoms = np.array([look.geom for look in self.looks], int)
        self.resizable = np.setdiff1d(self.geoms[: self.n_primitives], self.geoms[self.n_primitives :])
        self._materials = np.array([look.material for look in self.looks], int)
        self._drawn, self._as_built = np.array([look.drawn for look in self.looks], bool), model.geom_matid[None].copy()
        self.meshes = list(meshes.values())
        self._sizes = model.geom_size[self.geoms].copy()
        self._types = model.geom_type[self.geoms]
        # Reach of meshes from their origins [m]; a plane is infinite.
        self._mesh_reach = np.where(self._types == _TYPES.mjGEOM_PLANE, np.inf, model.geom_rbound[self.geoms])
        self._known: tuple[bytes, np.ndarray, np.ndarray] | None = None  # extents of the last poses
        self._ends = np.cumsum([0, *(len(group) for group in by_kind.values())])
        self.ends = whole_numbers(self._ends)

    def __len__(self) -> int:
        return len(self.geoms)

    @property
    def apart(self) -> bool:
        """True if each mesh is intersected in its own kernel, which no branch can contain: see `computed`."""
        return bool(self.meshes) and on_gpu()

    @property
    def n_rows(self) -> int:
        """Number of rows of four floats in one world."""
        return 1 + ROWS * len(self)

    def rows(self, poses: Poses) -> np.ndarray:
        """Return the kernel's rows: a sphere around all movers, then each mover, (world, 4 n_rows) float32."""
        rows = np.zeros((poses.n, self.n_rows, 4), np.float32)
        if len(self):
            places, (sizes, reach) = poses.geom_places(self.geoms), self._extents(poses)
            absent = self._absent(poses)
            if absent is not None:
                reach = np.where(absent, 0, reach)
            rows[:, 0, :3] = centre = places.mean(axis=1)
            rows[:, 0, 3] = (np.linalg.norm(places - centre[:, None], axis=-1) + reach).max(axis=1)
            each = rows[:, 1:].reshape(poses.n, len(self), ROWS, 4)
            each[:, :, 0, :3], each[:, :, 0, 3] = places, reach
            each[:, :, 1:, :3] = np.swapaxes(poses.geom_turns(self.geoms), -1, -2)
            each[:, :, 1:, 3] = sizes
            if absent is not None:
                each[:, :, 0, :3] += np.where(absent, np.nan, 0)[..., None]  # NaN: rays miss it
        return rows.reshape(poses.n, -1)

    def _absent(self, poses: Poses) -> np.ndarray | None:
        """Return a mask of the appearances that a world does not show, (world or 1, mover); None if all worlds show
        all."""
        if not self._drawn.any():
            return None
        here = self._as_built if poses.geom_matid is None else poses.geom_matid
        absent: np.ndarray = self._drawn & (here[:, self.geoms] != self._materials)
        return absent

    def _extents(self, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        """Return the movers' half sizes (world or 1, mover, 3), a sphere's radius three times, and the largest distance
        of each mover's surface from its origin [m], (world or 1, mover)."""
        if poses.geom_size is None:
            sizes = self._sizes[None].copy()
        else:
            alike = poses.geom_size.strides[0] == 0  # one model for all worlds
            sizes = poses.geom_size[: 1 if alike else None, self.geoms]
        asked = sizes.tobytes()
        if self._known is None or self._known[0] != asked:
            self._known = asked, *self._with_reach(sizes)
        return self._known[1:]

    def _with_reach(self, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        balls = self._types == _TYPES.mjGEOM_SPHERE
        sizes[:, balls] = sizes[:, balls, :1]
        reach = np.broadcast_to(self._mesh_reach, sizes.shape[:2]).copy()
        for kind, how_far in _REACH.items():
            mine = self._types[: self.n_primitives] == kind
            reach[:, : self.n_primitives][:, mine] = how_far(sizes[:, : self.n_primitives][:, mine])
        return sizes, reach

    def nearest(self, ray: Array, farthest: Array, there: MoverRows) -> Hit:
        """Return the first hit of a ray that is nearer than `farthest`."""
        none = farthest, mi.UInt32(len(self)), mi.Vector3f(0, 0, 1), mi.Point2f(0)
        if not len(self):
            return Hit(*none)
        if self.apart:
            computed(ray, farthest, there.fours, there.first)
            return Hit(*self._nearest(ray, farthest, there))
        near = _may_meet(ray, there, 0)
        found = dr.if_stmt((), near, lambda: self._nearest(ray, farthest, there), lambda: none)
        return Hit(*found)

    def block(self, ray: Array, farthest: Array, there: MoverRows) -> Array:
        """Return whether any mover blocks a ray at a distance less than `farthest`."""
        if self.apart:
            computed(ray, farthest, there.fours, there.first)
            return self._block(ray, farthest, there)
        near = _may_meet(ray, there, 0) & (farthest > 0)
        return dr.if_stmt((), near, lambda: self._block(ray, farthest, there), lambda: mi.Bool(False))

    def _nearest(self, ray: Array, farthest: Array, there: MoverRows) -> tuple[Array, ...]:
        t, which = farthest, mi.UInt32(len(self))
        for i, primitive in self._kinds():

            def step(k: Array, t: Array, which: Array, hit: Callable[..., Array] = primitive.hit) -> tuple[Array, ...]:
                found = _met(hit, ray, there, k)
                nearer = found < t
                return k + 1, dr.select(nearer, found, t), dr.select(nearer, k, which)

            _, t, which = _loop(i, there, step, t, which)
        uv = mi.Point2f(0)
        normal = self._normals(ray(dr.select(which < len(self), t, 0)), which, there)
        for m, scene in enumerate(self.meshes):
            computed(t, which, normal, uv)
            k = self.n_primitives + m
            frame, _ = _frame(there, mi.UInt32(k))
            si = scene.ray_intersect(_local_ray(ray, frame), mi.RayFlags.All, True, self._is_there(k, frame))
            nearer = si.is_valid() & (si.t < t)
            t, which = dr.select(nearer, si.t, t), dr.select(nearer, k, which)
            normal = dr.select(nearer, frame.given(mi.Vector3f(si.sh_frame.n)), normal)
            uv = dr.select(nearer, si.uv, uv)
        if self.apart:
            computed(t, which, normal, uv)
        return t, which, normal, uv

    def _block(self, ray: Array, farthest: Array, there: MoverRows) -> Array:
        blocked = mi.Bool(False)
        for i, primitive in self._kinds():

            def step(k: Array, blocked: Array, hit: Callable[..., Array] = primitive.hit) -> tuple[Array, ...]:
                return k + 1, blocked | (_met(hit, ray, there, k) < farthest)

            _, blocked = _loop(i, there, step, blocked)
        for m, scene in enumerate(self.meshes):
            computed(blocked)
            k = self.n_primitives + m
            frame, _ = _frame(there, mi.UInt32(k))
            local = _local_ray(ray, frame)
            local.maxt = farthest
            blocked |= scene.ray_test(local, ~blocked & self._is_there(k, frame))
        if self.apart:
            computed(blocked)
        return blocked

    def _is_there(self, k: int, frame: _Frame) -> Array | bool:
        """Return whether a world shows mover k. The origin of an absent mover is NaN, for which Embree's and OptiX's
        results are undefined."""
        return ~dr.isnan(frame.origin.x) if self._drawn[k] else True

    def _kinds(self) -> list[tuple[int, Primitive]]:
        """Return the kinds of primitives that occur, with their numbers."""
        return [(i, p) for i, p in enumerate(PRIMITIVES.values()) if self._ends[i] < self._ends[i + 1]]

    def _normals(self, point: Array, which: Array, there: MoverRows) -> Array:
        """Return the normals of primitives at points on them."""
        k = dr.minimum(which, max(self.n_primitives - 1, 0))
        frame, size = _frame(there, k)
        local = frame.taken(point - frame.origin)
        normal = mi.Vector3f(0, 0, 1)
        for i, primitive in self._kinds():
            mine = (k >= dr.gather(mi.UInt32, there.ends, i)) & (k < dr.gather(mi.UInt32, there.ends, i + 1))
            normal = dr.select(mine, primitive.normal(local, size), normal)
        return dr.normalize(frame.given(normal))


def _met(hit: Callable[..., Array], ray: Array, there: MoverRows, k: Array) -> Array:
    """Return the distance to mover k along a ray [m]. A branch skips the intersection if a ray misses the sphere around
    the mover, as most rays and their neighbours do."""

    def within() -> Array:
        frame, size = _frame(there, k)
        return hit(frame.taken(ray.o - frame.origin), frame.taken(ray.d), size)

    found: Array = dr.if_stmt((), _may_meet(ray, there, 1 + k * ROWS), within, lambda: mi.Float(dr.inf))
    return found


def _frame(there: MoverRows, k: Array) -> tuple[_Frame, Array]:
    """Return the frame of a mover, and its half sizes."""
    fours = [list(there.four(1 + k * ROWS + i)) for i in range(1, ROWS)]
    a, b, c = (mi.Vector3f(*four[:3]) for four in fours)
    return _Frame((a, b, c), there.point(1 + k * ROWS)), mi.Vector3f(*(four[3] for four in fours))


def _may_meet(ray: Array, there: MoverRows, row: Array | int) -> Array:
    """Return whether a ray hits the sphere of this row."""
    x, y, z, radius = there.four(row)
    way, square = mi.Vector3f(x, y, z) - ray.o, radius * radius
    along = dr.dot(way, ray.d)
    aside = way - along * ray.d  # a difference of squares would lose small, distant spheres
    return (dr.squared_norm(way) < square) | ((along > 0) & (dr.squared_norm(aside) < square))


def _loop(kind: int, there: MoverRows, step: Callable[..., Any], *state: Array) -> tuple[Array, ...]:
    """Run a step for each mover of a kind."""
    end = dr.gather(mi.UInt32, there.ends, kind + 1)
    start = dr.gather(mi.UInt32, there.ends, kind)
    found: tuple[Array, ...] = dr.while_loop((start, *state), lambda k, *_: k < end, step, label="movers")
    return found


def _local_ray(ray: Array, frame: _Frame) -> Array:
    return mi.Ray3f(mi.Point3f(frame.taken(ray.o - frame.origin)), frame.taken(ray.d))
