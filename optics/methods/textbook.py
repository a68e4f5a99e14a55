"""Propagation of a pupil's field by the angular spectrum as in a textbook, in plain NumPy.

Read this module first: all other methods compute the same integral. The method here is slow and coarse at the pupil's
edge. It uses one grid for the pupil and the plane behind it, and is correct only if this grid is fine and wide enough.
Tests compare the other methods with it. References are to Goodman, Introduction to Fourier Optics, third edition.
"""

from __future__ import annotations

import numpy as np

__all__ = ["angular_spectrum_psf", "lens_path", "positions", "relief_path"]


def positions(samples: int, dx: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions x as a row and y as a column [m]. The origin is at sample samples//2."""
    x = (np.arange(samples) - samples // 2) * dx
    return x[None, :], x[:, None]


def lens_path(x: np.ndarray, y: np.ndarray, focal_length: float) -> np.ndarray:
    """Return the optical path [m] through an ideal lens.

    The lens makes all optical paths to the focus equally long. The distance to the focus is longer from (x, y) than
    from the centre of the lens, so the path through the lens is shorter at (x, y) than at the centre by the same
    amount. The path is 0 at the centre. For a small pupil, it is about -r²/2f, where r is the distance from the axis
    and f the focal length (Goodman, eq. 5-10).
    """
    return focal_length - np.sqrt(x**2 + y**2 + focal_length**2)


def relief_path(height: np.ndarray, n: float) -> np.ndarray:
    """Return the optical path [m] through a thin relief of glass, relative to air (Goodman, §5.1)."""
    return (n - 1) * height


def angular_spectrum_psf(path: np.ndarray, dx: float, radius: float, wavelength: float, distance: float) -> np.ndarray:
    """Return |U|² / (pupil area) [1/m²] in a plane behind a circular pupil, on the pupil's own grid.

    A plane wave of amplitude 1 illuminates the pupil.

    path: (n, n), optical path [m] through the pupil at `positions(n, dx)`.
    dx: pitch [m]. It must be less than half the distance over which the phase changes by one wave. The width n dx must
        be several times the width of the pupil, because the transform repeats the field beyond this width.
    radius, wavelength, distance: radius of the pupil, wavelength in air and distance of the plane [m].
    """
    x, y = positions(len(path), dx)
    # 1 inside, 0 outside; on the edge, about the covered fraction of a cell.
    inside = np.clip((radius - np.hypot(x, y)) / dx + 0.5, 0, 1)
    field = inside * np.exp(2j * np.pi / wavelength * path)  # field just behind the pupil (§5.1, a thin element)

    spectrum = np.fft.fft2(np.fft.ifftshift(field))  # plane waves of frequencies (fx, fy) [1/m] (§3.10.1)
    fx, fy = np.fft.fftfreq(len(path), dx)[None, :], np.fft.fftfreq(len(path), dx)[:, None]
    axial = np.sqrt(1 / wavelength**2 - fx**2 - fy**2 + 0j)  # cos θ / λ; imaginary for evanescent waves, which decay
    spectrum = spectrum * np.exp(2j * np.pi * distance * axial)  # phase shift of each plane wave (eq. 3-74)
    field = np.fft.fftshift(np.fft.ifft2(spectrum))  # sum of the waves in the plane behind

    return np.abs(field) ** 2 / (np.sum(inside) * dx**2)
