"""Signals of one kind of an agent's eyes in all worlds, including noise."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from sim.envs.observation import ROUNDING, SIGMAS, Memory
from sim.envs.ommatidia_space import OmmatidiaBox
from sim.eyes.compound_eye import CompoundEye
from sim.render.eye_renderer import EyeRenderer
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import NoiseModel, Normals
from sim.scene.poses import Poses
from sim.tasks.simulation import Simulation


class EyesOfKind:
    """Renderer, noise and memory of one kind of eyes.

    simulation: the worlds
    renderer: renderer of the eyes
    keys: keys of the random generators of the noise, one for each world
    memory: number of frames in an observation
    space: space of these signals in one world's observation
    """

    def __init__(self, simulation: Simulation, renderer: EyeRenderer, keys: np.ndarray, memory: int) -> None:
        self.renderer, self._simulation = renderer, simulation
        self._wavelengths = np.asarray(renderer.eye.spectral_bands.wavelengths)
        self.memory, self._noise = Memory(memory), NoiseModel.from_eye(renderer.eye)
        receptors = (len(renderer.mounts), renderer.eye.channels, *renderer.eye.resolution)
        self._normals = Normals(keys, receptors)
        self.space = self._space((memory, *self._as_frames(np.empty(receptors)).shape))

    def restart(self, keys: np.ndarray) -> None:
        """Restart the random generators of the noise with these keys."""
        self._normals.restart(keys)

    def launch(self, poses: Poses, worlds: np.ndarray | None = None) -> PendingFrame:
        """Launch the rendering of these worlds (None: all), including noise.

        The random generators of the other worlds do not advance.
        """
        light = self._simulation.light(self._wavelengths)
        if worlds is None:
            seen = self.renderer.launch(poses, light)
            worlds = np.arange(self._simulation.n)
        else:
            seen = self.renderer.launch_some(poses, worlds, light)
        noise = self._noise
        if noise is not None:
            normals, noiseless = self._normals.launch(worlds), seen
            seen = noiseless.then(lambda signals: noise(signals, normals.wait()))
        return seen.then(self._as_frames)

    def _as_frames(self, signals: np.ndarray) -> np.ndarray:
        """Return signals (..., eye, channel, h, w) in the form of an observation."""
        eye = self.renderer.eye
        return eye.as_frames(signals) if isinstance(eye, CompoundEye) else signals

    def get_state(self) -> dict[str, np.ndarray]:
        """Return all arrays on which future signals depend, apart from the state of the worlds."""
        return {"remembered": self.memory.frames_held, "noise": self._normals.place}

    def set_state(self, remembered: np.ndarray, noise: np.ndarray) -> None:
        """Restore a state from `get_state`."""
        self.memory.restore(remembered)
        self._normals.go_on_from(noise)

    def _space(self, frames: tuple[int, ...]) -> spaces.Box:
        brightest = self._brightest()
        spread = 0.0 if self._noise is None else self._noise.largest(brightest)
        margin = SIGMAS * spread + ROUNDING * brightest
        # The light from a point light has no upper bound, because it increases as the distance to the light decreases.
        high = 2 * brightest + margin if self.renderer.only_directional else np.inf
        low, eye = -margin if np.isfinite(high) else -np.inf, self.renderer.eye
        if isinstance(eye, CompoundEye):
            return OmmatidiaBox(low, high, frames, eye.directions_on(self.renderer.mounts))
        return spaces.Box(low, high, frames, np.float32)

    def _brightest(self) -> float:
        """Return the signal of a white surface that faces all directional lights at once.

        If light varies, the surface is in the brightest light that can be drawn.
        """
        variation = self._simulation.variation
        if variation is None or not variation.of_light:
            return self.renderer.brightest
        return max(self.renderer.brightest_in(light) for light in variation.extremes(self._wavelengths))
