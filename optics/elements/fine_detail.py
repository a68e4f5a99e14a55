"""Spatial frequencies that samples over a square contain.

They determine the resolution of grids and the extent of scattered light.
"""

from __future__ import annotations

import numpy as np

__all__ = ["band_of", "power_beyond", "reach_of"]

CUBIC = 4  # coefficients of a cubic polynomial along an axis; slopes alone describe such a surface well


def band_of(samples: np.ndarray, level: float) -> float:
    """Return the frequency [cycles per half a side] above which the samples vary by less than `level` (rms).

    Interpolation by cubic splines repeats a component of frequency f around multiples of the sampling rate. A copy at
    the frequency F is weaker by the factor (f/F)⁴.
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
    """Return the samples' power spectrum, summed from each frequency upwards: mean squares (n,).

    Entry k contains all components whose frequency along x or along y is at least k/4 cycles per half a side.

    The best-fitting bicubic polynomial is subtracted first: it bends light according to its slopes and scatters none. A
    cosine transform is used, because its even continuation has no jumps. The ends of the samples therefore add no high
    frequencies.
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
    """Return the frequency [cycles per half a side] beyond which the samples vary by less than `level` (rms).

    beyond: result of `power_beyond`.
    """
    more = np.flatnonzero(beyond > level**2)
    return float(more[-1]) / 4 if more.size else 0.0


def _plane(samples: np.ndarray) -> np.ndarray:
    """Return the least-squares plane through the samples."""
    position = np.linspace(-1, 1, len(samples))
    slope = position / np.sum(position**2) / len(samples)
    return samples.mean() + (slope @ samples.sum(axis=1)) * position[:, None] + (samples.sum(axis=0) @ slope) * position
