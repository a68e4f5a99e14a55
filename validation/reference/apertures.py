"""Fourier transforms of apertures in closed form: ∫∫ exp(-2πi (fx x + fy y)) dx dy over the opening.

Lengths may have any unit. Frequencies are in cycles per this unit.
"""

import numpy as np
from scipy.special import j1

__all__ = ["annulus_spectrum", "disk_spectrum", "polygon_spectrum", "rectangle_spectrum"]


def disk_spectrum(fx: np.ndarray, fy: np.ndarray, radius: float = 1.0) -> np.ndarray:
    """Return a J₁(2πaf)/f for a disk of radius a (Goodman, Introduction to Fourier Optics, §2.1.5)."""
    f = np.maximum(np.hypot(fx, fy), 1e-12)
    return np.asarray(radius * j1(2 * np.pi * radius * f) / f)


def annulus_spectrum(fx: np.ndarray, fy: np.ndarray, inner: float, outer: float = 1.0) -> np.ndarray:
    """Return the spectrum of an annulus, the difference of two disks."""
    return disk_spectrum(fx, fy, outer) - disk_spectrum(fx, fy, inner)


def rectangle_spectrum(fx: np.ndarray, fy: np.ndarray, width: float, height: float) -> np.ndarray:
    """Return the spectrum of a rectangle with these full widths along x and y (Goodman, §2.1.5)."""
    return np.asarray(width * np.sinc(width * np.asarray(fx)) * height * np.sinc(height * np.asarray(fy)))


def polygon_spectrum(fx: np.ndarray, fy: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the spectrum of a counterclockwise polygon for f other than 0.

    Source: Lee & Mittra, IEEE Trans. Antennas Propag. 31, 99-103 (1983).

    By Gauss's theorem for the vector field f e^{-2πi f·x} / (-2πi f²), it is the sum of (f x e) sinc(f·e) e^{-2πi f·m}
    / (-2πi f²) over all edges e, with their middles m.
    """
    fx, fy = np.asarray(fx, dtype=np.float64), np.asarray(fy, dtype=np.float64)
    total = np.zeros(np.broadcast(fx, fy).shape, dtype=np.complex128)
    for v, w in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        (ex, ey), (mx, my) = w - v, (v + w) / 2
        total += (fx * ey - fy * ex) * np.sinc(fx * ex + fy * ey) * np.exp(-2j * np.pi * (fx * mx + fy * my))
    return total / (-2j * np.pi * (fx**2 + fy**2))
