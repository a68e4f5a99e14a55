"""Intersections of rays with moving geoms in the renderer's kernel: primitives in closed form, meshes by Mitsuba.

Rays are transformed to the frame of each geom. When a mesh moves, its Mitsuba scene (`sim.tracing.mesh_atlas`) is not
rebuilt. On a GPU, a separate kernel intersects all moving geoms if any of them is a mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene import shapes
from sim.scene.appearances import Appearance
from sim.scene.device_arrays import whole_numbers
from sim.scene.poses import Poses
from sim.scene.primitive_geoms import PLANE, REACH, kind_of
from sim.scene.variant import MitsubaObject, computed, on_gpu
from sim.tracing.mesh_atlas import MeshAtlas
from sim.tracing.primitives import PRIMITIVES, Primitive
from sim.tracing.world_rows import WorldRows

_TYPES = mujoco.mjtGeom
# Rows of four floats for each mover: a sphere around its origin, then three times an axis of its frame in the world,
# followed by one of its sizes. The sizes of a mesh are the centre of its cell in the atlas.
ROWS = 4
MESH = "mesh"


@dataclass(frozen=True)
class Hit:
    """First hit of a ray. Without a hit, `t` is `farthest` (see `Movers.nearest`), and `which` is len(Movers).

    t, which: distance of the hit from the ray's origin [m], and index in `Movers` of the geom that is hit
    normal, uv: normal (a unit vector in the world's frame), and texture coordinates (only for meshes and planes)
    """

    t: Array
    which: Array
    normal: Array
    uv: Array


@dataclass(frozen=True)
class _Frame:
    """Frame and size of one moving geom. For a mesh, `size` is its position in the `MeshAtlas` instead.

    axes, origin: the frame's three axes (Vector3f each) and its origin (Vector3f), in the world's frame
    size, reach: half of the size along each axis, and largest distance from the origin to the geom's surface [m]
    """

    axes: tuple[Array, Array, Array]
    origin: Array
    size: Array
    reach: Array

    def to_mover(self, v: Array) -> Array:
        """Convert a direction from the world's frame to the frame of the moving geom."""
        return mi.Vector3f(*(dr.dot(axis, v) for axis in self.axes))

    def to_world(self, v: Array) -> Array:
        """Convert a direction from the frame of the moving geom to the world's frame."""
        return self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z


@dataclass(frozen=True)
class MoverRows(WorldRows):
    """Places and sizes of moving geoms in one world. Geoms of kind i have the indices ends[i] to ends[i + 1] - 1."""

    ends: Array


class Movers:
    """The "movers": each moving geom once for each material that it may have. They are sorted by kind, meshes last.

    looks, geoms: appearance and geom id of each mover
    atlas, bsdf: Mitsuba's scene of the moving meshes, and a BSDF for the shapes in it, which has no effect on light
    lifts: for geoms that coincide with others, by geom id: distance [m] by which the surface is moved outwards
    ends: array, read by the kernel, of the index of the first mover of each kind, followed by the number of movers
    """

    def __init__(
        self, model: mujoco.MjModel, looks: Sequence[Appearance], lifts: Mapping[int, float], bsdf: MitsubaObject
    ) -> None:
        kinds = [*PRIMITIVES, MESH]
        by_kind = [[look for look in looks if (kind_of(look.model, look.geom) or MESH) == kind] for kind in kinds]
        self._ends = np.cumsum([0, *map(len, by_kind)])
        self.ends = whole_numbers(self._ends)
        self.looks = [look for group in by_kind for look in group]
        self.geoms = np.array([look.geom for look in self.looks], int)
        self._materials = np.array([look.material for look in self.looks], int)
        self._drawn, self._as_built = np.array([look.drawn for look in self.looks], bool), model.geom_matid[None].copy()
        self._sizes, self._types = model.geom_size[self.geoms].copy(), model.geom_type[self.geoms]
        planes = [shapes.plane_sides(model, geom) for geom in self.geoms[self._of_kind(PLANE)]]
        self._sizes[self._of_kind(PLANE), :2] = np.reshape(planes, (-1, 2))
        reach = self._mesh_reach = model.geom_rbound[self.geoms[self._of_kind(MESH)]]
        lift = np.array([lifts.get(geom, 0.0) for geom in self.geoms.tolist()])
        grown = [shapes.lifted_size(*pair) for pair in zip(self._types, lift, strict=True)]
        self._grown = np.array(grown).reshape(-1, 3)
        self._raised = np.where(self._types == _TYPES.mjGEOM_PLANE, lift, 0)[:, None]
        parts = [shapes.parts(look.model, look.geom, lifts.get(look.geom, 0.0)) for look in by_kind[-1]]
        self.atlas = MeshAtlas.from_parts(parts, reach, bsdf)
        self._sizes[self._of_kind(MESH)] = self.atlas.cells
        self._known: tuple[bytes, np.ndarray, np.ndarray] | None = None  # extents of the last poses

    def _of_kind(self, kind: str) -> slice:
        """Return the indices in `Movers` of the geoms of one kind."""
        i = [*PRIMITIVES, MESH].index(kind)
        return slice(int(self._ends[i]), int(self._ends[i + 1]))

    def __len__(self) -> int:
        return len(self.geoms)

    @property
    def apart(self) -> bool:
        """True if a kernel of its own intersects the moving geoms: on a GPU, if any moving geom is a mesh."""
        return self.atlas.scene is not None and on_gpu()

    @property
    def n_rows(self) -> int:
        """Number of rows of four floats that describe the moving geoms of one world."""
        return 1 + ROWS * len(self)

    def rows(self, poses: Poses) -> np.ndarray:
        """Return a sphere around all moving geoms, then each mover's frame and size, (world, 4 · `n_rows`) float32."""
        rows = np.zeros((poses.n, self.n_rows, 4), np.float32)
        if len(self):
            places, (sizes, reach) = poses.geom_places(self.geoms), self._extents(poses)
            absent = self._absent(poses)
            if absent is not None:
                reach = np.where(absent, 0, reach)
            turns = poses.geom_turns(self.geoms)
            places = places + self._raised * turns[..., 2]
            rows[:, 0, :3] = centre = places.mean(axis=1)
            rows[:, 0, 3] = (np.linalg.norm(places - centre[:, None], axis=-1) + reach).max(axis=1)
            each = rows[:, 1:].reshape(poses.n, len(self), ROWS, 4)
            each[:, :, 0, :3], each[:, :, 0, 3] = places, reach
            each[:, :, 1:, :3] = np.swapaxes(turns, -1, -2)
            each[:, :, 1:, 3] = sizes
            if absent is not None:
                each[:, :, 0, :3] += np.where(absent, np.nan, 0)[..., None]  # NaN: rays miss it
        return rows.reshape(poses.n, -1)

    def _absent(self, poses: Poses) -> np.ndarray | None:
        """Return where a geom's material is not its mover's, (world or 1, mover); None if no geom's material varies."""
        if not self._drawn.any():
            return None
        here = self._as_built if poses.geom_matid is None else poses.geom_matid
        absent: np.ndarray = self._drawn & (here[:, self.geoms] != self._materials)
        return absent

    def _extents(self, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        """Return half sizes (world, mover, 3) and bounding radii (world, mover) [m]; one world if all are alike."""
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
        sizes = sizes + self._grown
        fixed = slice(self._of_kind(PLANE).start, None)  # planes and meshes, which come last
        sizes[:, fixed] = self._sizes[fixed]
        reach = np.zeros(sizes.shape[:2])
        for kind, how_far in REACH.items():
            mine = self._types == kind
            reach[:, mine] = how_far(sizes[:, mine])
        reach[:, self._of_kind(MESH)] = self._mesh_reach
        return sizes, reach

    def nearest(self, ray: Array, farthest: Array, there: MoverRows) -> Hit:
        """Return the first hit of a ray at a distance less than `farthest` [m], see `Hit`."""
        none = farthest, mi.UInt32(len(self)), mi.Vector3f(0, 0, 1), mi.Point2f(0)
        if not len(self):
            return Hit(*none)
        if self.apart:
            computed(ray, farthest, there.fours, there.first)
            found = self._nearest(ray, farthest, there)
            computed(found)
            return Hit(*found)
        near = _may_hit(ray, there, 0)
        found = dr.if_stmt((), near, lambda: self._nearest(ray, farthest, there), lambda: none)
        return Hit(*found)

    def block(self, ray: Array, farthest: Array, there: MoverRows) -> Array:
        """Return whether a ray hits at least one moving geom at a distance less than `farthest` [m]."""
        if self.apart:
            computed(ray, farthest, there.fours, there.first)
            blocked = self._block(ray, farthest, there)
            computed(blocked)
            return blocked
        near = _may_hit(ray, there, 0) & (farthest > 0)
        return dr.if_stmt((), near, lambda: self._block(ray, farthest, there), lambda: mi.Bool(False))

    def _nearest(self, ray: Array, farthest: Array, there: MoverRows) -> tuple[Array, ...]:
        t, which = farthest, mi.UInt32(len(self))
        for i, hit in self._kinds():

            def step(k: Array, t: Array, which: Array, hit: Callable[..., Array] = hit) -> tuple[Array, ...]:
                found = _distance_to(hit, ray, there, k)
                nearer = found < t
                return k + 1, dr.select(nearer, found, t), dr.select(nearer, k, which)

            _, t, which = _loop(i, there, step, t, which)
        normal, uv = self._surface(ray, t, which, there)
        return t, which, normal, uv

    def _block(self, ray: Array, farthest: Array, there: MoverRows) -> Array:
        blocked = mi.Bool(False)
        for i, hit in self._kinds():

            def step(k: Array, blocked: Array, hit: Callable[..., Array] = hit) -> tuple[Array, ...]:
                return k + 1, blocked | (_distance_to(hit, ray, there, k) < farthest)

            _, blocked = _loop(i, there, step, blocked)
        return blocked

    def _kinds(self) -> list[tuple[int, Callable[..., Array]]]:
        """Return the index and the intersection function of each kind of geom that is among the moving geoms."""
        hits = [*(_of_primitive(primitive) for primitive in PRIMITIVES.values()), self._mesh_hit]
        return [(i, hit) for i, hit in enumerate(hits) if self._ends[i] < self._ends[i + 1]]

    def _mesh_hit(self, o: Array, d: Array, frame: _Frame) -> Array:
        return self.atlas.hit(o, d, frame.size, frame.reach)

    def _surface(self, ray: Array, t: Array, which: Array, there: MoverRows) -> tuple[Array, Array]:
        """Return the normal, in the world's frame, and the texture coordinates at each hit."""
        k = dr.minimum(which, len(self) - 1)
        frame = _frame(there, k)
        o, d = frame.to_mover(ray.o - frame.origin), frame.to_mover(ray.d)
        local = frame.to_mover(ray(dr.select(which < len(self), t, 0)) - frame.origin)
        normal, uv = mi.Vector3f(0, 0, 1), mi.Point2f(0)
        for i, (kind, primitive) in enumerate(PRIMITIVES.items()):
            if self._ends[i] < self._ends[i + 1]:
                mine = self._is_kind(i, which, there)
                normal = dr.select(mine, primitive.normal(local, frame.size), normal)
                if kind == PLANE:
                    on_plane = mi.Point2f(local.x / frame.size.x, local.y / frame.size.y)
                    uv = dr.select(mine, dr.fma(on_plane, 0.5, 0.5), uv)
        if self.atlas.scene is not None:
            mine = self._is_kind(len(PRIMITIVES), which, there)
            of_mesh = self.atlas.surface(o, d, frame.size, frame.reach, mine)
            normal, uv = dr.select(mine, of_mesh[0], normal), dr.select(mine, of_mesh[1], uv)
        return dr.normalize(frame.to_world(normal)), uv

    @staticmethod
    def _is_kind(i: int, which: Array, there: MoverRows) -> Array:
        return (which >= dr.gather(mi.UInt32, there.ends, i)) & (which < dr.gather(mi.UInt32, there.ends, i + 1))


def _of_primitive(primitive: Primitive) -> Callable[..., Array]:
    return lambda o, d, frame: primitive.hit(o, d, frame.size)


def _distance_to(hit: Callable[..., Array], ray: Array, there: MoverRows, k: Array) -> Array:
    """Return the distance along a ray to moving geom k [m]; infinite for a miss, or if the geom's origin is NaN."""

    # A branch skips the intersection for rays that miss the sphere around the mover, as most rays do.
    def within() -> Array:
        frame = _frame(there, k)
        return hit(frame.to_mover(ray.o - frame.origin), frame.to_mover(ray.d), frame)

    found: Array = dr.if_stmt((), _may_hit(ray, there, 1 + k * ROWS), within, lambda: mi.Float(dr.inf))
    return found


def _frame(there: MoverRows, k: Array) -> _Frame:
    """Return the frame and the size of moving geom k."""
    x, y, z, reach = there.four(1 + k * ROWS)
    fours = [list(there.four(1 + k * ROWS + i)) for i in range(1, ROWS)]
    a, b, c = (mi.Vector3f(*four[:3]) for four in fours)
    return _Frame((a, b, c), mi.Vector3f(x, y, z), mi.Vector3f(*(four[3] for four in fours)), reach)


def _may_hit(ray: Array, there: MoverRows, row: Array | int) -> Array:
    """Return whether a ray hits the sphere in this row, which encloses all moving geoms (row 0) or one of them."""
    x, y, z, radius = there.four(row)
    way, square = mi.Vector3f(x, y, z) - ray.o, radius * radius
    along = dr.dot(way, ray.d)
    aside = way - along * ray.d  # a difference of squares would lose small, distant spheres
    return (dr.squared_norm(way) < square) | ((along > 0) & (dr.squared_norm(aside) < square))


def _loop(kind: int, there: MoverRows, step: Callable[..., Any], *state: Array) -> tuple[Array, ...]:
    """Run a step for each moving geom of a kind; return the index of the last one plus 1, and the last state."""
    start, end = (dr.gather(mi.UInt32, there.ends, kind + i) for i in (0, 1))
    found: tuple[Array, ...] = dr.while_loop((start, *state), lambda k, *_: k < end, step, label="movers")
    return found
