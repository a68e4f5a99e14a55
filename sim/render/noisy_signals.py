"""What the eyes of all agents report, noise included: begun early, waited for late, beside other work."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from sim.render.batched_renderer import BatchedRenderer
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import FEW, NoiseModel, Normals
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

    @cached_property
    def _few(self) -> BatchedRenderer:
        """For a few of the worlds."""
        return self.renderer.resized(FEW)

    def restart(self, keys: np.ndarray) -> None:
        """Noise from its first frame on, under these keys (n,)."""
        if self._normals:
            self._normals.restart(keys)

    def begin(self, state: WorldState) -> PendingFrame:
        """Look at all worlds."""
        return self._noisy(self.renderer.begin(state), slice(None), np.arange(state.n))

    def begin_some(self, state: WorldState, worlds: np.ndarray) -> PendingFrame:
        """Look at these of the worlds alone; if they are few, beside a look at all that is under way."""
        if len(worlds) <= FEW < state.n:
            signals = self._few.begin(state.take(np.resize(worlds, FEW)))
            return self._noisy(signals, slice(len(worlds)), worlds)
        return self._noisy(self.renderer.begin(state), worlds, worlds)

    def _noisy(self, signals: PendingFrame, rows: np.ndarray | slice, worlds: np.ndarray) -> PendingFrame:
        """These rows of the signals, and on them the noise of these worlds."""
        if self.level is not None:
            level = self.level[worlds].astype(np.float32)[:, None, None, None, None]
            return self._with_noise(signals.then(lambda seen: seen[rows] * level), slice(None), worlds)
        return self._with_noise(signals, rows, worlds)

    def _with_noise(self, signals: PendingFrame, rows: np.ndarray | slice, worlds: np.ndarray) -> PendingFrame:
        noise = self._noise
        if noise is None or self._normals is None:
            return signals.then(lambda seen: seen[rows])
        normals = self._normals.begin(worlds)
        return signals.then(lambda seen: noise(seen[rows], normals.wait()))
