"""What a few bands make of measured colours."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from optics import SpectralBands, Spectrum, receptors_of
from optics.spectrum import daylight
from sim.world import World

__all__ = ["band_error", "measured"]

FINE_BANDS = 64


def measured(world: World) -> list[Spectrum]:
    """Reflectances of a world's materials, of those that have a spectrum instead of a colour."""
    names = {world.model.material(i).name for i in range(world.model.nmat)}
    return [spectrum for name, spectrum in world.spectra.items() if name in names]


def band_error(reflectances: Iterable[Spectrum], receptors: Any, bands: int) -> float:
    """What so many bands make of these reflectances in daylight, against 64: the worst difference over reflectances
    and types of receptor, white being 1. Blur that differs from band to band is not in it. 0 without reflectances.

    Raises ValueError for receptors that `optics.receptors_of` does not know, or bands out of its range.
    """
    few, many = (SpectralBands.uniform(n, receptors_of(receptors)) for n in (bands, FINE_BANDS))
    return max((float(np.abs(_signals(few, one) - _signals(many, one)).max()) for one in reflectances), default=0.0)


def _signals(bands: SpectralBands, reflectance: Spectrum) -> np.ndarray:
    found: np.ndarray = bands.weights @ (reflectance.at(bands.wavelengths) * daylight(bands.wavelengths))
    return found
