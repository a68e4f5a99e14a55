"""Display-referred colour and linear light, as sRGB relates them (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np


def encode_srgb(linear: np.ndarray | float) -> np.ndarray:
    """Linear value in [0, 1] -> sRGB display value in [0, 1]."""
    x = np.asarray(linear, dtype=float)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def decode_srgb(display: np.ndarray | float) -> np.ndarray:
    """sRGB display value in [0, 1] -> linear value."""
    x = np.asarray(display, dtype=float)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.04045) + 0.055) / 1.055) ** 2.4)
