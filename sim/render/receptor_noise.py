"""Receptor noise for many worlds at once: kernels draw standard normal numbers with the generator Philox.

The kernels are recorded once and then replayed. A counter-based generator such as Philox (Salmon et al. 2011) needs
only a key per world and the number of drawn frames as its state. A world's noise therefore depends on the world's own
seed and history, and not on other worlds.

This noise has the same mean, and nearly the same variance and third moment, as the noise of `optics.Eye.see`. That
method draws numbers of photons (`optics.eye.photoreceptor`).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.compound_eye import WorldEye
from sim.render.pending_frame import FrameSlot, PendingFrame
from sim.scene.device_arrays import SharedBuffer
from sim.scene.frozen_kernels import GarbageKept
from sim.scene.variant import default_variant, variant

PER_DRAW = 4  # number of normal numbers that one evaluation of Philox4x32 gives
FEW = 8  # number of worlds of a second, narrower kernel


class Normals:
    """Standard normal numbers for the noise of receptors, from a random generator for each world.

    Each draw gives a frame, which contains one number for each receptor of a world.

    keys: key of each world's generator (Philox), array (world,) uint64
    shape: shape of one world's receptors, and of each frame
    """

    def __init__(self, keys: np.ndarray, shape: tuple[int, ...]) -> None:
        self._shape, self._size = shape, math.prod(shape)
        self.restart(keys)
        self._draws = -(-self._size // PER_DRAW)
        self._kernels: dict[int, _Kernel] = {}

    def restart(self, keys: np.ndarray) -> None:
        """Set the random generators to these keys, so that the next frame that is drawn is the first.

        keys: key of each world's generator, array (world,)
        """
        self._keys, self._frames = keys, np.zeros(len(keys), np.uint32)

    @property
    def place(self) -> np.ndarray:
        """State of every world's random generator, array (world, 2) uint64.

        It consists of the generator's key and the number of frames drawn so far. A frame contains one random number for
        each receptor of the world.
        """
        return np.stack([self._keys, self._frames.astype(np.uint64)], axis=1)

    def go_on_from(self, place: np.ndarray) -> None:
        """Restore the state of every world's random generator.

        place: value of the property `place` at an earlier time, array (world, 2)
        """
        self._keys, self._frames = place[:, 0].astype(np.uint64), place[:, 1].astype(np.uint32)

    def launch(self, worlds: np.ndarray | None = None) -> PendingFrame:
        """Start drawing the next random numbers of these worlds (None: all), one number for each receptor.

        The kernel runs asynchronously. The numbers are an array (len(worlds), *shape) float32.
        """
        n, chosen = len(self._keys), slice(None) if worlds is None else worlds
        count = n if worlds is None else len(worlds)
        width = FEW if count <= FEW < n else n
        if width not in self._kernels:
            self._kernels[width] = _Kernel(width, self._draws)
        padded = chosen if worlds is None or count == width else np.resize(worlds, width)
        drawn = self._kernels[width].launch(
            self._keys[padded], self._frames[padded], lambda parts: self._frame(parts, count)
        )
        self._frames[chosen] += 1
        return drawn

    def _frame(self, parts: list[Array], n: int) -> np.ndarray:
        """Return the random numbers of the first n worlds, (n, *shape).

        parts: output arrays of the kernel, each flat (world, draw)
        """
        ends = (max(self._size - k * self._draws, 0) for k in range(len(parts)))  # columns of each part in use
        used = [part.numpy().reshape(-1, self._draws)[:n, :end] for part, end in zip(parts, ends, strict=True)]
        return np.concatenate(used, axis=1).reshape(n, *self._shape)


class _Kernel:
    """A kernel that draws standard normal numbers for a fixed number of worlds.

    A frame contains one number for each receptor of a world. The kernel has its own input buffers: one for the keys of
    the worlds' random generators, and one for the indices of the frames to draw.

    worlds: number of worlds
    draws: number of evaluations of the generator in each world; one evaluation gives four normal numbers
    """

    def __init__(self, worlds: int, draws: int) -> None:
        self._slot, self._variant = FrameSlot(), default_variant()
        with variant(self._variant):
            index: Array = dr.uint32_array_t(dr.detached_t(mi.Float))
            self._keys, self._frames = SharedBuffer(worlds, dr.uint64_array_t(index)), SharedBuffer(worlds, index)
            self._lanes = dr.arange(index, worlds * draws)
            dr.eval(self._lanes)

        def normals(keys: Array, frames: Array, lane: Array) -> Array:
            module = sys.modules[type(lane).__module__]
            world = lane // draws
            random = module.Philox4x32(
                dr.gather(type(keys), keys, world), dr.gather(type(frames), frames, world), lane - world * draws
            )
            return list(random.next_float32x4_normal())

        self._normals: Any = dr.freeze(normals)

    def launch(
        self, keys: np.ndarray, frames: np.ndarray, frame_of: Callable[[list[Array]], np.ndarray]
    ) -> PendingFrame:
        """Start drawing standard normal numbers, one frame for each world.

        A frame contains one number for each receptor of the world.

        keys, frames: key of each world's random generator, and index of the frame to draw, arrays (world,)
        frame_of: function that converts the kernel's output arrays on the device to the values of the frames
        """

        def launch() -> Callable[[], np.ndarray]:
            self._keys.values[:], self._frames.values[:] = keys, frames
            with variant(self._variant), GarbageKept():
                parts = self._normals(self._keys.array, self._frames.array, self._lanes)
            return lambda: frame_of(parts)

        return self._slot.launch(launch)


@dataclass(frozen=True)
class NoiseModel:
    """The noise of a signal s: variance V = σ² + s / N, with N the number of photons for a signal of 1.

    sigma: standard deviation of the Gaussian part
    photons: N, broadcast against signals (..., channel, h, w); None: no shot noise
    """

    sigma: float
    photons: np.ndarray | None = None

    @classmethod
    def from_eye(cls, eye: WorldEye) -> NoiseModel | None:
        """Return the noise of an eye; None if it has no noise."""
        photons = eye.receptor_photons
        if photons is None:
            return cls(eye.noise_sigma) if eye.noise_sigma > 0 else None
        return cls(eye.noise_sigma, photons.astype(np.float32))

    def in_frames(self, share: float) -> tuple[NoiseModel | None, NoiseModel | None]:
        """Return the shot noise of a frame that lasts a part of the integration time, and the remaining noise.

        Each is None if it is 0. Receptors with dynamics (`optics.ReceptorDynamics`) filter their signals in time, and
        so sum the photons of several frames. Shot noise is added before these filters, the remaining noise after them.

        share: duration of the frame, as a fraction of the integration time
        """
        shot = None if self.photons is None else NoiseModel(0.0, (self.photons * share).astype(np.float32))
        return shot, NoiseModel(self.sigma) if self.sigma > 0 else None

    def largest(self, brightest: float) -> float:
        """Return the largest standard deviation that the noise has in any receptor if its signal is 2 * `brightest`.

        An observation's upper limit is this signal and a margin for the noise.
        """
        shot = 0.0 if self.photons is None else 2 * brightest / float(self.photons.min())
        return math.sqrt(self.sigma**2 + shot)

    def __call__(self, signals: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the signals with noise, computed from standard normal numbers of the same shape, (n, ...).

        A signal s with the normal number z becomes s + √V z + (s / N²) (z² - 1) / (6 V), where V is the variance of the
        noise and N the number of photons for a signal of 1 (Cornish & Fisher 1938). The last term gives shot noise
        nearly the third moment of the Poisson distribution, which matters below a hundred photons.

        normals: the numbers z; this method may overwrite them
        """
        if self.photons is None:
            normals *= np.float32(self.sigma)
            normals += signals
            return normals
        light = np.maximum(signals, 0) / self.photons
        variance = np.maximum(light + np.float32(self.sigma**2), np.finfo(np.float32).tiny)
        skewed: np.ndarray = light / self.photons * (normals * normals - 1) / (6 * variance)
        noisy: np.ndarray = signals + np.sqrt(variance) * normals + skewed
        return noisy
