"""What one kind of eyes of one animal sees, in all worlds, noise included."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from sim.envs.observation import ROUNDING, SIGMAS, Memory
from sim.envs.task_worlds import TaskWorlds
from sim.render.fidelity import Fidelity
from sim.render.model_renderer import ModelRenderer
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import NoiseModel, Normals
from sim.scene.poses import Poses
from sim.tasks.eye_kinds import EyeKind


class EyesOfKind:
    """Of these worlds.

    kind: of eyes · fidelity: how finely they see · keys: of their noise, one of each world
    memory: frames in an observation
    renderer: the eyes · space: of what one world's observation holds of them
    """

    def __init__(self, worlds: TaskWorlds, kind: EyeKind, fidelity: Fidelity, keys: np.ndarray, memory: int) -> None:
        seen = {"spectra": worlds.spectra, "varied": worlds.bodies.varied}
        self.renderer = ModelRenderer(worlds.model, kind.eye, kind.mounts, len(worlds.datas), fidelity, **seen)
        self._worlds, self._wavelengths = worlds, np.asarray(self.renderer.eye.spectral_bands.wavelengths)
        self.memory, self._noise = Memory(memory), NoiseModel.of(self.renderer.eye)
        frame = (len(kind.mounts), self.renderer.eye.channels, *self.renderer.eye.resolution)
        self._normals = Normals(keys, frame)
        self.space = self._space((memory, *frame))

    def restart(self, keys: np.ndarray) -> None:
        """Draw noise from its beginning."""
        self._normals.restart(keys)

    def begin(self, poses: Poses, worlds: np.ndarray) -> PendingFrame:
        """Begin to see these worlds, noise included: no other world's noise goes on."""
        looking = self.renderer.begin(poses, self._worlds.light(self._wavelengths))
        normals = self._normals.begin(worlds)

        def noisy(seen: np.ndarray) -> np.ndarray:
            return seen[worlds] if self._noise is None else self._noise(seen[worlds], normals.wait())

        return looking.then(noisy)

    def state(self) -> dict[str, np.ndarray]:
        """What its future follows from, beside its worlds."""
        return {"remembered": self.memory.held, "noise": self._normals.place}

    def bring_back(self, remembered: np.ndarray, noise: np.ndarray) -> None:
        """Inverse of `state`."""
        self.memory.hold(remembered)
        self._normals.go_on_from(noise)

    def _space(self, frames: tuple[int, ...]) -> spaces.Box:
        brightest, spread = self._brightest(), 0.0
        if self._noise is not None:
            spread = self._noise.largest(brightest)
        margin = SIGMAS * spread + ROUNDING * brightest
        # Lights at points are brighter the nearer they are.
        high = 2 * brightest + margin if self.renderer.only_directional else np.inf
        return spaces.Box(-margin if np.isfinite(high) else -np.inf, high, frames, np.float32)

    def _brightest(self) -> float:
        """Signal of a white surface that faced all directional lights at once, in the brightest of episodes."""
        variation = self._worlds.variation
        if variation is None:
            return self.renderer.brightest
        return max(self.renderer.brightest_in(light) for light in variation.extremes(self._wavelengths))
