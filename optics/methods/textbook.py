"""The angular spectrum of a pupil's field in plain NumPy: what all other methods compute, as a textbook has it.

Read this first. It is slow, coarse at the pupil's edge, and right only while its one grid is fine and wide enough; the
tests hold the other methods to it. Goodman is Introduction to Fourier Optics, third edition.
"""

from __future__ import annotations

import numpy as np

__all__ = ["angular_spectrum_psf", "lens_path", "positions", "relief_path"]


def positions(samples: int, dx: float) -> tuple[np.ndarray, np.ndarray]:
    """x as a row and y as a column [m], the origin at sample samples//2."""
    x = (np.arange(samples) - samples // 2) * dx
    return x[None, :], x[:, None]


def lens_path(x: np.ndarray, y: np.ndarray, focal_length: float) -> np.ndarray:
    """Optical path [m] through an ideal lens: shorter by as much as the way from (x, y) to the focus is longer. For a
    small pupil that is -r²/2f (Goodman, eq. 5-10)."""
    return focal_length - np.sqrt(x**2 + y**2 + focal_length**2)


def relief_path(height: np.ndarray, n: float) -> np.ndarray:
    """Optical path [m] through a thin relief of glass, beyond that through air (Goodman, §5.1)."""
    return (n - 1) * height


def angular_spectrum_psf(path: np.ndarray, dx: float, radius: float, wavelength: float, distance: float) -> np.ndarray:
    """|U|² / (pupil area) [1/m²] in a plane behind a circular pupil, on the pupil's own grid.

    path: (n, n), optical path [m] through the pupil at `positions(n, dx)`. A plane wave of amplitude 1 arrives.
    dx: pitch [m], less than half of what the phase turns through a wave in. n dx: several times the pupil's width, for
        the transform repeats the field after it. radius, wavelength (in air), distance: [m].
    """
    x, y = positions(len(path), dx)
    inside = np.clip((radius - np.hypot(x, y)) / dx + 0.5, 0, 1)  # 1, 0, and on the edge the covered share of a cell
    field = inside * np.exp(2j * np.pi / wavelength * path)  # just behind the pupil (§5.1, a thin element)

    spectrum = np.fft.fft2(np.fft.ifftshift(field))  # plane waves of frequencies (fx, fy) [1/m] (§3.10.1)
    fx, fy = np.fft.fftfreq(len(path), dx)[None, :], np.fft.fftfreq(len(path), dx)[:, None]
    axial = np.sqrt(1 / wavelength**2 - fx**2 - fy**2 + 0j)  # cos θ / λ; imaginary for evanescent waves, which decay
    spectrum = spectrum * np.exp(2j * np.pi * distance * axial)  # each turns on its way (eq. 3-74)
    field = np.fft.fftshift(np.fft.ifft2(spectrum))  # their sum in the plane behind

    return np.abs(field) ** 2 / (np.sum(inside) * dx**2)
