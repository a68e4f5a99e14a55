"""Highest spatial frequencies of a map that is sampled over a square, such as a relief, wavefront or mask.

They determine how fine a grid must be and how far light is scattered. Frequencies are in units of 1/h, where h is half
the side of the square. If the square encloses the pupil, h is the pupil's radius.
"""

from __future__ import annotations

import numpy as np

__all__ = ["band_of", "power_beyond", "reach_of"]

CUBIC = 4  # coefficients of a cubic polynomial along an axis; slopes alone describe such a surface well


def band_of(samples: np.ndarray, level: float) -> float:
    """Return the frequency above which a map's variation has a root mean square of less than `level`.

    The map is sampled over a square. The unit is one cycle per half the side of the square. The result is at least 1.
    Interpolation by cubic splines repeats a component of frequency f around multiples of the sampling rate. A copy at
    the frequency F is weaker by the factor (f/F)⁴.

    samples: values of the map, array (row, column).
    """
    if max(samples.shape) < 4:
        return 1.0
    down, across = (np.hanning(n + 2)[1:-1] for n in samples.shape)
    residue = samples - _plane(samples)
    spectrum = np.abs(np.fft.fft2(residue * down[:, None] * across)) / samples.size
    fy, fx = (np.abs(np.fft.fftfreq(n, 2 / n)) for n in samples.shape)
    radial = np.maximum(fy[:, None], fx[None, :])
    order = np.argsort(radial, axis=None)[::-1]
    power = np.cumsum(spectrum.ravel()[order] ** 2)
    reached = radial.ravel()[order][int(np.searchsorted(power, level**2).clip(max=power.size - 1))]
    images = (np.sum((spectrum * radial**4) ** 2) / level**2) ** 0.125
    return float(max(1.0, reached, images if images > min(samples.shape) / 2 - reached else 0.0))


def power_beyond(samples: np.ndarray) -> np.ndarray:
    """Return, for each frequency, the power (mean square) of a map's components at this frequency and above.

    The map is sampled over a square. Half the side of the square is the unit of length. Each component has one
    frequency along x and one along y. Entry k of the result is the total power of all components for which the larger
    of these frequencies is at least k/4 cycles per unit of length. The result has one entry for each sample along the
    axis with more samples.

    The best-fitting bicubic polynomial is subtracted first, because a polynomial bends light and does not scatter it.
    The cosine transform continues the samples by their mirror images, without jumps. The ends of the samples therefore
    add no high frequencies.

    samples: values of the map, array (row, column).
    """
    from scipy.fft import dctn

    n = max(samples.shape)
    if n <= CUBIC:
        return np.zeros(n)
    down, across = (np.linalg.qr(np.vander(np.linspace(-1, 1, side), min(side, CUBIC)))[0] for side in samples.shape)
    residue = samples - down @ (down.T @ samples @ across) @ across.T
    power = np.square(dctn(residue, norm="ortho")) / samples.size
    farthest = np.maximum.outer(*map(np.arange, samples.shape))
    found: np.ndarray = np.cumsum(np.bincount(farthest.ravel(), power.ravel(), n)[::-1])[::-1]
    return found


def reach_of(beyond: np.ndarray, level: float) -> float:
    """Return the frequency above which a map's variation has a root mean square of at most `level`.

    The map is sampled over a square. The unit is one cycle per half the side of the square.

    beyond: result of `power_beyond` for the map.
    """
    more = np.flatnonzero(beyond > level**2)
    return float(more[-1]) / 4 if more.size else 0.0


def _plane(samples: np.ndarray) -> np.ndarray:
    """Return the least-squares plane through the samples."""
    y, x = (np.linspace(-1, 1, n) if n > 1 else np.zeros(1) for n in samples.shape)
    down, across = (at / max(np.sum(at**2), 1.0) for at in (y, x))
    return samples.mean() + down @ samples.mean(axis=1) * y[:, None] + samples.mean(axis=0) @ across * x
