"""What the eyes of all agents report, noise included: begun early, waited for late, beside other work."""

from __future__ import annotations

import numpy as np

from sim.render.batched_renderer import BatchedRenderer
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import NoiseModel, Normals
from sim.worlds.state import WorldState


class NoisySignals:
    """Renderer and receptor noise of one batch of worlds.

    renderer: of all worlds
    keys: of their noise, (n,) uint64
    spread: largest standard deviation of a signal's noise
    level: of the light in each world, (n,), of which signals are as large a share; None: 1 everywhere

    Frames hold signals (env, eye, channel, height, width) float32.
    """

    def __init__(self, renderer: BatchedRenderer, keys: np.ndarray) -> None:
        self.renderer = renderer
        self._noise = NoiseModel.of(renderer.eye)
        self.level: np.ndarray | None = None
        self.spread = self._noise.largest(renderer.brightest) if self._noise else 0.0
        frame = (renderer.eyes.n_eyes, renderer.eye.channels, *renderer.eyes.resolution)
        self._normals = Normals(keys, frame) if self._noise else None

    def restart(self, keys: np.ndarray) -> None:
        """Noise from its first frame on, under these keys (n,)."""
        if self._normals:
            self._normals.restart(keys)

    def begin(self, state: WorldState) -> PendingFrame:
        """Look at all worlds."""
        return self._noisy(self.renderer.begin(state, self._light()), np.arange(state.n))

    def begin_some(self, state: WorldState, worlds: np.ndarray) -> PendingFrame:
        """Look at these of the worlds alone; if they are few, beside a look at all that is under way."""
        return self._noisy(self.renderer.begin_some(state, worlds, self._light()), worlds)

    def _light(self) -> np.ndarray | None:
        """Factors of the bands in all worlds."""
        return None if self.level is None else np.repeat(self.level[:, None], self.renderer.eye.bands, axis=1)

    def _noisy(self, signals: PendingFrame, worlds: np.ndarray) -> PendingFrame:
        """Signals of these worlds, and their noise."""
        noise = self._noise
        if noise is None or self._normals is None:
            return signals
        normals = self._normals.begin(worlds)
        return signals.then(lambda seen: noise(seen, normals.wait()))
