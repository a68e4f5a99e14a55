"""Radiance of surfaces with the colours of an sRGB image, in spectral bands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from optics.spectra.bands import SpectralBands
from optics.spectra.spectrum import Spectrum, daylight, srgb_basis

__all__ = ["decode_srgb", "ink_radiance"]

ULTRAVIOLET_NM = 400.0


def decode_srgb(display: np.ndarray | float) -> np.ndarray:
    """Convert sRGB display values in [0, 1] to linear values (IEC 61966-2-1)."""
    x = np.asarray(display, dtype=float)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.04045) + 0.055) / 1.055) ** 2.4)


def ink_radiance(bands: SpectralBands, receptors: Any, uv: float = 1.0) -> np.ndarray:
    """Return the radiance of red, green and blue surfaces in daylight, in each spectral band, (band, 3).

    If uv is 1, the sum of the three is the radiance of a white surface, see `srgb_basis`.

    uv: factor on the reflectances below 400 nm, about which an sRGB image contains no information.
    """

    def radiance(ink: Spectrum) -> Callable[[np.ndarray], np.ndarray]:
        return lambda at: ink.at(at) * np.where(at * 1e9 < ULTRAVIOLET_NM, uv, 1.0) * daylight(at)

    return np.stack([bands.band_values(radiance(ink), receptors) for ink in srgb_basis()], axis=-1)
