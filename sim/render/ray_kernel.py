"""The kernel of `EyeRenderer`: it generates a ray per lane, traces it, and sums its light per depth layer.

Each lane is a sample of an eye in a world.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.sensor import Facets
from sim.render.eye_rays import Counts, Directions, EyeRays, Lane
from sim.scene.device_arrays import counted, floats, one_number
from sim.scene.frozen_kernels import GarbageKept
from sim.scene.poses import Poses
from sim.scene.variant import on_gpu, variant
from sim.tracing import lighting
from sim.tracing.eye_ray import EyeRay
from sim.tracing.tracer import Buffers, Tracer

SECOND = 3  # seed of the samples for a second reflection


@dataclass(frozen=True)
class KernelInputs:
    """Inputs of a kernel that are the same in every call.

    lanes: index of each lane
    counts: number of samples of an eye, and number of eyes of a world
    total: number of lanes
    along: directions of the samples
    tables: the tracer's inputs
    bounces: four numbers per sample, from which the directions of bounced light are computed; None: direct light only
    weights: weight of each sample's components, in rows of four floats; None: all weights are 1
    """

    lanes: Array
    counts: Counts
    total: Array
    along: Directions
    tables: Any
    bounces: Array | None = None
    weights: Array | None = None


@dataclass(frozen=True)
class Frame:
    """Inputs of a kernel that change from moment to moment: the poses in all worlds.

    eyes: buffer with the positions and orientations of the eyes, see `EyeRays.array`
    things: values that the tracer reads and that differ between worlds, such as positions of moving geoms, see
        `sim.tracing.tracer.Buffers`
    """

    eyes: Array
    things: Any


class Moving:
    """Buffers from which a kernel reads the poses in all worlds. Its other inputs are the same in every call."""

    def __init__(self, eyes: EyeRays, things: Buffers) -> None:
        self._eyes, self._things = eyes, things
        self._frame: Frame | None = None

    def fill(self, poses: Poses) -> None:
        """Write the poses of all worlds to the buffers that the kernel reads.

        One buffer is for the eyes. The others are for the scene's values that differ between worlds.
        """
        self._eyes.fill(poses)
        self._things.fill(poses)

    def frame(self) -> Frame:
        """Return the buffers as arrays on the device.

        On the processor, the arrays share the buffers' memory, so every call returns the same object.
        """
        if self._frame is None or on_gpu():
            self._frame = Frame(self._eyes.array(), self._things.arrays())
        return self._frame


class RayKernel:
    """A kernel that traces rays. Its body is recorded once, so only arrays that are passed to it may change.

    tracer: tracer that intersects the rays and computes their light
    eyes: eyes at which the rays start
    n_envs, n_eyes: numbers of worlds, and of eyes in each world
    depth: depth layers, which are distances for which the eye has a PSF. The light of a ray is divided between the two
        layers next to the distance of the visible surface
    """

    def __init__(self, tracer: Tracer, eyes: EyeRays, n_envs: int, n_eyes: int, depth: DepthLayers) -> None:
        self.tracer, self.eyes, self.n_envs, self.n_eyes, self.depth = tracer, eyes, n_envs, n_eyes, depth

    def inputs(self, ways: np.ndarray, bounces: np.ndarray | None = None, facets: Facets | None = None) -> KernelInputs:
        """Return the inputs for these samples of every eye.

        The samples are inputs and not constants, so that eyes of any resolution and field of view, in any number of
        worlds, share a kernel.

        ways: directions of the samples in the eye's frame, (ray, 3)
        bounces: points in the unit square, from which the directions of bounced light are computed, (ray, 2); None:
            direct light only
        facets: weights and starting points of the samples; None: all weights are 1, and samples start at the pupil
        """
        lanes = self.n_envs * self.n_eyes * len(ways)
        more = None
        if bounces is not None and self.tracer.light == lighting.BOUNCE:
            second = np.random.default_rng(SECOND).random(bounces.shape)
            more = floats(np.concatenate([bounces, second], axis=1))
        counts = Counts.from_numbers(len(ways), self.n_eyes)
        origins, weights = (None, None) if facets is None else (facets.origins, facets.weights)
        if weights is not None:
            weights = floats(np.pad(weights, ((0, 0), (0, -weights.shape[1] % 4))))
        along = self.eyes.directions(ways, origins)
        return KernelInputs(counted(lanes), counts, one_number(lanes), along, self.tracer.inputs, more, weights)

    def sums(self, scenes: Any, frame: Frame, inputs: KernelInputs, lanes: int, reduced: int) -> Array:
        """Return sums of the light over groups of `reduced` adjacent lanes.

        Each lane traces one ray, from one eye in one world. The light of a ray has several components, for example one
        per spectral band. The sums are a flat array with the axes (layer, component, world, eye, group of lanes).

        lanes: total number of lanes
        """
        layers = self.layers(scenes, frame, inputs)
        if len(layers) == 1:
            out = layers[0]
        else:
            out = dr.zeros(mi.Float, lanes * len(layers))
            for k, value in enumerate(layers):
                dr.scatter(out, value, inputs.lanes + k * inputs.total, mode=dr.ReduceMode.Permute)
        # A single reduction of one array: separate reductions would trace the rays once per component.
        return out if reduced == 1 else dr.block_reduce(dr.ReduceOp.Add, out, reduced)

    def layers(self, scenes: Any, frame: Frame, inputs: KernelInputs) -> list[Array]:
        """Return the light along each lane's ray, one array per depth layer and component.

        Each lane traces one ray, from one eye in one world. The light of a ray has several components, for example one
        per spectral band. All components of the first depth layer come first.
        """
        lane = Lane.from_index(inputs.lanes, inputs.counts)
        seen, there = self.seen(scenes, frame, inputs, lane)
        bounces = inputs.bounces is not None
        samples = dr.gather(mi.Vector4f, inputs.bounces, lane.sample) if bounces else mi.Vector4f(0)
        components, distance = self.tracer.radiance(seen, there, samples)
        if inputs.weights is not None:
            fours = range(-(-len(components) // 4))
            rows = [dr.gather(mi.Vector4f, inputs.weights, lane.sample * len(fours) + k) for k in fours]
            components = [component * rows[k // 4][k % 4] for k, component in enumerate(components)]
        if self.depth.count == 1:
            return components
        shares = self.depth.shares(dr.rcp(distance * seen.cosine))
        return [component * share for share in shares for component in components]

    def seen(self, scenes: Any, frame: Frame, inputs: KernelInputs, lane: Lane) -> tuple[EyeRay, Any]:
        """Return the rays of all lanes, and the surfaces and lights that each ray can meet.

        Each lane traces one ray, from one eye in one world, and the ray meets only surfaces and lights of this world.
        The tracer determines the type of the second result, see `Tracer.around`.
        """
        seen = self.eyes.ray(frame.eyes, inputs.along, lane, inputs.counts.samples.number)
        return seen, self.tracer.around(scenes, frame.things, inputs.tables, lane.world)


def launched(
    frozen: Any, scenes: Any, frame: Callable[[], Frame], inputs: KernelInputs, variant_name: str
) -> Callable[[], np.ndarray]:
    """Launch a frozen kernel in this variant of Mitsuba, and return a function that waits for its output."""
    with variant(variant_name), GarbageKept():
        found = frozen(scenes, frame(), inputs)
    return lambda: _read(found)


def _read(found: Array | tuple[Array, ...]) -> np.ndarray:
    with GarbageKept():
        return np.stack([one.numpy() for one in found]) if isinstance(found, tuple) else np.array(found.numpy())
