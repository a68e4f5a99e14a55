"""Errors of receptor signals if measured spectra of materials and lamps are represented by a few spectral bands."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from optics import Receptors, SpectralBands, Spectrum, receptors_of
from optics.spectra.bands import daylight
from sim.scene.spectra import Spectra

__all__ = ["band_error", "lights_in_bands", "measured"]

FINE_BANDS = 64
LEAST_MISS = 1e-3  # relative to white in daylight: largest error of a quantum catch from a lamp without a warning


def lights_in_bands(
    model: mujoco.MjModel, spectra: Spectra, bands: SpectralBands, receptors: Receptors
) -> tuple[Spectra, list[str]]:
    """Return the measured spectra, with those of lights converted to an eye's bands, and messages about large errors.

    For each light, the values at the bands' centres are chosen such that each receptor type has the correct quantum
    catch from a white surface in this light. Values are at least 0, and if this prevents correct catches, they are as
    close as possible (`SpectralBands.band_values`). Sampling at the centres would include a spectral line only by
    chance. Spectra of materials are unchanged. There is a message for each light in which the catch of a receptor type
    is wrong by more than 0.001 times its catch from a white surface in daylight.
    """
    materials = {model.material(i).name for i in range(model.nmat)}
    found, off = dict(spectra), []
    for name, light in spectra.items():
        if name not in materials:
            found[name], words = _in_bands(name, light, bands, receptors)
            off += words
    return found, off


def _in_bands(name: str, light: Spectrum, bands: SpectralBands, receptors: Receptors) -> tuple[Spectrum, list[str]]:
    found = bands.band_values(light, receptors, nonnegative=True)
    fine = SpectralBands.uniform(FINE_BANDS, receptors)
    caught, due = bands.weights @ found, fine.weights @ fine.band_values(light, receptors)
    worst = int(np.argmax(np.abs(caught - due)))
    words = (
        f"{name!r} in {len(found)} bands: receptor type {worst} catches {caught[worst]:.2g} of it, but should "
        f"catch {due[worst]:.2g} (white in daylight: 1); more bands reduce the error"
    )
    off = abs(caught[worst] - due[worst]) > LEAST_MISS
    return Spectrum(tuple(bands.wavelengths * 1e9), tuple(found)), [words] if off else []


def measured(model: mujoco.MjModel, spectra: Spectra) -> list[Spectrum]:
    """Return the spectra of the model's materials that have a spectrum instead of a colour."""
    names = {model.material(i).name for i in range(model.nmat)}
    return [spectrum for name, spectrum in spectra.items() if name in names]


def band_error(reflectances: Iterable[Spectrum], receptors: Any, bands: int) -> float:
    """Return the error of receptors' signals from surfaces in daylight if light is divided into `bands` spectral bands.

    The error is the difference from the signals with 64 bands, as a fraction of the signal of a white surface. The
    largest difference over reflectances and receptor types is returned, or 0 if there are no reflectances. Errors of
    blur that differs from band to band are not included.

    Raises:
        ValueError: `optics.receptors_of` does not accept the receptors, or `bands` is not a whole number from 1 to 64.
    """
    few, many = (SpectralBands.uniform(n, receptors_of(receptors)) for n in (bands, FINE_BANDS))
    return max((float(np.abs(_signals(few, one) - _signals(many, one)).max()) for one in reflectances), default=0.0)


def _signals(bands: SpectralBands, reflectance: Spectrum) -> np.ndarray:
    found: np.ndarray = bands.weights @ (reflectance.at(bands.wavelengths) * daylight(bands.wavelengths))
    return found
