"""Textbook angular spectrum in NumPy, whose errors the proofs of this folder show. Time factor exp(-iωt)."""

from __future__ import annotations

import numpy as np

__all__ = ["angular_spectrum", "sampled_lens"]


def angular_spectrum(
    u: np.ndarray, dx: float, wavelength: float, distance: float, dtype: type[np.complexfloating] = np.complex128
) -> np.ndarray:
    """Return F⁻¹{F{u} H}, H = exp(2πi z √(1/λ² - fx² - fy²)), over the samples' own period (Goodman §3.10.2).

    In backward propagation (z < 0), evanescent waves grow as fast as they decay in forward propagation.

    dtype: type of every intermediate number, including kz.
    """
    real = np.zeros(0, dtype).real.dtype.type
    fx, fy = (np.fft.fftfreq(n, dx).astype(real) for n in u.shape[::-1])
    axial = np.sqrt((real(1 / wavelength**2) - fx[None, :] ** 2 - fy[:, None] ** 2).astype(dtype))
    with np.errstate(over="ignore", invalid="ignore"):
        transfer = np.exp(dtype(2j * np.pi * distance) * axial)
        # NumPy transforms in float64, so the result is rounded to dtype before and after.
        spectrum = (np.fft.fft2(np.fft.ifftshift(u)).astype(dtype) * transfer).astype(dtype)
        return np.fft.fftshift(np.fft.ifft2(spectrum)).astype(dtype)


def sampled_lens(n: int, dx: float, wavelength: float, radius: float, focal_length: float) -> np.ndarray:
    """Return a disk (1 inside, 0 outside) with the phase of an ideal lens.

    The n x n samples have the pitch dx, and sample n//2 is on the axis.
    """
    x = (np.arange(n) - n // 2) * dx
    r2 = x[None, :] ** 2 + x[:, None] ** 2
    path = r2 / (np.sqrt(r2 + focal_length**2) + focal_length) if np.isfinite(focal_length) else 0 * r2
    return np.where(r2 <= radius**2, np.exp(-2j * np.pi / wavelength * path), 0)
