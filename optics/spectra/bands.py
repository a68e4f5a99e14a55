"""Spectral bands: light as a few numbers, with a weight for each receptor type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.numerics.arguments import flag, shown, whole
from optics.numerics.interpolation import linear_weights
from optics.numerics.renamed import renamed
from optics.spectra.pigment import pigment_absorptance
from optics.spectra.receptors import Receptors, receptors_of
from optics.spectra.spectrum import Spectrum, cie_1931, daylight

__all__ = ["SpectralBands", "cie_1931", "daylight", "pigment_absorptance"]

FINEST = 64  # choice
CATCHES_FIRST = 1e4  # choice: weight of catches over means in least squares


@dataclass(frozen=True)
class SpectralBands:
    """Bands of light and their weights for each receptor channel.

    wavelengths: (band,) [m], the bands' centres.
    weights: (channel, band); Σ_b weights[c, b] daylight(wavelengths[b]) = 1 for every channel c, so that a white
        surface in unit daylight gives 1.
    white_catch: (channel,) ∫ daylight(λ) λ S_c(λ) dλ [m²], with S_c the pigment's quantal sensitivity with peak 1: the
        quantum catch from a white surface in unit daylight before the weights are normalised.
    """

    wavelengths: np.ndarray
    weights: np.ndarray
    white_catch: np.ndarray

    @classmethod
    def uniform(cls, bands: int, receptors: Any = "rgb") -> SpectralBands:
        """Return equal bands over the receptors' range.

        The weights integrate sensitivity x daylight exactly (to 1 nm) for every reflectance that is linear between the
        bands' centres. The error is O(bands⁻²) for smooth reflectances.

        receptors: `Receptors`, or any argument of `receptors_of`.
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
        """Convert a spectral radiance to these bands (band,), in units of daylight's at 560 nm.

        The spectrum may have any shape, such as a fluorescent lamp's lines, which samples at the bands' centres hit or
        miss. The values are means over the bands, weighted by the receptors' sensitivity and relative to daylight. They
        receive the smallest change that makes Σ_b weights[c, b] radiance[b] the quantum catch of receptor type c
        (quadrature to 1 nm). This is exact unless there are fewer bands than types, and a least-squares solution
        otherwise. Lines in few bands may make a value negative.

        radiance: a Spectrum, or a function of wavelengths [m] (for a surface: reflectance times illuminant).
        receptors: the receptors for which these bands were made.
        nonnegative: True for values of at least 0, with the nearest possible catches.
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
        )  # invisible light has a mean, too
        means = daylight(self.wavelengths) * (shares @ of_daylight) / shares.sum(axis=1)
        caught = catch @ of_daylight
        found: np.ndarray = means + np.linalg.pinv(self.weights) @ (caught - self.weights @ means)
        return _nonnegative(self.weights, caught, means) if nonnegative and found.min() < 0 else found

    def white_light(self, kernels: np.ndarray) -> np.ndarray:
        """Kernels (channel, k, k) for a colourless scene in daylight, from kernels (band, k, k)."""
        return np.tensordot(self.weights * daylight(self.wavelengths), kernels, axes=1)


def _nonnegative(weights: np.ndarray, caught: np.ndarray, means: np.ndarray) -> np.ndarray:
    """x >= 0 with weights @ x as close as possible to the catches, and among these the closest to the means."""
    from scipy.optimize import lsq_linear

    equations = np.concatenate([weights * CATCHES_FIRST, np.eye(len(means))])
    wanted = np.concatenate([caught * CATCHES_FIRST, means])
    found: np.ndarray = lsq_linear(equations, wanted, bounds=(0, np.inf), method="bvls").x
    return found


def _values(found: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Values that a function returned for wavelengths, checked."""
    try:
        values = np.broadcast_to(np.asarray(found, np.float64), shape)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"radiance: must be a number for each of {shape[0]} wavelengths, not {shown(found)}") from None
    if not np.isfinite(values).all():
        raise ValueError("radiance: must be finite at every wavelength that receptors see")
    return values


def _catch(kinds: Receptors) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [nm] over the receptors' range, and each type's catch of daylight there, weighted for summation."""
    low, high = kinds.limits_nm
    nm = np.arange(low, high + 0.5)
    catch = kinds.catch(nm)
    catch[:, [0, -1]] /= 2  # trapezoid rule
    return nm, catch
