"""The kernels of a model's renderer: all rays of all eyes of all worlds at once, and the buffers that they read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.sensor import Sensor
from sim.scene.device_arrays import aligned, floats, three, whole_numbers
from sim.scene.frozen_kernels import garbage_kept
from sim.scene.poses import Poses
from sim.scene.variant import MitsubaObject
from sim.scene.variant import variant as in_variant
from sim.tracing import lighting
from sim.tracing.model_lights import ROWS as LIGHT_ROWS
from sim.tracing.model_scene import ModelScene
from sim.tracing.model_tracer import ModelTracer, Rows

EYE_ROWS = 4  # of four floats: the pupil, right, up and ahead
SECOND = 3  # seed
SIZES = 5  # numbers of rays, eyes, rows of movers, lights and colours


class ModelWavefront:
    """Launches kernels. Everything in them is traced once; only arrays passed as arguments may change.

    light: sums of components over receptors' rays, flat (layer, component, world, eye, receptor)
    depth: along the eye's axis [m], of single directions · which: what these meet, see ModelTracer
    """

    def __init__(self, scene: ModelScene, tracer: ModelTracer, sensor: Sensor, n_envs: int, n_eyes: int) -> None:
        self._scene, self._tracer, self._sensor = scene, tracer, sensor
        self._n_envs, self._n_eyes = n_envs, n_eyes
        rows = {
            "eyes": n_eyes * EYE_ROWS,
            "movers": scene.movers.n_rows,
            "lights": max(len(scene.lights), 1) * LIGHT_ROWS,
            "paint": scene.paint.n_rows,
        }
        self._buffers = {name: aligned(n_envs * n * 4, np.float32).reshape(n_envs, n * 4) for name, n in rows.items()}
        self.light: Any = dr.freeze(lambda *args: self._light(*args))
        self.depth: Any = dr.freeze(lambda *args: self._depth(*args))
        self.which: Any = dr.freeze(lambda *args: self._which(*args))

    def look(self, directions: np.ndarray, bounce_samples: np.ndarray | None = None) -> dict[str, Array]:
        """What a kernel reads to look along these directions (ray, 3) with every eye; bounce_samples: (ray, 2), for
        light that bounces."""
        fours = np.zeros((len(directions), 4), np.float32)
        fours[:, :3] = directions
        scene = self._scene
        sizes = [len(directions), self._n_eyes, scene.movers.n_rows, max(len(scene.lights), 1), scene.paint.n_rows]
        lanes = dr.arange(mi.UInt32, self._n_envs * self._n_eyes * len(directions))
        dr.eval(lanes)
        inputs = {"directions": floats(fours), "sizes": whole_numbers(sizes), "lanes": lanes, **self._tracer.inputs}
        if self._tracer.light == lighting.BOUNCE and bounce_samples is not None:
            more = np.random.default_rng(SECOND).random(bounce_samples.shape)  # for a reflection further on
            inputs["bounce_samples"] = floats(np.concatenate([bounce_samples, more], axis=1))
        return inputs

    def launch(self, kernel: Any, look: dict[str, Array], poses: Poses, eyes: np.ndarray) -> Callable[[], np.ndarray]:
        """Start a kernel; what is returned waits for it. eyes: rows (world, eye, EYE_ROWS, 3)."""
        scene = self._scene
        self._buffers["eyes"].reshape(self._n_envs, -1, EYE_ROWS, 4)[..., :3] = eyes
        self._buffers["movers"][:] = scene.movers.rows(poses)
        if len(scene.paint):
            with in_variant(scene.variant):
                self._buffers["paint"][:] = scene.paint.rows(poses)
        if len(scene.lights):
            self._buffers["lights"][:] = scene.lights.rows(poses).reshape(self._n_envs, -1)
        return self.again(kernel, look)

    def again(self, kernel: Any, look: dict[str, Array]) -> Callable[[], np.ndarray]:
        """The same where everything is as at the last launch."""
        scene = self._scene
        with in_variant(scene.variant), garbage_kept():
            buffers = {name: mi.Float(buffer.reshape(-1)) for name, buffer in self._buffers.items()}
            still = scene.told_apart[0] if kernel is self.which else scene.scene
            found = kernel(still, scene.movers.meshes, buffers, look)
        return lambda: _read(found)

    def components(
        self, still: MitsubaObject, buffers: dict[str, Array], look: dict[str, Array]
    ) -> tuple[list[Array], Array]:
        """Within a kernel: what comes along every lane's ray, and 1 / depth along the eye's axis of what it meets."""
        ray, axis, cosine, rows = _of_lane(buffers, look)
        ray_of_eye = look["lanes"] % dr.maximum(dr.gather(mi.UInt32, look["sizes"], 0), 1)
        bounces = self._tracer.light == lighting.BOUNCE
        samples = dr.gather(mi.Vector4f, look["bounce_samples"], ray_of_eye) if bounces else mi.Vector4f(0)
        components, distance = self._tracer.radiance(still, ray, axis, rows, look, samples)
        return components, dr.rcp(distance * cosine)

    def _light(
        self, still: MitsubaObject, meshes: list[MitsubaObject], buffers: dict[str, Array], look: dict[str, Array]
    ) -> Array:
        components, nearness = self.components(still, buffers, look)
        shares = self._sensor.depth.shares(nearness)
        layers = [component * share for share in shares for component in components]
        lanes = self._n_envs * self._n_eyes * len(self._sensor.directions)
        out = dr.zeros(mi.Float, lanes * len(layers))
        for k, value in enumerate(layers):
            dr.scatter(out, value, look["lanes"] + k * lanes, mode=dr.ReduceMode.Permute)
        return dr.block_reduce(dr.ReduceOp.Add, out, self._sensor.rays_per_receptor)

    def _depth(
        self, still: MitsubaObject, meshes: list[MitsubaObject], buffers: dict[str, Array], look: dict[str, Array]
    ) -> Array:
        ray, _, cosine, rows = _of_lane(buffers, look)
        return self._tracer.distance(still, ray, rows, look) * cosine

    def _which(
        self, told_apart: MitsubaObject, meshes: list[MitsubaObject], buffers: dict[str, Array], look: dict[str, Array]
    ) -> Array:
        ray, _, _, rows = _of_lane(buffers, look)
        return self._tracer.which(told_apart, ray, rows, look)


def _of_lane(buffers: dict[str, Array], look: dict[str, Array]) -> tuple[Array, Array, Array, Rows]:
    """The lane's ray, its eye's axis, the cosine between them, and the rows of its world."""
    lane = look["lanes"]
    # Lanes that only fill up a packet read 0, and to divide by that ends the process.
    rays, eyes, movers, lights, paint = (dr.maximum(dr.gather(mi.UInt32, look["sizes"], i), 1) for i in range(SIZES))
    view = lane // rays
    env = view // eyes
    pupil, right, up, ahead = (three(buffers["eyes"], view * EYE_ROWS + i) for i in range(EYE_ROWS))
    local = dr.gather(mi.Vector4f, look["directions"], lane - view * rays)
    ray = mi.Ray3f(mi.Point3f(pupil), right * local.x + up * local.y + ahead * local.z)
    at = buffers["movers"], env * movers, buffers["lights"], env * lights * LIGHT_ROWS, buffers["paint"], env * paint
    return ray, ahead, local.z, Rows(*at)


def _read(found: Array | tuple[Array, ...]) -> np.ndarray:
    """Waits for the kernel."""
    with garbage_kept():
        return np.stack([one.numpy() for one in found]) if isinstance(found, tuple) else np.array(found.numpy())
