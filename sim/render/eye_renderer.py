"""Rendering of all eyes in all worlds together, by frozen (recorded) kernels, with any tracer.

Directions and wavelengths are fixed. A call only uploads poses and launches the kernels that the first call recorded.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np

import optics
from optics.numerics.arguments import whole
from optics.numerics.renamed import renamed
from optics.spectra.spectrum import Spectrum
from sim.eyes.allowed_error import allowed_error
from sim.eyes.ommatidial_sampling import OmmatidialSampling
from sim.eyes.sampling import BoxSampling, FieldSampling
from sim.eyes.sensor import Sensor
from sim.render.area_kernel import AreaKernel
from sim.render.edge_rays import FIRST, EdgeRays
from sim.render.fidelity import AREAS, EDGES, Fidelity
from sim.render.labels import Labels
from sim.render.light_factors import LightFactors
from sim.render.memory_budget import Demand, check_memory
from sim.render.pending_frame import FrameSlot, PendingFrame
from sim.render.prepared_scene import Placed, PreparedScene
from sim.render.ray_kernel import KernelInputs, Moving, RayKernel, launched
from sim.render.receptor_noise import FEW
from sim.render.renderable import check_renderable
from sim.scene.frozen_kernels import FrozenKernel
from sim.scene.poses import world_indices
from sim.scene.variant import variant
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.eye_places import EyeFrames
from sim.tracing.tracer import Tracer

MOST_ENVS = 2**31 - 1


class EyeRenderer:
    """A renderer of `n_envs` worlds of one scene with the same eyes.

    scene: the model and its eyes
    n_envs: number of worlds
    fidelity: accuracy of rendering, see `Fidelity`; it must have as many spectral bands as the scene

    Further attributes:
    eye, mounts, model: the scene's eye, mounts and model
    sensor: the sampled directions
    tracer: the method of tracing rays, see `sim.tracing.tracer.Tracer`
    brightest: signal of a white surface that faces all directional lights at once, or of veiling light if it is larger

    One warning (`sim.MirrorWarning`) lists features of the model that are not rendered. Further warnings name lamps
    with spectral lines for which the eye has too few bands.

    Raises:
        ValueError: n_envs is below 1, the rays do not fit into memory, or the scene does not support the fidelity.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """

    def __init__(self, scene: PreparedScene, n_envs: int, fidelity: Fidelity) -> None:
        check_renderable(fidelity, scene.eye)
        self.scene, self.eye, self.model, self.mounts = scene, scene.eye, scene.model, scene.mounts
        self.fidelity, sampling = fidelity, scene.sampling(fidelity.depth, fidelity.tolerance)
        self._sampling = sampling
        self.tracer: Tracer | AreaTracer
        self.tracer = (scene.areas if fidelity.samples == AREAS else scene.tracers.tracer_for)(fidelity.light)
        self._check_memory(n_envs, fidelity.rays_per_receptor)
        scene.warn_once(fidelity.light)
        asked = fidelity.rays_per_receptor
        self.sensor: Sensor
        if fidelity.samples == AREAS:
            assert not isinstance(sampling, OmmatidialSampling)
            self.sensor = scene.area_sensor(sampling, asked)
        else:
            self.sensor = sampling.sensor(FIRST if fidelity.samples == EDGES else asked)
        self._check_memory(n_envs, self._samples_per_receptor)
        self._mosaic = self.eye.mosaic
        self._mixing = self.eye.aperture_throughput * self.eye.spectral_bands.weights
        self._receptor_sums = self.sensor.receptor_sums(self._mixing, self.tracer.basis)
        self._white = scene.white
        self.brightest = self.brightest_in(np.ones(len(self._white)))
        self._set_width(n_envs)

    def resized(self, n_envs: int) -> Self:
        """Return a renderer of another number of worlds, which shares this renderer's scene and eyes.

        Raises:
            ValueError: n_envs is below 1, or the rays do not fit into memory.
        """
        other = copy.copy(self)
        other._check_memory(n_envs, other._samples_per_receptor)
        for of_width in ("_few", "labels"):
            vars(other).pop(of_width, None)
        other._set_width(n_envs)
        return other

    @property
    def _samples_per_receptor(self) -> float:
        """Number of samples per receptor. If the eye has a pupil, areas beyond the retina's rim are also counted."""
        return len(self.sensor.directions) / float(np.prod(self.eye.resolution))

    def _check_memory(self, n_envs: int, samples_per_receptor: float) -> None:
        whole("n_envs", n_envs, 1, MOST_ENVS)
        layers = self.fidelity.depth.count
        planes = layers * len(self.tracer.basis)
        weights = layers * self.eye.bands if isinstance(self._sampling, FieldSampling) else 0
        check_memory(Demand(samples_per_receptor, n_envs, len(self.mounts), self.eye.resolution, planes, int(weights)))

    def _set_width(self, n_envs: int) -> None:
        self.n_envs, self._slot = int(n_envs), FrameSlot()
        with variant(self.scene.variant):
            eyes = self.scene.eye_rays(self.tracer, self.n_envs)
            self._moving = Moving(eyes, self.tracer.buffers(self.n_envs))
            n_eyes = len(self.mounts)
            if isinstance(self.tracer, AreaTracer):
                kernel: RayKernel = AreaKernel(self.tracer, eyes, self.sensor, self.n_envs, n_eyes)
            else:
                kernel = RayKernel(self.tracer, eyes, self.n_envs, n_eyes, self.sensor.depth)
            self._inputs = kernel.inputs(self.sensor.directions, self.sensor.bounce_samples, self.sensor.facets)
            lanes, reduced = self.n_envs * n_eyes * len(self.sensor.directions), self.sensor.rays_per_receptor
            self._rays = FrozenKernel(lambda scenes, frame, given: kernel.sums(scenes, frame, given, lanes, 1))
            self._sums = FrozenKernel(lambda scenes, frame, given: kernel.sums(scenes, frame, given, lanes, reduced))
            self._unweighted = replace(self._inputs, weights=None)
            self._edges = self._at_edges(kernel) if self.fidelity.samples == EDGES else None

    def _at_edges(self, kernel: RayKernel) -> EdgeRays:
        assert isinstance(self._sampling, BoxSampling)
        noticed = allowed_error(self.eye, self.fidelity.tolerance)
        signals = self._mixing @ self.tracer.basis.T
        return EdgeRays(kernel, self._sampling, self.fidelity.rays_per_receptor, signals, noticed)

    def signals(self, poses: Placed, light: np.ndarray | None = None) -> np.ndarray:
        """Return noise-free photoreceptor signals, (env, eye, channel, height, width) float32.

        poses: poses of every world: a list of their MjData after mj_forward or mj_step, or `sim.Poses`, arrays stacked
            over worlds. A single world's MjData needs no list. For built-in worlds, a `WorldState` is also accepted
        light: factors by which all lights of each world are multiplied, (env, band); None: lights as in the model

        Raises:
            ValueError: the number of worlds or `light` is wrong; the poses belong to another model, are not finite or
                have not been computed yet; or a geom differs from the model, although the argument `varied` of
                `sim.ModelRenderer` does not name it.
        """
        return self.launch(poses, light).wait()

    begin, begin_some = renamed("launch"), renamed("launch_some")

    def launch(self, poses: Placed, light: np.ndarray | None = None) -> PendingFrame:
        """Start rendering in the background, and return a frame whose `wait` returns the result of `signals`.

        The arguments and errors are those of `signals`.
        """
        factors = None if light is None else LightFactors.from_light(light, (self.n_envs, self.eye.bands))
        return self._launched(poses).then(lambda found: self._signals(found, factors))

    def launch_some(self, poses: Placed, worlds: np.ndarray, light: np.ndarray | None = None) -> PendingFrame:
        """Start rendering the worlds with the indices `worlds`; `wait` of the returned frame returns their signals.

        `poses` and `light` are given for all worlds, as in `signals`. If at most 8 indices are given and the renderer
        has more than 8 worlds, separate buffers are used, so that a frame of all worlds may be pending at the same
        time. Otherwise, all worlds are rendered. An unknown world is a ValueError; other errors are as in `signals`.
        The signals are an array (index in `worlds`, eye, channel, height, width).
        """
        worlds = world_indices("worlds", worlds, self.n_envs)
        if not len(worlds) <= FEW < self.n_envs:
            return self.launch(poses, light).then(lambda seen: seen[worlds])
        few, placed = np.resize(worlds, FEW), self.scene.placed(poses)
        self.scene.check_count(placed, self.n_envs)
        if light is not None:
            light = LightFactors.from_light(light, (self.n_envs, self.eye.bands)).bands[few]
        seen = self._few.launch(placed.take(few), light)
        return seen.then(lambda signals: signals[: len(worlds)])

    @cached_property
    def _few(self) -> Self:
        """Renderer of 8 worlds with the same eyes, for `launch_some`."""
        return self.resized(FEW)

    def receptor_radiance(self, poses: Placed) -> np.ndarray:
        """Return spectral radiance averaged over every receptor's field, (band, env, eye, height, width) float32.

        The unit is the radiance at 560 nm of a white surface that faces a MuJoCo light whose `diffuse` is 1. Such a
        light has the spectrum of D65. Errors: see `signals`.
        """
        bands, (height, width) = self.eye.bands, self.eye.resolution
        layers = self._components(self._launched(poses).wait())
        sums = np.einsum("lkn,kb->lbn", layers, self.tracer.basis.astype(np.float32))
        sums = sums.reshape(len(layers) * bands, self.n_envs * len(self.mounts), -1)
        return self.sensor.receptor_radiance(sums).reshape(bands, self.n_envs, len(self.mounts), height, width)

    def radiance(self, poses: Placed) -> np.ndarray:
        """Return spectral radiance of all samples, (env, eye, sample, band) float32; unit as in `receptor_radiance`."""
        layers = self._components(self._launched(poses, self._rays).wait())
        rays = np.einsum("lkn,kb->nb", layers, self.tracer.basis.astype(np.float32))
        return rays.reshape(self.n_envs, len(self.mounts), -1, self.eye.bands)

    def eye_frames(self, poses: Placed) -> EyeFrames:
        """Return pupil positions [m], (env, eye, 3), and rotations of the eyes, (env, eye, 3, 3), in the world."""
        return self.scene.places.frames(self.scene.placed(poses))

    @cached_property
    def labels(self) -> Labels:
        """Renderer of depth, geom ids and optic flow at the receptors' centres; ValueError for a compound eye."""
        return Labels(self.scene, self.n_envs)

    def depth(self, poses: Placed) -> np.ndarray:
        """Return the depth at each receptor's centre [m], (env, eye, height, width); see `Labels.depth`."""
        return self.labels.depth(poses)

    def ids(self, poses: Placed) -> np.ndarray:
        """Return the geom id at each receptor's centre, (env, eye, height, width); see `Labels.ids`."""
        return self.labels.ids(poses)

    def flow(self, poses: Placed, later: Placed) -> np.ndarray:
        """Return the optic flow between two moments [receptors], (env, eye, 2, height, width); see `Labels.flow`."""
        return self.labels.flow(poses, later)

    def brightest_in(self, light: np.ndarray) -> float:
        """Return what the attribute `brightest` would be if all lights were multiplied by `light`, (band,)."""
        return float((self.eye.throughput * self.eye.spectral_bands.weights @ (self._white * light)).max())

    @property
    def bands(self) -> optics.SpectralBands:
        """Spectral bands of the eyes."""
        return self.eye.spectral_bands

    @property
    def moving(self) -> int:
        """Number of moving geoms."""
        return len(self.scene.scene.moving)

    @property
    def only_directional(self) -> bool:
        """True if all light comes from directional lamps: no point lights, spotlights, sky or glowing geoms."""
        scene = self.scene.scene
        return all(light.kind == "directional" for light in scene.lights.found) and not (scene.has_sky or scene.glows)

    @property
    def spectra(self) -> Mapping[str, Spectrum]:
        """Measured spectra of materials and lights, by name."""
        return self.scene.scene.spectra

    @property
    def recordings(self) -> int:
        """Number of times that Dr.Jit recorded kernels: once per kernel that ran, up to 3 times if meshes move."""
        edges = 0 if self._edges is None else self._edges.recordings
        labels = vars(self).get("labels")
        recorded = self._rays.n_recordings + self._sums.n_recordings + edges
        return recorded + (0 if labels is None else labels.recordings)

    def _launched(self, poses: Placed, frozen: Any = None) -> PendingFrame:
        """Start the recorded kernel `frozen`; None: the kernels that sum the light over each receptor's rays."""
        placed = self.scene.placed(poses)
        self.scene.check_poses(placed, self.n_envs)

        def start(kernel: Any, inputs: KernelInputs) -> Callable[[], np.ndarray]:
            return launched(kernel, self.tracer.scene, self._moving.frame, inputs, self.scene.variant)

        def launch() -> Callable[[], np.ndarray]:
            self._moving.fill(placed)
            if frozen is None and self._edges is not None:
                return self._edges.launch(start)
            return start(self._sums, self._inputs) if frozen is None else start(frozen, self._unweighted)

        return self._slot.launch(launch)

    def _signals(self, found: np.ndarray, factors: LightFactors | None) -> np.ndarray:
        sums, layers = self._receptor_sums, self._components(found)
        if factors is not None and not (factors.is_level and self._has_components):
            layers = factors.on_bands(layers, self.tracer.basis if self._has_components else None, len(self.mounts))
            sums = self._sums_of_bands
        views = self.n_envs * len(self.mounts)
        signals = sums(layers.reshape(layers.shape[0] * layers.shape[1], views, -1))
        signals = signals.reshape(self.n_envs, len(self.mounts), len(self._mixing), *self.eye.resolution)
        if self._mosaic is not None:
            signals = np.take_along_axis(signals, self._mosaic.reshape(1, 1, -1, *self.eye.resolution), axis=2)
        if factors is not None and factors.is_level and self._has_components:
            return np.asarray(signals * factors.level)
        return signals

    @cached_property
    def _has_components(self) -> bool:
        """True if light is traced in components of its spectrum that are not the spectral bands."""
        return not np.array_equal(self.tracer.basis, np.eye(self.eye.bands))

    @cached_property
    def _sums_of_bands(self) -> Any:
        """Function that maps light in the bands to signals, see `sim.eyes.receptor_sums`."""
        return self.sensor.receptor_sums(self._mixing, np.eye(self.eye.bands))

    def _components(self, found: np.ndarray) -> np.ndarray:
        """Return a kernel's flat output as (layer, component, value); each ray, or sum over rays, has a value."""
        return found.reshape(self.sensor.depth.count, len(self.tracer.basis), -1)
