"""How many spectral bands an eye needs: the fewest whose error a receptor cannot tell."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from optics.eye.kernel_interpolation import worst_difference
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import in_range
from optics.spectra.bands import FINEST, SpectralBands
from optics.spectra.receptors import receptors_of
from optics.spectra.spectrum import daylight

__all__ = ["choose_bands"]

# Choice: numbers of bands to try, up to half of `FINEST`, with which they are compared.
CANDIDATES = (1, 2, 4, 8, 16, 32)


def choose_bands(
    tolerance: float,
    receptors: Any = "rgb",
    kernels: Callable[[np.ndarray], np.ndarray] | None = None,
    samples_per_receptor: int = 1,
    white: float | None = None,
) -> SpectralBands:
    """The fewest bands, a power of two, that keep the predicted error of a receptor's signal within the tolerance,
    in units of white's signal. It is the sum of two:

    - reflectances (1 + cos(2π λ/Λ + φ))/2 of any phase φ, Λ the whole range: what the bands make of them against
      quadrature to 1 nm;
    - kernels(wavelengths) (wave, k, k), cells of 1/samples_per_receptor (None: the same for all wavelengths):
      the worst scene's difference between white light's kernel from n and from 2n bands; white: what kernels would
      leave of white's signal if they were as wide as all that light (None: what they do leave).

    Raises:
        AccuracyError: 32 bands do not.
    """
    in_range("tolerance", tolerance, 1e-6, 0.5)
    total, coarse = math.inf, None
    for bands in CANDIDATES:
        chosen, finer = (SpectralBands.uniform(n, receptors) for n in (bands, 2 * bands))
        total = _reflectance_error(chosen, SpectralBands.uniform(FINEST, receptors), receptors_of(receptors).limits_nm)
        if total > tolerance:
            continue
        if kernels is None:
            return chosen
        coarse = chosen.white_light(kernels(chosen.wavelengths)) if coarse is None else coarse
        fine = finer.white_light(kernels(finer.wavelengths))
        worst = worst_difference([(1, coarse), (-1, fine)], samples_per_receptor)
        total += worst / (white or float(fine.sum(axis=(1, 2)).mean())) if worst > 0 else 0.0
        if total <= tolerance:
            return chosen
        coarse = fine
    raise AccuracyError(
        f"tolerance = {tolerance:g}: {CANDIDATES[-1]} bands leave a predicted error of {total:.1e} of white's "
        "signal; widen the tolerance or give a number of bands"
    )


def _reflectance_error(chosen: SpectralBands, exact: SpectralBands, range_nm: tuple[float, float]) -> float:
    """Worst over phases and channels: half of |Σ w d e^{2πiλ/Λ}|'s error."""
    period = (range_nm[1] - range_nm[0]) * 1e-9

    def catch(bands: SpectralBands) -> np.ndarray:
        return bands.weights @ (daylight(bands.wavelengths) * np.exp(2j * np.pi * bands.wavelengths / period))

    return float(np.abs(catch(chosen) - catch(exact)).max() / 2)
