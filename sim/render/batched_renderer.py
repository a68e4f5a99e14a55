"""All eyes of all worlds as one Dr.Jit wavefront: one frozen kernel, one static scene, movers in closed form.

Rays are traced in world-local coordinates, since all worlds share their static geometry. Directions and
wavelengths are fixed, so a call does nothing but upload poses and launch the kernel that the first call recorded.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

import optics
from optics.numerics.arguments import whole
from optics.numerics.autodiff import Array
from sim.eyes.eyes import Eyes, eye_positions, eye_rotations
from sim.eyes.sensor import Sensor
from sim.render import memory_budget
from sim.render.area_wavefront import AreaWavefront
from sim.render.fidelity import AREAS, EDGES, Fidelity
from sim.render.fidelity_choice import chosen_fidelity
from sim.render.pending_frame import FrameSlot, PendingFrame
from sim.render.prepared_scene import PreparedScene
from sim.render.wavefront import PoseBuffer, RayWavefront, Wavefront
from sim.scene.device_arrays import floats, in_fours
from sim.scene.frozen_kernels import garbage_kept
from sim.scene.variant import variant
from sim.tracing import lighting
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.tracer import Tracer
from sim.worlds.state import WorldState
from sim.worlds.world import World

MOST_ENVS = 2**31 - 1


class BatchedRenderer:
    """Sees `n_envs` worlds with the same eyes.

    world: geometry, materials and lights; shared by all worlds
    eyes: of every agent
    n_envs: number of worlds in a state
    fidelity: how finely, with its own number of bands: `Fidelity(4, bands=4)` traces 4 rays for each receptor; None:
        `choose_fidelity(world, eyes, bands="own")`, as finely as the receptors' noise asks for. The one in use is in
        `.fidelity`
    tracer: "closed_form" (worlds of upright walls, a floor and spheres), "mitsuba" (any shapes), or "auto"; the one in
        use is in `.tracer.name`, why in `.tracer.why`
    brightest: signal of a white surface that faced all lights at once

    Raises:
        ValueError: less than one world, more rays than there is memory for, lights other than directional ones, and a
            world that has no closed form where that is asked for.
    """

    def __init__(
        self, world: World, eyes: Eyes, n_envs: int, fidelity: Fidelity | None = None, tracer: str = "auto"
    ) -> None:
        if fidelity is not None and not isinstance(fidelity, Fidelity):
            raise ValueError(f"fidelity = {fidelity!r}: must be a sim.Fidelity, such as Fidelity(4, bands=4), or None")
        scene = PreparedScene(world, eyes if fidelity is None else replace(eyes, bands=fidelity.bands), tracer)
        self._open(scene, n_envs, fidelity or chosen_fidelity(scene))

    @classmethod
    def of(cls, scene: PreparedScene, n_envs: int, fidelity: Fidelity) -> BatchedRenderer:
        """The renderer of a scene that has been prepared.

        Raises:
            ValueError: as the constructor, and a fidelity for another number of bands than the scene's.
        """
        renderer = cls.__new__(cls)
        renderer._open(scene, n_envs, fidelity)
        return renderer

    def _open(self, scene: PreparedScene, n_envs: int, fidelity: Fidelity) -> None:
        if fidelity.samples == EDGES:
            raise ValueError("samples = 'edges': is for sim.ModelRenderer; worlds have 'areas'")
        if fidelity.bands != scene.eyes.bands:
            raise ValueError(f"fidelity.bands = {fidelity.bands}: must be the scene's {scene.eyes.bands}")
        self.world, self.eyes, self.eye = scene.world, scene.eyes, scene.eye
        self.bands: optics.SpectralBands = scene.bands
        self._static = scene.static
        with variant(self._static.variant):
            white = lighting.white_radiance(self._static.scene, self.bands.wavelengths)
        self.fidelity, sampling = fidelity, scene.sampling(fidelity.depth, fidelity.tolerance)
        self.tracer: Tracer | AreaTracer
        self.tracer = (scene.areas if fidelity.samples == AREAS else scene.tracers.of)(fidelity.light)
        self._check_memory(n_envs, fidelity.rays_per_receptor)
        self.sensor: Sensor
        if fidelity.samples == AREAS:
            self.sensor = scene.area_sensor(sampling, fidelity.rays_per_receptor)
        else:
            self.sensor = sampling.sensor(fidelity.rays_per_receptor)
        asked = fidelity.rays_per_receptor
        if self.eye.pupil is None or (fidelity.samples == AREAS and asked >= 1):  # of its own for every receptor: whole
            self.fidelity = replace(fidelity, rays_per_receptor=float(max(1, round(asked))))
        self._check_memory(n_envs, self._samples_per_receptor)
        mixing = self.eye.aperture_throughput * self.bands.weights
        self.brightest = float((self.eye.throughput * self.bands.weights @ white).max())
        self._receptor_sums = self.sensor.receptor_sums(mixing, self.tracer.basis)
        self._set_width(n_envs)

    def resized(self, n_envs: int) -> BatchedRenderer:
        """The same eyes and scene for another number of worlds; the scene is shared, not loaded again."""
        other = copy.copy(self)
        other._check_memory(n_envs, other._samples_per_receptor)
        other._set_width(n_envs)
        return other

    @property
    def _samples_per_receptor(self) -> float:
        """Behind a pupil with areas around the receptors', too."""
        return len(self.sensor.directions) / float(np.prod(self.eyes.resolution))

    def _check_memory(self, n_envs: int, samples_per_receptor: float) -> None:
        whole("n_envs", n_envs, 1, MOST_ENVS)
        layers = self.fidelity.depth.count
        planes, weights = layers * len(self.tracer.basis), layers * len(self.bands.wavelengths)
        memory_budget.check_memory(
            memory_budget.Demand(
                samples_per_receptor,
                n_envs,
                self.eyes.n_eyes,
                self.eyes.resolution,
                planes,
                weights if self.eye.pupil else 0,
            )
        )

    def _set_width(self, n_envs: int) -> None:
        self.n_envs = n_envs = int(n_envs)
        self._poses, self._slot = PoseBuffer(n_envs, len(self._static.spheres)), FrameSlot()
        with variant(self._static.variant):
            wavefront = self._wavefront()
            cosines = self.sensor.directions[:, 2]
            self._inputs = {
                "directions": floats(in_fours(self._in_agent_frame(self.sensor.directions), cosines)),
                "origins": floats(in_fours(eye_positions(self.eyes.azimuths()), 0.0)),
                "bounce_samples": floats(self.sensor.bounce_samples),
                **self.tracer.inputs,
                **wavefront.inputs,
            }
            reduced = self.sensor.rays_per_receptor
            self._rays: Any = dr.freeze(lambda scene, poses, inputs: wavefront(scene, poses, inputs, 1))
            self._sums: Any = dr.freeze(lambda scene, poses, inputs: wavefront(scene, poses, inputs, reduced))

    def _wavefront(self) -> Wavefront:
        n_envs, n_eyes = self.n_envs, self.eyes.n_eyes
        if isinstance(self.tracer, AreaTracer):
            return AreaWavefront(n_envs, n_eyes, self.sensor, self.tracer, self._poses, self._in_agent_frame)
        return RayWavefront(n_envs, n_eyes, self.sensor, self.tracer, self._poses)

    def _in_agent_frame(self, directions: np.ndarray) -> np.ndarray:
        """Every eye's directions (ray, 3) in the agent's frame, (eye, ray, 3)."""
        found: np.ndarray = np.einsum("eij,rj->eri", eye_rotations(self.eyes.azimuths()), directions)
        return found

    def radiance(self, state: WorldState) -> np.ndarray:
        """Spectral radiance along every ray, (env, eye, ray, band) float32."""
        layers = self._components(self._rays, state)
        rays = np.einsum("lkn,kb->nb", layers, self.tracer.basis.astype(np.float32))
        return rays.reshape(self.n_envs, self.eyes.n_eyes, -1, len(self.bands.wavelengths))

    def receptor_radiance(self, state: WorldState) -> np.ndarray:
        """Spectral radiance averaged over every receptor's field, (band, env, eye, height, width) float32."""
        bands, (height, width) = len(self.bands.wavelengths), self.eye.resolution
        layers = self._components(self._sums, state)
        sums = np.einsum("lkn,kb->lbn", layers, self.tracer.basis.astype(np.float32))
        sums = sums.reshape(len(layers) * bands, self.n_envs * self.eyes.n_eyes, -1)
        return self.sensor.receptor_radiance(sums).reshape(bands, self.n_envs, self.eyes.n_eyes, height, width)

    def signals(self, state: WorldState) -> np.ndarray:
        """Noise-free photoreceptor signals, (env, eye, channel, height, width) float32:
        a² sum_b weights[channel, b] radiance_b."""
        return self.begin(state).wait()

    def begin(self, state: WorldState) -> PendingFrame:
        """Begin to see; it runs beside whatever comes next, until the signals are waited for."""
        return self._launched(self._sums, state).then(self._signals)

    def _signals(self, light: np.ndarray) -> np.ndarray:
        planes = self.sensor.depth.count * len(self.tracer.basis)
        signals = self._receptor_sums(light.reshape(planes, self.n_envs * self.eyes.n_eyes, -1))
        signals = signals.reshape(self.n_envs, self.eyes.n_eyes, len(self.bands.weights), *self.eye.resolution)
        mosaic = self.eye.mosaic
        return signals if mosaic is None else np.take_along_axis(signals, mosaic[None, None, None], axis=2)

    @property
    def recordings(self) -> int:
        """How often the kernels were recorded: once per kernel in use."""
        return int(self._rays.n_recordings + self._sums.n_recordings)

    def _components(self, frozen: Any, state: WorldState) -> np.ndarray:
        """(layer, component, all rays of all views, or their sums)"""
        light = self._launched(frozen, state).wait()
        return light.reshape(self.sensor.depth.count, len(self.tracer.basis), -1)

    def _launched(self, frozen: Any, state: WorldState) -> PendingFrame:
        """The kernel at work on this state."""
        if state.n != self.n_envs:
            raise ValueError(f"state has {state.n} worlds, this renderer was built for n_envs = {self.n_envs}")

        def launch() -> Callable[[], np.ndarray]:
            with variant(self._static.variant), garbage_kept():
                poses = mi.Float(self._poses.pack(state, self._static))  # shares the buffer's memory
                light = frozen(self.tracer.scene, poses, self._inputs)
            return lambda: _read(light)

        return self._slot.begin(launch)


def _read(light: Array) -> np.ndarray:
    """Waits for the kernel."""
    with garbage_kept():
        return np.array(light.numpy())
