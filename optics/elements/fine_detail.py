"""Spatial frequencies in samples over a square, for the resolution of grids and the extent of scattered light."""

from __future__ import annotations

import numpy as np

__all__ = ["band_of", "power_beyond", "reach_of"]

CUBIC = 4  # coefficients along an axis of a single B-spline patch, which slopes describe well


def band_of(samples: np.ndarray, level: float) -> float:
    """Frequency [cycles per half a side] above which the samples' spectrum stays below `level`.

    A cubic spline repeats content of frequency f around multiples of the sampling rate, weaker by the fourth power of
    the ratio of the two frequencies.
    """
    n = len(samples)
    if n < 4:
        return 1.0
    window = np.hanning(n + 2)[1:-1]
    residue = samples - _plane(samples)
    spectrum = np.abs(np.fft.fft2(residue * window[:, None] * window)) / n
    frequency = np.abs(np.fft.fftfreq(n, 2 / n))
    radial = np.maximum(frequency[:, None], frequency[None, :])
    order = np.argsort(radial, axis=None)[::-1]
    power = np.cumsum((spectrum.ravel()[order] / n) ** 2)
    reached = radial.ravel()[order][int(np.searchsorted(power, level**2).clip(max=power.size - 1))]
    images = (np.sum((spectrum / n * radial**4) ** 2) / level**2) ** 0.125
    return float(max(1.0, reached, images if images > n / 2 - reached else 0.0))


def power_beyond(samples: np.ndarray) -> np.ndarray:
    """Mean squares (n,) of the content at frequencies from k/4 cycles per half a side, along x or y, for k from 0.

    The nearest bicubic polynomial is subtracted first: it bends light according to its slopes and scatters none. The
    transform is a cosine transform, whose even continuation has no jumps, so the ends add no detail.
    """
    from scipy.fft import dctn

    n = len(samples)
    if n <= CUBIC:
        return np.zeros(n)
    basis = np.linalg.qr(np.vander(np.linspace(-1, 1, n), CUBIC))[0]
    residue = samples - basis @ (basis.T @ samples @ basis) @ basis.T
    power = np.square(dctn(residue, norm="ortho")) / n**2
    farthest = np.maximum.outer(np.arange(n), np.arange(n))
    found: np.ndarray = np.cumsum(np.bincount(farthest.ravel(), power.ravel(), n)[::-1])[::-1]
    return found


def reach_of(beyond: np.ndarray, level: float) -> float:
    """Frequency [cycles per half a side] beyond which the root mean square is below `level`; see `power_beyond`."""
    more = np.flatnonzero(beyond > level**2)
    return float(more[-1]) / 4 if more.size else 0.0


def _plane(samples: np.ndarray) -> np.ndarray:
    """Least-squares plane through the samples."""
    position = np.linspace(-1, 1, len(samples))
    slope = position / np.sum(position**2) / len(samples)
    return samples.mean() + (slope @ samples.sum(axis=1)) * position[:, None] + (samples.sum(axis=0) @ slope) * position
