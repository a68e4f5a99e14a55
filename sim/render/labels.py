"""Labels of receptors in any scene: depth, geom id and optic flow of the points that they see."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.compound_eye import CompoundEye
from sim.eyes.depth_layers import ONE_PSF
from sim.eyes.tangent_plane import directions_of, from_receptors
from sim.render.eye_rays import FreeEyes, Lane
from sim.render.optic_flow import flow_between, receptor_centres
from sim.render.pending_frame import FrameSlot
from sim.render.prepared_scene import Placed, PreparedScene
from sim.render.ray_kernel import Frame, KernelInputs, Moving, RayKernel, launched
from sim.scene.frozen_kernels import FrozenKernel
from sim.scene.variant import variant
from sim.tracing.eye_places import EyeFrames
from sim.tracing.model_tracer import ModelTracer, Scenes


class Labels:
    """Depth, geom id and optic flow of the point that each receptor's centre sees, in `n_envs` worlds.

    scene: the model and its eyes; Mitsuba traces all rays

    `depth`, `ids` and `flow` raise a ValueError for the same poses as `EyeRenderer.signals`, for example poses of
    another model.

    Raises:
        ValueError: the eye is a compound eye, which has no flat retina on which depth and flow are defined.
    """

    def __init__(self, scene: PreparedScene, n_envs: int) -> None:
        self.scene, self.eye, self.mounts, self.model = scene, scene.eye, scene.mounts, scene.model
        if isinstance(scene.eye, CompoundEye):
            raise ValueError("depth, ids and flow: are defined on a flat retina; the eye is a CompoundEye")
        self.n_envs, self._slot = n_envs, FrameSlot()
        with variant(scene.variant):
            tracer, eyes = ModelTracer(scene.scene), FreeEyes(scene.places, n_envs)
            kernel = RayKernel(tracer, eyes, n_envs, len(scene.mounts), ONE_PSF)
            self._moving = Moving(eyes, tracer.buffers(n_envs))
            self._inputs = kernel.inputs(directions_of(self.eye, from_receptors(self.eye, receptor_centres(self.eye))))
            self._scenes = tracer.scene

        def distances(scenes: Scenes, frame: Frame, inputs: KernelInputs) -> Array:
            seen, there = kernel.seen(scenes, frame, inputs, Lane.from_index(inputs.lanes, inputs.counts))
            return tracer.distance(seen.ray, there) * seen.cosine

        def hits(scenes: Scenes, frame: Frame, inputs: KernelInputs) -> Array:
            seen, there = kernel.seen(scenes, frame, inputs, Lane.from_index(inputs.lanes, inputs.counts))
            return tracer.which(seen.ray, there)

        self._distances, self._hits = FrozenKernel(distances), FrozenKernel(hits)

    def depth(self, poses: Placed) -> np.ndarray:
        """Return the depth [m], along the eye's axis, of the point that each receptor's centre sees.

        The shape is (env, eye, height, width), float32. The depth is infinite where the receptor's centre sees no geom.
        """
        return self._at_centres(self._distances, self._scenes, poses)

    def ids(self, poses: Placed) -> np.ndarray:
        """Return the id of the geom at each receptor's centre, (env, eye, height, width) int32; -1 if there is none."""
        scene = self.scene.scene
        apart, geoms = scene.one_shape_per_geom
        found = self._at_centres(self._hits, Scenes(apart, self._scenes.meshes), poses).astype(int)
        return np.concatenate([scene.movers.geoms, geoms])[found].astype(np.int32)

    def flow(self, poses: Placed, later: Placed) -> np.ndarray:
        """Return the optic flow between two moments: its components to the right and down [receptors].

        A receptor's centre sees a point, and the flow is the displacement of this point's image on the retina. It is
        NaN if the centre sees no geom, or if the point is not in front of the eye at the later moment. The result is an
        array (env, eye, 2, height, width) float32.
        """
        moments = self.scene.placed(poses), self.scene.placed(later)
        self.scene.check_poses(moments[1], self.n_envs)
        frames = self.eye_frames(moments[0]), self.eye_frames(moments[1])
        return flow_between(self.eye, self.depth(moments[0]), self.ids(moments[0]), moments, frames)

    def eye_frames(self, poses: Placed) -> EyeFrames:
        """Return pupil positions [m], (env, eye, 3), and rotations of the eyes, (env, eye, 3, 3), in the world."""
        return self.scene.places.frames(self.scene.placed(poses))

    @property
    def recordings(self) -> int:
        """Number of times that Dr.Jit has recorded the kernels for depth and for geom ids."""
        return self._distances.n_recordings + self._hits.n_recordings

    def _at_centres(self, kernel: Any, scenes: Scenes, poses: Placed) -> np.ndarray:
        placed = self.scene.placed(poses)
        self.scene.check_poses(placed, self.n_envs)

        def launch() -> Callable[[], np.ndarray]:
            self._moving.fill(placed)
            return launched(kernel, scenes, self._moving.frame, self._inputs, self.scene.variant)

        found = self._slot.launch(launch).wait()
        return found.reshape(self.n_envs, len(self.mounts), *self.eye.resolution)
