"""Conversion between display-referred colour (sRGB, IEC 61966-2-1) and linear light."""

from __future__ import annotations

import numpy as np

from optics.spectra.srgb import decode_srgb

__all__ = ["decode_srgb", "encode_srgb", "preview"]

# IEC 61966-2-1
_XYZ_TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def encode_srgb(linear: np.ndarray | float) -> np.ndarray:
    """Convert linear values in [0, 1] to sRGB display values in [0, 1]."""
    x = np.asarray(linear, dtype=float)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def preview(radiance: np.ndarray, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Convert spectral radiance (band, y, x) to linear sRGB (y, x, 3) with the colour matching functions of CIE 1931.

    The radiance D65 becomes white. Each band represents the wavelengths that are nearer to it than to other bands. With
    few bands the colours are approximate.

    wavelengths_nm: centres of the bands [nm], (band,)
    """
    from optics.spectra.bands import cie_1931, daylight

    order = np.argsort(wavelengths_nm)
    nm = np.clip(np.asarray(wavelengths_nm, float)[order], 360.0, 780.0)
    matching = cie_1931(nm * 1e-9)  # (band, 3)
    weights = matching * (np.gradient(nm)[:, None] if len(nm) > 1 else 1.0)
    light = daylight(nm * 1e-9)
    rgb_weights = weights @ _XYZ_TO_SRGB.T
    white = light @ rgb_weights
    balanced = rgb_weights / np.where(np.abs(white) > 1e-9, white, np.inf)
    return np.einsum("byx,bc->yxc", np.asarray(radiance, float)[order], balanced).astype(np.float32)
