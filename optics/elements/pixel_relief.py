"""Reliefs of square pixels with one height each, as produced by lithography and spatial light modulators."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from optics.apertures.aperture import Aperture
from optics.elements.relief import Relief
from optics.elements.square_samples import square_samples
from optics.numerics.array_library import gather, indices, library, like
from optics.numerics.autodiff import Array, is_differentiable

__all__ = ["PixelRelief"]

REPETITIONS = 32  # choice: repetitions of the pixels' spectrum to include; at most 1/(π² 32) of the light lies beyond


@dataclass(frozen=True, eq=False)
class PixelRelief(Relief):
    """Heights [m] of n x n square pixels that fill the square around the pupil: a stepped diffractive element.

    samples: heights [m], (n, n), (y, x). To wrap a smooth height h to one wave and quantise it to N levels, use
        `np.round(h / step) % N * step`. For glass of index n in air, step = wavelength / (n - 1) / N.

    A Dr.Jit or PyTorch tensor may carry derivatives. For smooth surfaces use `HeightMap`, which interpolates.

    Raises:
        ValueError: the array is not square, is empty, is of half precision, or contains anything other than finite real
            numbers.
    """

    samples: np.ndarray | Array
    _heights: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        heights = square_samples(self.samples)
        object.__setattr__(self, "_heights", heights)
        if not is_differentiable(self.samples):
            object.__setattr__(self, "samples", heights)

    def height(self, x: Array, y: Array) -> Array:
        own, n = library(x), len(self._heights)
        column, row = (own.clip(own.floor((place + 1) * (n / 2)), 0, n - 1) for place in (x, y))
        return gather(like(x, self.samples), indices(row * n + column))

    @property
    def span(self) -> float:
        return float(np.ptp(self._heights))

    def bandwidth(self, level: float) -> float:
        """Return infinity, because the jumps between pixels have components at all frequencies.

        The result is 0 if all heights are equal and carry no derivatives. `level` has no effect.
        """
        return 0.0 if self._level else math.inf

    def detail(self, level: float) -> float:
        """Return 0: detail is not counted here, because `scatter` includes all light that the pixels scatter."""
        return 0.0

    def scatter(self, turns: float, opening: Aperture, share: float) -> float:
        """Return the frequency [cycles per radius] beyond which at most a fraction `share` of the light is scattered.

        At most `share` / 2 lies beyond this frequency along x, and at most `share` / 2 along y. The discrete Fourier
        transform of the transmittance, with one sample per pixel, gives a power spectrum. This spectrum is repeated
        periodically, up to 32 times on either side, and then multiplied by sinc², the power spectrum of one pixel. The
        product is the power spectrum of the light behind the pupil. The result is infinity if more than `share` / 2 of
        the light lies beyond the last repetition along x or along y. It is 0 if all heights within the aperture are
        equal.

        turns: phase in waves per metre of height [1/m].
        opening: aperture of the pupil.
        share: the fraction, relative to the light that passes the opening.
        """
        n = len(self._heights)
        centres = (np.arange(n) + 0.5) * 2 / n - 1
        x, y = centres[None, :], centres[:, None]
        inside, reached = opening.contains(x, y), opening.contains(x, y) | opening.outline.near(x, y, 1 / n)
        if np.ptp(self._heights[reached]) == 0:
            return 0.0
        wave = np.where(inside if inside.any() else reached, np.exp(2j * np.pi * turns * self._heights), 0)
        return max(
            _reach(np.square(np.abs(np.fft.fft(wave, axis=axis))).sum(axis=1 - axis), share / 2) for axis in (0, 1)
        )

    @property
    def knots(self) -> int:
        return 1

    @property
    def pixels(self) -> int:
        """Number of pixels along a side; 0 if all heights are equal and no derivatives are requested."""
        return 0 if self._level else len(self._heights)

    @property
    def rotationally_symmetric(self) -> bool:
        return self._level

    @property
    def _level(self) -> bool:
        return not is_differentiable(self.samples) and bool(np.ptp(self._heights) == 0)


def _reach(power: np.ndarray, share: float) -> float:
    """Return the frequency [cycles per radius] beyond which at most the fraction `share` of the power lies.

    The spectrum `power` is first repeated periodically, up to 32 times (REPETITIONS) on either side. It is then
    multiplied by sinc², the power spectrum of one pixel. The result is infinity if more than `share` of the power lies
    beyond the last repetition.

    power: discrete power spectrum of values with one sample per pixel.
    """
    n = len(power)
    order = np.arange(-(n // 2) - n * REPETITIONS, n - n // 2 + n * REPETITIONS)
    sent = power[order % n] * np.sinc(order / n) ** 2
    outwards = np.argsort(np.abs(order), kind="stable")
    beyond = 1 - np.cumsum(sent[outwards]) / power.sum()
    within = np.flatnonzero(beyond <= share)
    return float(np.abs(order[outwards[within[0]]]) / 2) if within.size else math.inf
