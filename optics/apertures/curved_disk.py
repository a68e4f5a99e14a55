"""Converging and diverging waves behind disks and rings. The waves are convolved with the kernel of a soft edge.

A curved wave contains all directions from the direction at its centre to the direction at its rim. Each direction
corresponds to a spatial frequency, and the convolution acts as a low-pass filter. It removes light in directions beyond
the stopband of the kernel. In directions up to the passband of the kernel, all light stays unchanged. This includes
light that the hard edge diffracts into these directions.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, log2, pi

import numpy as np

from optics.apertures.soft_edge import SoftEdge
from optics.numerics.bessel import bessel_j
from optics.numerics.interpolation import chebyshev_basis, chebyshev_points
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count, stepped_up

__all__ = ["curved_ring"]

DIGITS = 4.0  # choice: digits of the table, which serves tolerances from 3e-4
SPARE = 1.2  # choice: largest frequency relative to the stopband, beyond which the kernel's spectrum is a ripple
STEP = 16  # choice: numbers of interpolation points are multiples of it, so that tables share their weights
BESSEL_STEP = 0.02  # choice: step of the table of J₀


def curved_ring(edge: SoftEdge, inner: float, curvature: float, levels: int) -> np.ndarray:
    """Return a smoothed wave behind a ring, divided by the unsmoothed wave, at values of r², (levels,), complex.

    The wave e^{iπ c r²} passes the opening between the radii `inner` and 1, and is convolved with the kernel of the
    soft edge. The result is 1 where the kernel changes nothing. The values of r² lie in the middle of equal steps from
    0 to (1 + reach)², where `reach` is the radius beyond which the kernel is 0.

    curvature: c, the local frequency of the wave at the rim in cycles per radius.
    """
    most, outermost, bend = SPARE * edge.stopband, 1 + edge.reach, abs(curvature) / 2
    k, by_k = _rule(0.0, most, most * (1 + outermost))
    r, by_r = _rule(inner, 1.0, most + bend)
    at, by_at = _rule(0.0, edge.reach, 2 * edge.cycles + edge.beta / 4)
    # Hankel transforms of the wave in the opening and of the kernel, whose product is transformed back.
    wave = (by_r * r * np.exp(1j * pi * curvature * r * r)) @ _bessel_j0(r, k)
    kernel = (by_at * edge.ring(at)) @ _bessel_j0(at, k)
    count = STEP * ceil((pi * outermost * (most + bend * outermost) + 2 * DIGITS) / STEP)
    square = (chebyshev_points(count) + 1) / 2 * outermost**2
    both = 4 * pi * pi * by_k * k * wave * kernel
    smooth = (_bessel_j0(np.sqrt(square), k) @ both) * np.exp(-1j * pi * curvature * square)
    parts = np.stack([smooth.real, smooth.imag], axis=1).astype(np.float32)
    return np.asarray((_weights(levels, count) @ parts).view(np.complex64)[:, 0])


def _rule(first: float, last: float, cycles: float) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights between two radii or frequencies for functions with `cycles` cycles between them."""
    at, weight = gauss_legendre(gauss_legendre_count(stepped_up(cycles), DIGITS))
    return first + (last - first) * at, (last - first) * weight


@lru_cache(maxsize=16)
def _weights(levels: int, count: int) -> np.ndarray:
    """Return the weights that interpolate a function on [-1, 1] from Chebyshev points, array (level, point).

    levels: number of equal steps into which [-1, 1] is divided; the function is interpolated in the middle of each
    count: number of Chebyshev points
    """
    return chebyshev_basis((2 * np.arange(levels) + 1) / levels - 1, count).astype(np.float32)


def _bessel_j0(r: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Return J₀(2πkr), (r, k), by linear interpolation of a table, to within BESSEL_STEP²/16."""
    place = np.outer(r, k * (2 * pi / BESSEL_STEP))
    below = place.astype(np.int32)
    known = _bessel_table(2.0 ** ceil(log2(place.max() + 2)))
    start = known[below]
    return np.asarray(start + (place - below) * (known[below + 1] - start))


@lru_cache(maxsize=8)
def _bessel_table(size: float) -> np.ndarray:
    """Return J₀ at 0, BESSEL_STEP, 2 · BESSEL_STEP and so on, `size` values in all. `size` is a whole number."""
    parts = np.array_split(BESSEL_STEP * np.arange(int(size)), max(1, int(size) // 1024))
    return np.concatenate([bessel_j(0, part) for part in parts])
