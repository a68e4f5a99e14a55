"""Intersections of rays with moving spheres, in closed form inside the renderer's kernel.

When a shape of a Mitsuba scene moves, Mitsuba rebuilds the scene's acceleration structure. For a few spheres per world,
closed forms are cheaper. Mitsuba and MuJoCo have the same texture coordinates on a sphere: u = azimuth / 2π, v = polar
angle / π from +z, both in the sphere's own frame. The closed-form tracer uses this module. Here, a ray may start inside
a sphere. The tracer for all other models uses `sim.tracing.primitives`, whose shapes are hit only from outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import SharedBuffer, three
from sim.scene.poses import Poses
from sim.scene.variant import MitsubaObject

TURNED = 1e-6  # smallest change of a rotation that is not a rounding error


@dataclass(frozen=True)
class Spheres:
    """The moving spheres of a scene; only their positions differ between worlds.

    radii: radii [m], (k,)
    frames: rotation from each sphere's frame to the world's, (k, 3, 3)
    textured: True for spheres with a texture, (k,)
    names: names of the geoms
    bsdfs: one Mitsuba BSDF per sphere; stored here, because a BSDFPtr does not keep its objects alive
    geoms: ids of the geoms, (k,)
    """

    radii: np.ndarray
    frames: np.ndarray
    textured: np.ndarray
    names: tuple[str, ...]
    bsdfs: tuple[MitsubaObject, ...]
    geoms: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.radii)


class SphereRows:
    """Buffer for the centres of spheres in `n_envs` worlds, in rows of four floats, which kernels read."""

    def __init__(self, spheres: Spheres, n_envs: int) -> None:
        self._spheres = spheres
        self._shared = SharedBuffer(n_envs * max(len(spheres), 1) * 4)
        self._rows = self._shared.values.reshape(n_envs, -1, 4)
        textured = np.flatnonzero(spheres.textured)
        self._textured = tuple(spheres.geoms[k] for k in textured)
        self._frames, self._names = spheres.frames[textured], [spheres.names[k] for k in textured]
        self._checked: np.ndarray | None = None  # the last rotations without an error

    def fill(self, poses: Poses) -> None:
        """Write the centres of the spheres in all worlds, for these poses, into the buffer.

        Raises:
            ValueError: the orientation of a sphere with a texture differs from the one in `Spheres.frames`.
        """
        if len(self._spheres):
            self._rows[..., :3] = poses.geom_places(self._spheres.geoms)
        if self._textured and (turns := poses.geom_turns(self._textured)) is not self._checked:
            self._refuse_turned(turns)
            self._checked = turns

    def _refuse_turned(self, turns: np.ndarray) -> None:
        off = np.abs(turns - self._frames)
        if off.max() > TURNED:
            name = self._names[int(off.max(axis=(0, 2, 3)).argmax())]
            raise ValueError(
                f"geom {name!r} has a texture and has turned; closed forms do not turn textures: must be rendered with "
                "tracer = 'mitsuba'"
            )

    def arrays(self) -> Array:
        """Return the centres as an array on the device."""
        return self._shared.array


def centres_in(rows: Array, n: int, world: Array) -> list[Array]:
    """Return the centres of n spheres in the world of each ray.

    rows: the result of `SphereRows.arrays`
    world: index of each ray's world
    """
    first = world * n
    return [mi.Point3f(three(rows, first + k)) for k in range(n)]


def nearest(spheres: Spheres, centres: list[Array], ray: Array, t: Array) -> tuple[Array, Array]:
    """Return the distance [m] to the first sphere that a ray hits closer than `t`, and the index of this sphere.

    Without such a hit, they are `t` and len(spheres). If there are fewer centres than spheres, the last spheres are
    ignored.
    """
    which = mi.UInt32(len(spheres))
    for k, centre in enumerate(centres):
        b, c = _quadratic(ray, centre, float(spheres.radii[k]))
        discriminant = b * b - c
        root = dr.sqrt(dr.maximum(discriminant, 0))
        # If the ray starts inside (c < 0), the far side is visible.
        t_k = dr.select(c < 0, root - b, -b - root)
        hit = (discriminant > 0) & (t_k > 0) & (t_k < t)
        t = dr.select(hit, t_k, t)
        which = dr.select(hit, k, which)
    return t, which


def blocks(radii: list[float], centres: list[Array], ray: Array) -> Array:
    """Return whether any sphere lies on the ray ahead of the ray's origin, or contains the origin."""
    blocked = mi.Bool(False)
    for radius, centre in zip(radii, centres, strict=True):
        b, c = _quadratic(ray, centre, radius)
        blocked |= (c < 0) | ((b < 0) & (b * b > c))
    return blocked


def surface_at(spheres: Spheres, centres: list[Array], which: Array, hit: Array) -> tuple[Array, Array, Array]:
    """Return the point of a sphere's surface that is nearest to a hit, the outward normal and the texture coordinates.

    The point replaces the computed hit point, which rounding may place inside a distant sphere, where the sphere would
    shade itself. Without a hit, the results have no meaning.

    which, hit: index of the sphere that each ray hits, and the computed hit point
    """
    centre, radius = centres[0], mi.Float(float(spheres.radii[0]))
    for k, other in enumerate(centres[1:], 1):
        centre = dr.select(which == k, other, centre)
        radius = dr.select(which == k, float(spheres.radii[k]), radius)
    normal = dr.normalize(hit - centre)
    local = _to_local(spheres, 0) @ normal
    for k in range(1, len(centres)):
        if (spheres.frames[k] != spheres.frames[0]).any():
            local = dr.select(which == k, _to_local(spheres, k) @ normal, local)
    u = dr.atan2(local.y, local.x) * dr.inv_two_pi
    v = dr.safe_acos(local.z) * dr.inv_pi
    return centre + normal * radius, mi.Normal3f(normal), mi.Point2f(dr.select(u < 0, u + 1, u), v)


def _to_local(spheres: Spheres, k: int) -> Array:
    """Return the rotation from the world's frame to that of sphere k."""
    return mi.Matrix3f(spheres.frames[k].T.tolist())


def _quadratic(ray: Array, centre: Array, radius: float) -> tuple[Array, Array]:
    """Return b and c of the equation t² + 2 b t + c = 0 for the distances t at which a ray crosses a sphere."""
    from_centre = ray.o - centre
    return dr.dot(from_centre, ray.d), dr.squared_norm(from_centre) - radius * radius
