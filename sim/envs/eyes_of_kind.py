"""Signals of an agent's eyes of the same kind, in all worlds, with noise and receptor dynamics."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from sim.envs.frame_choice import dynamics_of, require_frames
from sim.envs.observation import ROUNDING, SIGMAS, Memory
from sim.envs.ommatidia_space import OmmatidiaBox
from sim.eyes.compound_eye import CompoundEye
from sim.render.eye_renderer import EyeRenderer
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import NoiseModel, Normals
from sim.render.receptors_in_time import ReceptorsInTime
from sim.scene.poses import Poses
from sim.tasks.simulation import Simulation

UNCHANGED = ("none", None, "none")  # adaptation, events and motion of receptors whose responses have bounds


class EyesOfKind:
    """Renderer, noise and memory of one kind of eyes.

    simulation: the worlds
    renderer: renderer of the eyes
    keys: keys of the random generators of the noise, one for each world
    memory: number of frames in an observation
    space: attribute, space of the eyes' signals in one world's observation
    """

    def __init__(self, simulation: Simulation, renderer: EyeRenderer, keys: np.ndarray, memory: int) -> None:
        self.renderer, self._simulation, self._everyone = renderer, simulation, np.arange(simulation.n)
        self._wavelengths = np.asarray(renderer.eye.spectral_bands.wavelengths)
        self.memory, self._noise = Memory(memory), NoiseModel.from_eye(renderer.eye)
        receptors = (len(renderer.mounts), renderer.eye.channels, *renderer.eye.resolution)
        self._normals: Normals = Normals(keys, receptors)
        self._in_time: ReceptorsInTime | None = None
        self._shot: NoiseModel | None = None
        eye = renderer.eye
        # A compound eye without rows is observed as a list of ommatidia, and every other eye as an image.
        self._ommatidia = eye if isinstance(eye, CompoundEye) and eye.rows is None else None
        frame = receptors if self._ommatidia is None else self._ommatidia.as_frames(np.empty(receptors)).shape
        if (dynamics := dynamics_of(renderer.eye)) is not None:
            frames = renderer.fidelity.frames or 1
            require_frames(simulation, frames)
            seconds = simulation.physics.seconds / frames
            self._in_time = ReceptorsInTime(dynamics, simulation.n, receptors, seconds)
            budget = renderer.eye.photon_budget
            share = 1.0 if budget is None else seconds / budget.integration_time
            self._shot, self._noise = (None, None) if self._noise is None else self._noise.in_frames(share)
            frame = (frame[0], frame[1] * self._in_time.channels, *frame[2:])
        self.space = self._space((memory, *frame))

    def restart(self, keys: np.ndarray) -> None:
        """Restart the random generators of the noise with these keys, (world,) uint64."""
        self._normals.restart(keys)

    def launch(self, poses: Poses, worlds: np.ndarray | None = None, fresh: bool = False) -> PendingFrame:
        """Launch the rendering of these worlds (None: all), including noise and the dynamics of receptors.

        The random generators of the other worlds do not advance.

        fresh: True if these worlds begin an episode
        """
        if self._in_time is not None:
            return self._launch_in_time(self._in_time, poses, worlds, fresh)
        light = self._simulation.light(self._wavelengths)
        seen = self.renderer.launch(poses, light) if worlds is None else self.renderer.launch_some(poses, worlds, light)
        noise = self._noise
        if noise is not None:
            normals, noiseless = self._normals.launch(worlds), seen
            seen = noiseless.then(lambda signals: noise(signals, normals.wait()))
        return seen if self._ommatidia is None else seen.then(self._ommatidia.as_frames)

    def _launch_in_time(
        self, receptors: ReceptorsInTime, poses: Poses, worlds: np.ndarray | None, fresh: bool
    ) -> PendingFrame:
        """Launch the rendering of the frame at the end of an action. The result is the receptors' response to it.

        Before that, this method renders the frames at earlier moments of the action, and the receptors respond to each
        of them in turn. There are no earlier frames if these worlds begin an episode (`fresh`). If `worlds` is given
        and `fresh` is False, only the last frame of these worlds is rendered again. The receptors then return to their
        state before that frame and respond to the new rendering.
        """
        light = self._simulation.light(self._wavelengths)
        first, chosen = fresh or worlds is not None, self._everyone if worlds is None else worlds
        passed = [] if first else getattr(self._simulation.physics, "passed", [])
        for earlier in passed:
            receptors.step(self._with_shot_noise(self.renderer.signals(earlier, light), chosen), chosen)
        if not first:
            receptors.store(chosen)
        seen = self.renderer.launch(poses, light) if worlds is None else self.renderer.launch_some(poses, worlds, light)

        def finish(signals: np.ndarray) -> np.ndarray:
            if fresh:
                receptors.start(signals, chosen)
            elif worlds is not None:
                receptors.undo(chosen)
            found = receptors.step(self._with_shot_noise(signals, chosen), chosen)
            receptors.reset_counts(chosen)
            return found if self._noise is None else self._noise(found, self._normals_of(chosen, found.shape))

        return seen.then(finish)

    def _with_shot_noise(self, signals: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        return signals if self._shot is None else self._shot(signals, self._normals.launch(worlds).wait())

    def _normals_of(self, worlds: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """Return normally distributed numbers of this shape for the noise.

        They are 0 for the outputs of motion detectors, to which no noise is added.

        worlds: indices of the worlds, which determine the random generators
        """
        drawn = self._normals.launch(worlds).wait()
        return np.concatenate([drawn, np.zeros_like(drawn)], axis=2) if drawn.shape != shape else drawn

    def get_state(self) -> dict[str, np.ndarray]:
        """Return all arrays, except the state of the worlds, on which future signals depend."""
        found = {"remembered": self.memory.frames_held, "noise": self._normals.place}
        return found if self._in_time is None else {**found, "receptors": self._in_time.state.copy()}

    def set_state(self, remembered: np.ndarray, noise: np.ndarray, receptors: np.ndarray | None = None) -> None:
        """Restore a state from `get_state`."""
        self.memory.restore(remembered)
        self._normals.go_on_from(noise)
        if self._in_time is not None and receptors is not None:
            self._in_time.state[:] = receptors

    def _space(self, frames: tuple[int, ...]) -> spaces.Box:
        dynamics = dynamics_of(self.renderer.eye)
        if dynamics is not None and (dynamics.adaptation, dynamics.event_threshold, dynamics.motion) != UNCHANGED:
            return spaces.Box(-np.inf, np.inf, frames, np.float32)
        brightest = self._brightest()
        spread = sum(noise.largest(brightest) for noise in (self._noise, self._shot) if noise is not None)
        margin = SIGMAS * spread + ROUNDING * brightest
        # The light from a point light has no upper bound, because it increases as the distance to the light decreases.
        high = 2 * brightest + margin if self.renderer.only_directional else np.inf
        low = -margin if np.isfinite(high) else -np.inf
        if self._ommatidia is not None:
            return OmmatidiaBox(low, high, frames, self._ommatidia.directions_on(self.renderer.mounts))
        return spaces.Box(low, high, frames, np.float32)

    def _brightest(self) -> float:
        """Return the larger of the signals of veiling light and of a white surface that faces all directional lights.

        If light varies from episode to episode, return the largest such signal at the limits of the ranges of the light
        (`Variation.extremes`).
        """
        variation = self._simulation.variation
        if variation is None or not variation.of_light:
            return self.renderer.brightest
        return max(self.renderer.brightest_in(light) for light in variation.extremes(self._wavelengths))
