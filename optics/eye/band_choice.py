"""Choice of the number of spectral bands: the fewest whose predicted error is within the tolerance."""

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

# Choice: numbers of bands to try, up to half of `FINEST`, the number of bands in the reference.
CANDIDATES = (1, 2, 4, 8, 16, 32)


def choose_bands(
    tolerance: float,
    receptors: Any = "rgb",
    kernels: Callable[[np.ndarray], np.ndarray] | None = None,
    samples_per_receptor: int = 1,
    white: float | None = None,
) -> SpectralBands:
    """Return the fewest bands that keep the predicted error of a receptor's signal within the tolerance.

    The number is a power of two. The error is relative to the signal that a white surface gives. It is the sum of two
    terms:

    - The error for coloured surfaces, compared with 64 bands. It is the largest error for reflectances (1 + cos(2πλ/Λ +
        φ))/2 of any phase φ, where Λ is the width of the receptors' range of wavelengths.
    - The error of the kernels for white light: the largest difference, over all scenes, between the signals with n and
        with 2n bands.

    tolerance: largest error, 1e-6 to 0.5.
    receptors: `Receptors`, or an argument of `optics.receptors_of`: a name, or peak wavelengths.
    kernels: function that takes an array of wavelengths and returns a kernel for each of them, array (wave, ky, kx). A
        kernel has one value per cell. Cells are equal rectangles, samples_per_receptor of them along each side of a
        receptor. None: the kernel is the same for all wavelengths.
    white: signal of a white surface, relative to the signal that it would give if the pupil's mask absorbed no light.
        It is the pupil's `transmission`, and includes light outside the windows of the kernels. Errors are divided by
        it. None: the signal computed from the given kernels, whose windows may omit some light.

    Raises:
        ValueError: the tolerance is outside its range, or the receptors are invalid.
        AccuracyError: the error with 32 bands exceeds the tolerance.
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
        f"tolerance = {tolerance:g}: {CANDIDATES[-1]} bands leave a predicted error of {total:.1e} of the "
        "signal of white; increase the tolerance or specify a number of bands"
    )


def _reflectance_error(chosen: SpectralBands, exact: SpectralBands, range_nm: tuple[float, float]) -> float:
    """Return the largest error among the signals of all channels for sinusoidal reflectances in daylight.

    The reflectance is (1 + cos(2πλ/Λ + φ))/2, where Λ is the width of `range_nm`, and φ is the phase with the largest
    error. This error is half the modulus of the error of the sum Σ w d e^{2πiλ/Λ} over bands, where w are the bands'
    weights and d is daylight.

    exact: the bands that define the correct signal.
    """
    period = (range_nm[1] - range_nm[0]) * 1e-9

    def catch(bands: SpectralBands) -> np.ndarray:
        return bands.weights @ (daylight(bands.wavelengths) * np.exp(2j * np.pi * bands.wavelengths / period))

    return float(np.abs(catch(chosen) - catch(exact)).max() / 2)
