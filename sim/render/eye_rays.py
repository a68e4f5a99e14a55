"""Generation of rays from eyes that stand upright on one body, and from free eyes, which may be anywhere.

The kernel reads four floats per world for upright eyes, and sixteen floats per eye for free eyes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import Divisor, SharedBuffer, floats, in_fours, three
from sim.scene.poses import Poses
from sim.tracing.eye_places import EyePlaces, LevelStand
from sim.tracing.eye_ray import EyeRay

EYE_ROWS = 4  # rows of four floats: the pupil, right, up and ahead


@dataclass(frozen=True)
class Counts:
    """Number of samples of an eye, and number of eyes of a world."""

    samples: Divisor
    eyes: Divisor

    @classmethod
    def from_numbers(cls, samples: int, eyes: int) -> Counts:
        """Return the numbers of samples and eyes, copied to the device."""
        return cls(Divisor.from_number(samples), Divisor.from_number(eyes))


@dataclass(frozen=True)
class Lane:
    """One lane of a kernel: a sample of an eye in a world.

    world, eye, sample: index of the world, of the eye in this world, and of the sample of this eye
    row: index of the eye among all eyes of all worlds
    """

    world: Array
    eye: Array
    sample: Array
    row: Array

    @classmethod
    def from_index(cls, index: Array, counts: Counts) -> Lane:
        """Return the lane with this index in the flat array (world, eye, sample) of all samples."""
        row = counts.samples.quotient(index)
        world = counts.eyes.quotient(row)
        return cls(world, row - world * counts.eyes.number, index - row * counts.samples.number, row)


@dataclass(frozen=True)
class Directions:
    """Directions of an eye's samples, stored on the device in rows of four floats.

    Upright eyes stand on one body that moves and turns on a level plane. Free eyes may be anywhere and may have any
    orientation.

    ways: directions of all samples. For free eyes, they are in the eye's frame. For upright eyes, they are in the
        body's frame, and the fourth float is the cosine of the angle to the eye's axis
    origins: for upright eyes, the positions of the pupils in the body's frame. For free eyes, the starting points of
        all samples in the eye's frame, or None if all samples start at the pupil
    axes: axes of upright eyes in the body's frame; None for free eyes
    """

    ways: Array
    origins: Array | None = None
    axes: Array | None = None


class EyeRays(Protocol):
    """The eyes of all worlds, and the rays that start at them."""

    def fill(self, poses: Poses) -> None:
        """Write the positions and orientations that the eyes have in these poses to the kernel's buffer."""

    def array(self) -> Array:
        """Return the buffer, on the device, from which the kernel reads what `fill` wrote."""

    def directions(self, ways: np.ndarray, origins: np.ndarray | None = None) -> Directions:
        """Return the directions of all samples on the device, in the frame that `Directions` describes.

        ways: directions of the samples in the eye's frame, array (ray, 3)
        origins: starting points of the samples in the eye's frame [m], array (ray, 3); None: all samples start at the
            pupil. For upright eyes (see `Directions`), `origins` is ignored, as if it were None
        """

    def ray(self, rows: Array, along: Directions, lane: Lane, samples: Array) -> EyeRay:
        """Return the ray of one lane of the kernel, which is one sample of one eye in one world.

        The kernel calls this method, so all arguments and the result are Dr.Jit variables on the device.

        rows: the return value of the method `array`, in rows of four floats. It contains the pose of each eye or, if
            the eyes stand upright on one body, the pose of this body in each world
        along: directions of the samples
        lane: the world, the eye and the sample of this ray
        samples: number of samples of an eye
        """


class UprightEyes:
    """Eyes on a body that moves and turns on a level plane."""

    def __init__(self, stand: LevelStand, n_envs: int) -> None:
        self._stand, self._radius = stand, stand.radius
        self._shared = SharedBuffer(n_envs * 4)
        self._rows = self._shared.values.reshape(n_envs, 4)

    def fill(self, poses: Poses) -> None:
        """See EyeRays."""
        origins, rotations = poses.frames("body", self._stand.body)
        self._rows[:, :2], self._rows[:, 2:] = origins[:, :2], rotations[:, :2, 0]

    def array(self) -> Array:
        """See EyeRays."""
        return self._shared.array

    def directions(self, ways: np.ndarray, origins: np.ndarray | None = None) -> Directions:
        """See EyeRays."""
        in_body = np.einsum("eij,rj->eri", self._stand.rotations, ways)
        pupils, axes = (in_fours(vectors, 0.0) for vectors in (self._stand.origins, self._stand.rotations[:, :, 2]))
        return Directions(floats(in_fours(in_body, ways[:, 2])), floats(pupils), floats(axes))

    def ray(self, rows: Array, along: Directions, lane: Lane, samples: Array) -> EyeRay:
        """See EyeRays."""
        x, y, cos, sin = dr.gather(mi.Vector4f, rows, lane.world)

        def turned(v: Array) -> Array:
            return mi.Vector3f(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z)

        body = mi.Point3f(x, y, self._stand.height)
        origin = body + turned(dr.gather(mi.Vector4f, along.origins, lane.eye))
        way = dr.gather(mi.Vector4f, along.ways, lane.eye * samples + lane.sample)
        if self._radius is None:
            axis = turned(dr.gather(mi.Vector4f, along.axes, lane.eye))
        else:
            axis = mi.Vector3f(origin - body) * (1 / self._radius)
        return EyeRay(mi.Ray3f(origin, turned(way)), axis, way.w, body)


class FreeEyes:
    """Eyes that may have any position and any orientation in the world."""

    def __init__(self, places: EyePlaces, n_envs: int) -> None:
        self._places = places
        self._shared = SharedBuffer(n_envs * len(places) * EYE_ROWS * 4)
        self._rows = self._shared.values.reshape(n_envs, len(places), EYE_ROWS, 4)

    def fill(self, poses: Poses) -> None:
        """See EyeRays."""
        pupils, rotations = self._places.frames(poses)
        self._rows[:, :, 0, :3], self._rows[:, :, 1:, :3] = pupils, np.swapaxes(rotations, -1, -2)

    def array(self) -> Array:
        """See EyeRays."""
        return self._shared.array

    def directions(self, ways: np.ndarray, origins: np.ndarray | None = None) -> Directions:
        """See EyeRays."""
        return Directions(floats(in_fours(ways, 0.0)), None if origins is None else floats(in_fours(origins, 0.0)))

    def ray(self, rows: Array, along: Directions, lane: Lane, samples: Array) -> EyeRay:
        """See EyeRays."""
        pupil, right, up, ahead = (three(rows, lane.row * EYE_ROWS + i) for i in range(EYE_ROWS))
        way = dr.gather(mi.Vector4f, along.ways, lane.sample)
        start = mi.Point3f(pupil)
        if along.origins is not None:
            x, y, z, _ = dr.gather(mi.Vector4f, along.origins, lane.sample)
            start += right * x + up * y + ahead * z
        ray = mi.Ray3f(start, right * way.x + up * way.y + ahead * way.z)
        return EyeRay(ray, ahead, way.z, mi.Point3f(pupil))
