"""The kernel that traces all rays of all eyes of all worlds: what it reads, and its body."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.eyes import EYE_HEIGHT
from sim.eyes.sensor import Sensor
from sim.scene.device_arrays import aligned, counted, three, whole_numbers
from sim.scene.variant import MitsubaObject
from sim.tracing import lighting
from sim.tracing.static_scene import StaticScene
from sim.tracing.tracer import Tracer
from sim.worlds.state import WorldState

ROW = 16  # floats: rows of the pose buffer start on 64 bytes


class PoseBuffer:
    """The kernel's only changing input: one aligned row of floats per world, (x, y, cos, sin) and, in fours as well,
    the objects' centres."""

    def __init__(self, n_envs: int, n_spheres: int) -> None:
        self.n_spheres = n_spheres
        self.stride = -(-4 * (1 + n_spheres) // ROW) * ROW
        self._rows = aligned(n_envs * self.stride, np.float32).reshape(n_envs, self.stride)

    def pack(self, state: WorldState, static: StaticScene) -> np.ndarray:
        rows = self._rows
        rows[:, :2] = state.position
        rows[:, 2], rows[:, 3] = np.cos(state.heading), np.sin(state.heading)
        places = rows[:, 4 : 4 * (1 + self.n_spheres)].reshape(len(rows), self.n_spheres, 4)
        places[..., :3] = state.objects + static.spheres.offsets
        return rows.reshape(-1)


class Wavefront(ABC):
    """The kernel's body. Everything here is traced once; only arrays passed as arguments may change."""

    def __init__(self, n_envs: int, n_eyes: int, sensor: Sensor, poses: PoseBuffer) -> None:
        self.n_rays, self.n_envs, self.n_eyes = len(sensor.directions), n_envs, n_eyes
        self.lanes = n_envs * n_eyes * self.n_rays
        self.stride, self.n_spheres = poses.stride, poses.n_spheres
        self.depth = sensor.depth

    @property
    def inputs(self) -> dict[str, Array]:
        """Inputs, not constants: eyes of any resolution and field of view, in any number of worlds, share a kernel."""
        return {"sizes": whole_numbers([self.n_rays, self.n_eyes, self.lanes]), "lanes": counted(self.lanes)}

    def __call__(self, scene: MitsubaObject, poses: Array, inputs: dict[str, Array], reduced: int) -> Array:
        lane = inputs["lanes"]
        # Lanes that only fill up a packet read 0, and to divide by that ends the process.
        n_rays, n_eyes, lanes = (dr.maximum(dr.gather(mi.UInt32, inputs["sizes"], i), 1) for i in range(3))
        view = lane // n_rays
        world = view // n_eyes
        sample = lane - view * n_rays
        eye = view - world * n_eyes
        components = self._components(scene, poses, inputs, (world, eye, sample))
        if len(components) == 1:
            out = components[0]
        else:
            out = dr.zeros(mi.Float, self.lanes * len(components))
            for k, value in enumerate(components):
                dr.scatter(out, value, lane + k * lanes, mode=dr.ReduceMode.Permute)
        # One reduction of one array: a reduction per component would trace the rays once per component.
        return out if reduced == 1 else dr.block_reduce(dr.ReduceOp.Add, out, reduced)

    @abstractmethod
    def _components(
        self, scene: MitsubaObject, poses: Array, inputs: dict[str, Array], place: tuple[Array, Array, Array]
    ) -> list[Array]:
        """Of the light at this place (world, eye, sample), per depth layer."""

    def _ray(
        self, poses: Array, inputs: dict[str, Array], world: Array, eye: Array, ray: Array
    ) -> tuple[Array, Array, Array, list[Array]]:
        """The lane's ray, its cosine with the eye's axis, and the centres of the agent and of its world's spheres."""
        agent, centres, turned = self._pose(poses, world)
        origin = agent + turned(dr.gather(mi.Vector4f, inputs["origins"], eye))
        row = eye * dr.gather(mi.UInt32, inputs["sizes"], 0) + ray
        direction = dr.gather(mi.Vector4f, inputs["directions"], row)
        return mi.Ray3f(origin, turned(direction)), direction.w, agent, centres

    def _pose(self, poses: Array, world: Array) -> tuple[Array, list[Array], Callable[[Array], Array]]:
        """Of a world: the centres of its agent and of its spheres, and what turns vectors as the agent is turned."""
        first = world * (self.stride // 4)
        x, y, cos, sin = dr.gather(mi.Vector4f, poses, first)
        centres = [mi.Point3f(three(poses, first + (1 + k))) for k in range(self.n_spheres)]

        def turned(v: Array) -> Array:
            return mi.Vector3f(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z)

        return mi.Point3f(x, y, EYE_HEIGHT), centres, turned


class RayWavefront(Wavefront):
    """Follows rays."""

    def __init__(self, n_envs: int, n_eyes: int, sensor: Sensor, tracer: Tracer, poses: PoseBuffer) -> None:
        super().__init__(n_envs, n_eyes, sensor, poses)
        self._tracer = tracer

    def _components(
        self, scene: MitsubaObject, poses: Array, inputs: dict[str, Array], place: tuple[Array, Array, Array]
    ) -> list[Array]:
        """Of the light that comes along the ray there."""
        ray, cosine, agent, centres = self._ray(poses, inputs, *place)
        bounces = self._tracer.light == lighting.BOUNCE
        bounce_sample = dr.gather(mi.Point2f, inputs["bounce_samples"], place[2]) if bounces else None
        components, distance = self._tracer.radiance(scene, ray, agent, centres, inputs, bounce_sample)
        if self.depth.count == 1:
            return components
        shares = self.depth.shares(dr.rcp(distance * cosine))
        return [component * share for share in shares for component in components]
