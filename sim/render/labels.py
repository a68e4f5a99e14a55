"""How far what receptors look at is, which geom it is, and how it moves on the retina: of any scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import ONE_PSF
from sim.eyes.sampling import directions_of
from sim.render.eye_rays import FreeEyes
from sim.render.optic_flow import flow_between, receptor_centres
from sim.render.pending_frame import FrameSlot
from sim.render.prepared_scene import Placed, PreparedScene
from sim.render.ray_kernel import Frame, KernelInputs, Moving, RayKernel, launched
from sim.scene.frozen_kernels import FrozenKernel
from sim.scene.variant import variant
from sim.tracing.eye_places import EyeFrames
from sim.tracing.model_tracer import ModelTracer, Scenes


class Labels:
    """Of each receptor's centre, in `n_envs` worlds.

    scene: the model and its eyes; all of their rays are traced by Mitsuba
    """

    def __init__(self, scene: PreparedScene, n_envs: int) -> None:
        self.scene, self.eye, self.mounts, self.model = scene, scene.eye, scene.mounts, scene.model
        self.n_envs, self._slot = n_envs, FrameSlot()
        with variant(scene.variant):
            tracer, eyes = ModelTracer(scene.scene), FreeEyes(scene.places, n_envs)
            kernel = RayKernel(tracer, eyes, n_envs, len(scene.mounts), ONE_PSF)
            self._moving = Moving(eyes, tracer.buffers(n_envs))
            self._inputs = kernel.inputs(directions_of(self.eye, receptor_centres(self.eye)))
            self._scenes = tracer.scene

        def distances(scenes: Scenes, frame: Frame, inputs: KernelInputs) -> Array:
            seen, there = kernel.seen(scenes, frame, inputs, kernel.lane(inputs))
            return tracer.distance(seen.ray, there) * seen.cosine

        def hits(scenes: Scenes, frame: Frame, inputs: KernelInputs) -> Array:
            seen, there = kernel.seen(scenes, frame, inputs, kernel.lane(inputs))
            return tracer.which(seen.ray, there)

        self._distances, self._hits = FrozenKernel(distances), FrozenKernel(hits)

    def depth(self, poses: Placed) -> np.ndarray:
        """How far what each receptor's centre looks at is, along the eye's axis [m], (env, eye, height, width) float32;
        infinite where there is nothing."""
        return self._seen(self._distances, self._scenes, poses)

    def ids(self, poses: Placed) -> np.ndarray:
        """Which geom each receptor's centre looks at, (env, eye, height, width) int32; -1 where there is nothing."""
        scene = self.scene.scene
        apart, geoms = scene.told_apart
        found = self._seen(self._hits, Scenes(apart, self._scenes.meshes), poses).astype(int)
        return np.concatenate([scene.movers.geoms, geoms])[found].astype(np.int32)

    def flow(self, poses: Placed, later: Placed) -> np.ndarray:
        """Optic flow from one moment to another: by how much what each receptor's centre looks at has moved on the
        retina, to the right and down [receptors], (env, eye, 2, height, width) float32; NaN where there is nothing, or
        where it is no longer before the eye."""
        moments = self.scene.placed(poses), self.scene.placed(later)
        self.scene.check_poses(moments[1], self.n_envs)
        frames = self.eye_frames(moments[0]), self.eye_frames(moments[1])
        return flow_between(self.eye, self.depth(moments[0]), self.ids(moments[0]), moments, frames)

    def eye_frames(self, poses: Placed) -> EyeFrames:
        """Where the eyes are."""
        return self.scene.places.frames(self.scene.placed(poses))

    @property
    def recordings(self) -> int:
        """How often the kernels were recorded."""
        return self._distances.n_recordings + self._hits.n_recordings

    def _seen(self, kernel: Any, scenes: Scenes, poses: Placed) -> np.ndarray:
        placed = self.scene.placed(poses)
        self.scene.check_poses(placed, self.n_envs)

        def launch() -> Callable[[], np.ndarray]:
            self._moving.fill(placed)
            return launched(kernel, scenes, self._moving.frame, self._inputs, self.scene.variant)

        found = self._slot.begin(launch).wait()
        return found.reshape(self.n_envs, len(self.mounts), *self.eye.resolution)
