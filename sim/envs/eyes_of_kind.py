"""Signals of one kind of eyes of one agent, in all worlds, noise included."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from sim.envs.observation import ROUNDING, SIGMAS, Memory
from sim.render.eye_renderer import EyeRenderer
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import NoiseModel, Normals
from sim.scene.poses import Poses
from sim.tasks.simulation import Simulation


class EyesOfKind:
    """Renderer, noise and memory of these eyes.

    simulation: worlds · renderer: the eyes · keys: of their noise, one for each world
    memory: frames in an observation
    space: of one world's observation of them
    """

    def __init__(self, simulation: Simulation, renderer: EyeRenderer, keys: np.ndarray, memory: int) -> None:
        self.renderer, self._simulation = renderer, simulation
        self._wavelengths = np.asarray(renderer.eye.spectral_bands.wavelengths)
        self.memory, self._noise = Memory(memory), NoiseModel.of(renderer.eye)
        frame = (len(renderer.mounts), renderer.eye.channels, *renderer.eye.resolution)
        self._normals = Normals(keys, frame)
        self.space = self._space((memory, *frame))

    def restart(self, keys: np.ndarray) -> None:
        """Draw noise from its beginning."""
        self._normals.restart(keys)

    def begin(self, poses: Poses, worlds: np.ndarray | None = None) -> PendingFrame:
        """Begin to render these worlds (None: all), noise included; no other world's noise goes on."""
        light = self._simulation.light(self._wavelengths)
        if worlds is None:
            seen = self.renderer.begin(poses, light)
            worlds = np.arange(self._simulation.n)
        else:
            seen = self.renderer.begin_some(poses, worlds, light)
        noise = self._noise
        if noise is None:
            return seen
        normals = self._normals.begin(worlds)
        return seen.then(lambda signals: noise(signals, normals.wait()))

    def state(self) -> dict[str, np.ndarray]:
        """All that future signals depend on, beside the worlds."""
        return {"remembered": self.memory.held, "noise": self._normals.place}

    def bring_back(self, remembered: np.ndarray, noise: np.ndarray) -> None:
        """Inverse of `state`."""
        self.memory.hold(remembered)
        self._normals.go_on_from(noise)

    def _space(self, frames: tuple[int, ...]) -> spaces.Box:
        brightest = self._brightest()
        spread = 0.0 if self._noise is None else self._noise.largest(brightest)
        margin = SIGMAS * spread + ROUNDING * brightest
        # Lights at points are brighter the nearer they are.
        high = 2 * brightest + margin if self.renderer.only_directional else np.inf
        return spaces.Box(-margin if np.isfinite(high) else -np.inf, high, frames, np.float32)

    def _brightest(self) -> float:
        """Signal of a white surface that faced all directional lights at once, in the brightest of episodes."""
        variation = self._simulation.variation
        if variation is None or not variation.of_light:
            return self.renderer.brightest
        return max(self.renderer.brightest_in(light) for light in variation.extremes(self._wavelengths))
