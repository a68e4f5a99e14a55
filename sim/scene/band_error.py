"""What a few bands make of measured colours and lamps."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from optics import Eye, SpectralBands, Spectrum, receptors_of
from optics.spectra.bands import daylight
from sim.scene.spectra import Spectra

__all__ = ["band_error", "lights_in_bands", "measured"]

FINE_BANDS = 64
LEAST_MISS = 1e-3  # of white in daylight: what a type may catch too much or too little of a lamp without a word


def lights_in_bands(model: mujoco.MjModel, spectra: Spectra, eye: Eye) -> tuple[Spectra, list[str]]:
    """Measured spectra as this eye's bands have them: lights are, at the bands' centres, worth what each type of
    receptor catches of them in white (`SpectralBands.of`), and not what their lines leave there by chance; materials
    are as they were. And, in words, lights of which so few bands give a type another catch."""
    materials = {model.material(i).name for i in range(model.nmat)}
    found, off = dict(spectra), []
    for name, light in spectra.items():
        if name not in materials:
            found[name], words = _in_bands(name, light, eye)
            off += words
    return found, off


def _in_bands(name: str, light: Spectrum, eye: Eye) -> tuple[Spectrum, list[str]]:
    bands = eye.spectral_bands
    found = bands.of(light, eye.receptors, nonnegative=True)
    fine = SpectralBands.uniform(FINE_BANDS, eye.receptors)
    caught, due = bands.weights @ found, fine.weights @ fine.of(light, eye.receptors)
    worst = int(np.argmax(np.abs(caught - due)))
    words = (
        f"{name!r} in {len(found)} bands: receptor type {worst} catches {caught[worst]:.2g} of it, should catch "
        f"{due[worst]:.2g} (white in daylight: 1); more bands are nearer"
    )
    off = abs(caught[worst] - due[worst]) > LEAST_MISS
    return Spectrum(tuple(bands.wavelengths * 1e9), tuple(found)), [words] if off else []


def measured(model: mujoco.MjModel, spectra: Spectra) -> list[Spectrum]:
    """Reflectances of a model's materials, of those that have a spectrum instead of a colour."""
    names = {model.material(i).name for i in range(model.nmat)}
    return [spectrum for name, spectrum in spectra.items() if name in names]


def band_error(reflectances: Iterable[Spectrum], receptors: Any, bands: int) -> float:
    """What so many bands make of these reflectances in daylight, against 64: the worst difference over reflectances
    and types of receptor, white being 1. Blur that differs from band to band is not in it. 0 without reflectances.

    Raises:
        ValueError: receptors that `optics.receptors_of` does not know, or bands out of its range.
    """
    few, many = (SpectralBands.uniform(n, receptors_of(receptors)) for n in (bands, FINE_BANDS))
    return max((float(np.abs(_signals(few, one) - _signals(many, one)).max()) for one in reflectances), default=0.0)


def _signals(bands: SpectralBands, reflectance: Spectrum) -> np.ndarray:
    found: np.ndarray = bands.weights @ (reflectance.at(bands.wavelengths) * daylight(bands.wavelengths))
    return found
