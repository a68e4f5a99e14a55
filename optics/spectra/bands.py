"""Spectral bands: light described by a few numbers, with weights for each receptor type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.numerics.arguments import flag, shown, whole
from optics.numerics.interpolation import linear_weights
from optics.numerics.number_types import full_precision
from optics.numerics.read_only import ReadOnlyArrays
from optics.numerics.renamed import renamed
from optics.spectra.pigment import pigment_absorptance
from optics.spectra.receptors import Receptors, receptors_of
from optics.spectra.spectrum import Spectrum, cie_1931, daylight

__all__ = ["SpectralBands", "cie_1931", "daylight", "pigment_absorptance"]

FINEST = 64  # choice: largest number of bands
CATCHES_FIRST = 1e4  # choice: weight of quantum catches relative to that of the bands' means in the least-squares fit


@dataclass(frozen=True)
class SpectralBands(ReadOnlyArrays):
    """Bands of light and their weights for each receptor channel.

    wavelengths: centres of the bands [m], (band,).
    weights: (channel, band). For every channel c, Σ_b weights[c, b] daylight(wavelengths[b]) = 1, so that the signal of
        a white surface is 1 in `daylight`, which is 1 at 560 nm.
    white_catch: quantum catch from a white surface in `daylight`, before the weights are normalised, (channel,): ∫
        daylight(λ) λ S_c(λ) dλ [m²]. S_c is the quantal sensitivity of the receptors, with a peak of 1.
    """

    wavelengths: np.ndarray
    weights: np.ndarray
    white_catch: np.ndarray

    @classmethod
    def uniform(cls, bands: int, receptors: Any = "rgb") -> SpectralBands:
        """Return equal bands over the receptors' range, with their weights for each receptor channel.

        The weights give the exact integral of sensitivity x daylight x reflectance (by quadrature to 1 nm) if the
        reflectance is linear between the bands' centres and constant beyond them. For other smooth reflectances, the
        error is O(bands⁻²).

        receptors: `Receptors`, or any argument of `receptors_of`.

        Raises:
            ValueError: bands is not a whole number from 1 to 64, or the receptors are invalid.
        """
        kinds = receptors_of(receptors)
        edges = np.linspace(*kinds.limits_nm, whole("bands", bands, 1, FINEST) + 1)
        centres = (edges[:-1] + edges[1:]) / 2
        nm, catch = _catch(kinds)
        weights = (catch @ linear_weights(nm, centres).T) / catch.sum(axis=1, keepdims=True) / daylight(centres * 1e-9)
        return cls(centres * 1e-9, weights, catch.sum(axis=1) * 1e-18)

    of = renamed("band_values")

    def band_values(
        self, radiance: Spectrum | Callable[[np.ndarray], np.ndarray], receptors: Any, nonnegative: bool = False
    ) -> np.ndarray:
        """Convert a spectral radiance to values for these bands (band,), in units of daylight at 560 nm.

        The spectrum may have any shape. It may, for example, contain the narrow lines of a fluorescent lamp, although
        samples at the bands' centres would miss such lines. The values are first computed as means over the bands,
        weighted by the receptors' sensitivity and relative to daylight. They are then changed as little as possible, so
        that the sum Σ_b weights[c, b] values[b] over the bands b equals the quantum catch of each receptor type c,
        where weights are the attribute `weights`. The quantum catch is an integral over wavelengths in steps of 1 nm,
        divided by the catch from a white surface in daylight. If there are fewer bands than types, this equality is
        possible only in the least-squares sense. If a spectrum with lines is divided into few bands, a value may be
        negative.

        radiance: a Spectrum, or a function of wavelengths [m]. For a surface, it is reflectance times illuminant.
        receptors: the receptors for which these bands were made.
        nonnegative: True if values must be at least 0. Catches are then as close to the exact ones as such values
            permit.

        Raises:
            ValueError: radiance is neither a Spectrum nor a function, is not finite at a wavelength, or gives neither
                one value nor one per wavelength. Another argument is invalid.
        """
        if not isinstance(radiance, Spectrum) and not callable(radiance):
            raise ValueError(
                f"radiance = {shown(radiance)}: must be a Spectrum, such as illuminant('D65'), or a function"
            )
        flag("nonnegative", nonnegative)
        at = radiance.at if isinstance(radiance, Spectrum) else radiance
        nm, catch = _catch(receptors_of(receptors))
        catch /= catch.sum(axis=1, keepdims=True)
        of_daylight = _values(at(nm * 1e-9), nm.shape) / daylight(nm * 1e-9)
        seen = catch.sum(axis=0)
        shares = linear_weights(nm, self.wavelengths * 1e9) * (
            seen + 1e-6 * seen.max()
        )  # avoids 0/0 in a band whose light no receptor absorbs
        means = daylight(self.wavelengths) * (shares @ of_daylight) / shares.sum(axis=1)
        catches = catch @ of_daylight
        found: np.ndarray = means + np.linalg.pinv(self.weights) @ (catches - self.weights @ means)
        return _nonnegative(self.weights, catches, means) if nonnegative and found.min() < 0 else found

    def white_light(self, kernels: np.ndarray) -> np.ndarray:
        """Return kernels (channel, ky, kx) for a colourless scene in daylight, given kernels (band, ky, kx)."""
        return np.tensordot(self.weights * daylight(self.wavelengths), kernels, axes=1)


def _nonnegative(weights: np.ndarray, catches: np.ndarray, means: np.ndarray) -> np.ndarray:
    """Return band values x >= 0 for which weights @ x is closest to the quantum catches of the receptor channels.

    Among several such x, return the one closest to `means`, the means of a spectrum over the bands.
    """
    from scipy.optimize import lsq_linear

    equations = np.concatenate([weights * CATCHES_FIRST, np.eye(len(means))])
    wanted = np.concatenate([catches * CATCHES_FIRST, means])
    found: np.ndarray = lsq_linear(equations, wanted, bounds=(0, np.inf), method="bvls").x
    return found


def _values(found: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return a function's result as an array of one value per wavelength, or raise a ValueError."""
    found = full_precision("radiance", found)
    try:
        values = np.broadcast_to(np.asarray(found, np.float64), shape)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"radiance: must be a number for each of {shape[0]} wavelengths, not {shown(found)}") from None
    if not np.isfinite(values).all():
        raise ValueError("radiance: must be finite at every wavelength that receptors see")
    return values


def _catch(kinds: Receptors) -> tuple[np.ndarray, np.ndarray]:
    """Return wavelengths [nm] over the receptors' range, and each type's quantum catch of daylight at each wavelength.

    The catches are multiplied by the weights of the trapezoid rule, so their sum is an integral over wavelengths, up to
    a common factor. The arrays are (wavelength,) and (type, wavelength).
    """
    low, high = kinds.limits_nm
    nm = np.arange(low, high + 0.5)
    catch = kinds.catch(nm)
    catch[:, [0, -1]] /= 2  # trapezoid rule
    return nm, catch
