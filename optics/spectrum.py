"""Spectral bands and the three default receptor channels.

Sensitivities are visual pigment templates after Govardovskii, Fyhrquist, Reuter, Kuzmin & Donner (2000), "In search
of the visual pigment template", Visual Neuroscience 17:509-528, equations 1, 2 and 5.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources

import numpy as np

from optics.arguments import in_range, whole
from optics.ladder import worst_difference
from optics.planner import AccuracyError

__all__ = ["DEFAULT_LAMBDA_MAX_NM", "SpectralBands", "cie_1931", "daylight", "pigment_absorptance"]

# Red, green and blue receptors, as swallowtail butterflies have them (Arikawa 2003, J. Comp. Physiol. A 189:791):
# far enough apart to tell colours as three RGB channels do, which human cones (566, 541, 441 nm) are not.
DEFAULT_LAMBDA_MAX_NM = (600.0, 520.0, 460.0)
VISIBLE_NM = (400.0, 700.0)
CANDIDATES, FINEST = (1, 2, 4, 8, 16, 32), 64


@lru_cache(maxsize=1)
def _tables() -> np.ndarray:
    """Columns wavelength_nm, D65, x̄, ȳ, z̄ at 5 nm, 360-780 nm (CIE 015; frozen from colour-science)."""
    with resources.files("optics").joinpath("colour_tables.csv").open() as file:
        return np.loadtxt(file, delimiter=",", skiprows=1)


def daylight(wavelengths: np.ndarray) -> np.ndarray:
    """Relative spectral power of CIE D65, 1 at 560 nm, linear between the 5 nm table's entries.

    Raises:
        ValueError: a wavelength [m] outside 360-780 nm.
    """
    table = _tables()
    d65 = table[:, 1] / np.interp(560.0, table[:, 0], table[:, 1])
    return np.interp(_nanometres(wavelengths), table[:, 0], d65)


def cie_1931(wavelengths: np.ndarray) -> np.ndarray:
    """CIE 1931 2° colour matching functions x̄, ȳ, z̄ -> (wavelength, 3); wavelengths [m] in 360-780 nm."""
    table = _tables()
    nm = _nanometres(wavelengths)
    return np.stack([np.interp(nm, table[:, 0], column) for column in table[:, 2:].T], axis=-1)


def _nanometres(wavelengths: np.ndarray) -> np.ndarray:
    nm = np.asarray(wavelengths, dtype=np.float64) * 1e9
    low, high = _tables()[[0, -1], 0]
    outside = nm[~((nm > low - 1e-6) & (nm < high + 1e-6))]
    if outside.size:
        raise ValueError(f"wavelengths hold {outside[0] * 1e-9:g} m: must lie in [{low:g}e-9, {high:g}e-9]")
    return nm


def pigment_absorptance(wavelengths: np.ndarray, lambda_max: float) -> np.ndarray:
    """A1 visual pigment's quantal sensitivity at `wavelengths` [m], peak (α band) 1 at `lambda_max` [m].

    Govardovskii et al. (2000), eqs. 1 and 2 (α band) and 5a, 5b (β band).

    Raises:
        ValueError: lambda_max outside 330-700 nm, the template's range.
    """
    peak = in_range("lambda_max", lambda_max, 330e-9, 700e-9) * 1e9
    nm = np.asarray(wavelengths, dtype=np.float64) * 1e9
    x = peak / nm
    a = 0.8795 + 0.0459 * np.exp(-((peak - 300) ** 2) / 11940)
    alpha = 1 / (np.exp(69.7 * (a - x)) + np.exp(28.0 * (0.922 - x)) + np.exp(-14.9 * (1.104 - x)) + 0.674)
    beta_peak, beta_width = 189 + 0.315 * peak, -40.5 + 0.195 * peak
    return alpha + 0.26 * np.exp(-(((nm - beta_peak) / beta_width) ** 2))


@dataclass(frozen=True)
class SpectralBands:
    """Bands of light and what each is worth to each receptor channel.

    wavelengths: (band,) [m], the bands' centres.
    weights: (channel, band); Σ_b weights[c, b] daylight(wavelengths[b]) = 1 for every channel c, so that a white
        surface in unit daylight gives 1.
    white_catch: (channel,) ∫ daylight(λ) λ S_c(λ) dλ [m²], S_c the pigment's quantal sensitivity with peak 1: what a
        white surface in unit daylight is worth before the weights are normalised.
    """

    wavelengths: np.ndarray
    weights: np.ndarray
    white_catch: np.ndarray

    @classmethod
    def uniform(
        cls, bands: int, lambda_max_nm: Sequence[float] = DEFAULT_LAMBDA_MAX_NM, range_nm: Sequence[float] = VISIBLE_NM
    ) -> SpectralBands:
        """Equal bands over `range_nm`; the weights integrate sensitivity x daylight exactly (to 1 nm) for every
        reflectance that is linear between the bands' centres: error O(bands⁻²) for smooth ones.

        Receptors count photons, radiance is energy: hence the factor λ beside the pigment's quantal sensitivity.
        """
        low, high = range_nm
        edges = np.linspace(low, high, whole("bands", bands, 1, FINEST) + 1)
        centres = (edges[:-1] + edges[1:]) / 2
        nm = np.arange(low, high + 0.5)
        light = daylight(nm * 1e-9)
        catch = np.stack([pigment_absorptance(nm * 1e-9, peak * 1e-9) * nm * light for peak in lambda_max_nm])
        catch[:, [0, -1]] /= 2  # trapezoid rule
        hats = np.stack([np.interp(nm, centres, row) for row in np.eye(len(centres))])
        weights = (catch @ hats.T) / catch.sum(axis=1, keepdims=True) / daylight(centres * 1e-9)
        return cls(centres * 1e-9, weights, catch.sum(axis=1) * 1e-18)

    @classmethod
    def for_tolerance(
        cls,
        tolerance: float,
        kernels: Callable[[np.ndarray], np.ndarray] | None = None,
        samples_per_receptor: int = 1,
        lambda_max_nm: Sequence[float] = DEFAULT_LAMBDA_MAX_NM,
        range_nm: Sequence[float] = VISIBLE_NM,
    ) -> SpectralBands:
        """The fewest bands, a power of two, that keep the predicted error of a receptor's signal within the tolerance,
        in units of white's signal. It is the sum of two:

        - reflectances (1 + cos(2π λ/Λ + φ))/2 of any phase φ, Λ the whole range: what the bands make of them against
          quadrature to 1 nm;
        - kernels(wavelengths) (wave, k, k), cells of 1/samples_per_receptor (None: the same for all wavelengths):
          the worst scene's difference between white light's kernel from n and from 2n bands.

        Raises:
            AccuracyError: 32 bands do not.
        """
        in_range("tolerance", tolerance, 1e-6, 0.5)
        total, coarse = math.inf, None
        for bands in CANDIDATES:
            chosen, finer = (cls.uniform(n, lambda_max_nm, range_nm) for n in (bands, 2 * bands))
            total = _reflectance_error(chosen, cls.uniform(FINEST, lambda_max_nm, range_nm), range_nm)
            if total > tolerance:
                continue
            if kernels is None:
                return chosen
            coarse = chosen.white_light(kernels(chosen.wavelengths)) if coarse is None else coarse
            fine = finer.white_light(kernels(finer.wavelengths))
            total += worst_difference([(1, coarse), (-1, fine)], samples_per_receptor)
            if total <= tolerance:
                return chosen
            coarse = fine
        raise AccuracyError(
            f"tolerance = {tolerance:g}: {CANDIDATES[-1]} bands leave a predicted error of {total:.1e} of white's "
            "signal; widen the tolerance or give a number of bands"
        )

    def white_light(self, kernels: np.ndarray) -> np.ndarray:
        """(channel, k, k): what a scene without colour in daylight has of kernels (band, k, k)."""
        return np.tensordot(self.weights * daylight(self.wavelengths), kernels, axes=1)


def _reflectance_error(chosen: SpectralBands, exact: SpectralBands, range_nm: Sequence[float]) -> float:
    """Worst over phases and channels: half of |Σ w d e^{2πiλ/Λ}|'s error."""
    period = (range_nm[1] - range_nm[0]) * 1e-9

    def catch(bands: SpectralBands) -> np.ndarray:
        return bands.weights @ (daylight(bands.wavelengths) * np.exp(2j * np.pi * bands.wavelengths / period))

    return float(np.abs(catch(chosen) - catch(exact)).max() / 2)
