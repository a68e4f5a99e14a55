"""What all agents' retinas report, noise included: begun early, waited for late, beside other work."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from sim.render.batched_renderer import BatchedRenderer
from sim.render.receptor_noise import FEW, NoiseModel, Normals
from sim.worlds.state import WorldState

Pending = Callable[[], np.ndarray]  # waits for signals (env, eye, channel, height, width) float32


class NoisySignals:
    """Renderer and receptor noise of one batch of worlds.

    renderer: of all worlds
    keys: of their noise, (n,) uint64
    spread: largest standard deviation of a signal's noise
    """

    def __init__(self, renderer: BatchedRenderer, keys: np.ndarray) -> None:
        self.renderer = renderer
        self._noise = NoiseModel.of(renderer.eye)
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

    def begin(self, state: WorldState) -> Pending:
        """Look at all worlds; to be waited for before the next look at all."""
        return self._noisy(self.renderer.begin(state), slice(None), np.arange(state.n))

    def begin_some(self, state: WorldState, worlds: np.ndarray) -> Pending:
        """Look at these of the worlds alone, perhaps beside a look at all; to be waited for after that one, and before
        the next look at some."""
        if len(worlds) <= FEW < state.n:
            signals = self._few.begin(state.take(np.resize(worlds, FEW)))
            return self._noisy(signals, slice(len(worlds)), worlds)
        # Kernels and buffers are those of `begin`: this cannot run beside it.
        return lambda: self._noisy(self.renderer.begin(state), worlds, worlds)()

    def _noisy(self, signals: Pending, rows: np.ndarray | slice, worlds: np.ndarray) -> Pending:
        """These rows of the signals, and on them the noise of these worlds."""
        normals = self._normals.begin(worlds) if self._normals else None

        def wait() -> np.ndarray:
            seen = signals()[rows]
            return self._noise(seen, normals.values()) if self._noise and normals else seen

        return wait
