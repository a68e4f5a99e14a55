"""Spectral bands and the three default receptor channels.

Sensitivities are visual pigment templates after Govardovskii, Fyhrquist, Reuter, Kuzmin & Donner (2000), "In search
of the visual pigment template", Visual Neuroscience 17:509-528, equations 1, 2 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources

import numpy as np

from optics.arguments import in_range

__all__ = ["DEFAULT_LAMBDA_MAX_NM", "SpectralBands", "cie_1931", "daylight", "pigment_absorptance"]

# Red, green and blue receptors, as swallowtail butterflies have them (Arikawa 2003, J. Comp. Physiol. A 189:791):
# far enough apart to tell colours as three RGB channels do, which human cones (566, 541, 441 nm) are not.
DEFAULT_LAMBDA_MAX_NM = (600.0, 520.0, 460.0)
VISIBLE_NM = (400.0, 700.0)


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
    if not np.all((nm > low - 1e-6) & (nm < high + 1e-6)):
        raise ValueError(f"wavelengths = {np.asarray(wavelengths)} m: must lie in [{low:g}e-9, {high:g}e-9]")
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
    """

    wavelengths: np.ndarray
    weights: np.ndarray

    @classmethod
    def uniform(
        cls, bands: int, lambda_max_nm: Sequence[float] = DEFAULT_LAMBDA_MAX_NM, range_nm: Sequence[float] = VISIBLE_NM
    ) -> SpectralBands:
        """Equal bands over `range_nm`; the weights integrate sensitivity x daylight exactly (to 1 nm) for every
        reflectance that is linear between the bands' centres: error O(bands⁻²) for smooth ones.

        Receptors count photons, radiance is energy: hence the factor λ beside the pigment's quantal sensitivity.
        """
        if int(bands) != bands or not 1 <= bands <= 64:
            raise ValueError(f"bands = {bands!r}: must be a whole number in [1, 64]")
        low, high = range_nm
        edges = np.linspace(low, high, int(bands) + 1)
        centres = (edges[:-1] + edges[1:]) / 2
        nm = np.arange(low, high + 0.5)
        light = daylight(nm * 1e-9)
        catch = np.stack([pigment_absorptance(nm * 1e-9, peak * 1e-9) * nm * light for peak in lambda_max_nm])
        catch[:, [0, -1]] /= 2  # trapezoid rule
        hats = np.stack([np.interp(nm, centres, row) for row in np.eye(len(centres))])
        weights = (catch @ hats.T) / catch.sum(axis=1, keepdims=True) / daylight(centres * 1e-9)
        return cls(centres * 1e-9, weights)
