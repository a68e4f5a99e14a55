"""What a few bands make of measured colours and lamps."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from optics import Eye, SpectralBands, Spectrum, receptors_of
from optics.spectra.bands import daylight
from sim.scene.mirror import MirrorWarning
from sim.worlds.world import World

__all__ = ["band_error", "measured", "with_band_averaged_lights"]

FINE_BANDS = 64
LEAST_MISS = 1e-3  # of white in daylight: what a type may catch too much or too little of a lamp without a word


def with_band_averaged_lights(world: World, eye: Eye) -> World:
    """The same world as this eye's bands have it: measured lights are, at the bands' centres, worth what each type of
    receptor catches of them in white (`SpectralBands.of`), and not what their lines leave there by chance.

    Warns (`sim.MirrorWarning`) of lights of which so few bands give a type another catch.
    """
    materials = {world.model.material(i).name for i in range(world.model.nmat)}
    lights = {name: light for name, light in world.spectra.items() if name not in materials}
    return replace(world, spectra={**world.spectra, **{n: _in_bands(n, s, eye) for n, s in lights.items()}})


def _in_bands(name: str, light: Spectrum, eye: Eye) -> Spectrum:
    bands = eye.spectral_bands
    found = bands.of(light, eye.receptors, nonnegative=True)
    fine = SpectralBands.uniform(FINE_BANDS, eye.receptors)
    caught, due = bands.weights @ found, fine.weights @ fine.of(light, eye.receptors)
    worst = int(np.argmax(np.abs(caught - due)))
    if abs(caught[worst] - due[worst]) > LEAST_MISS:
        warnings.warn(
            f"{name!r} in {len(found)} bands: receptor type {worst} catches {caught[worst]:.2g} of it, should catch "
            f"{due[worst]:.2g} (white in daylight: 1); more bands are nearer",
            MirrorWarning,
            stacklevel=5,
        )
    return Spectrum(tuple(bands.wavelengths * 1e9), tuple(found))


def measured(world: World) -> list[Spectrum]:
    """Reflectances of a world's materials, of those that have a spectrum instead of a colour."""
    names = {world.model.material(i).name for i in range(world.model.nmat)}
    return [spectrum for name, spectrum in world.spectra.items() if name in names]


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
