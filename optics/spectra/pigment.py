"""Visual pigments: spectral sensitivity, given the wavelength of the peak.

The templates were published by Govardovskii, Fyhrquist, Reuter, Kuzmin & Donner (2000), "In search of the visual
pigment template", Visual Neuroscience 17:509-528. They describe the absorbance of pigments with retinal (A1) or
3,4-didehydroretinal (A2), measured for peaks from 357 to 620 nm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from optics.numerics.arguments import in_range, one_of, vacuum_wavelengths

__all__ = ["CHROMOPHORES", "Pigment", "pigment_absorptance"]

LAMBDA_MAX_NM = (330.0, 700.0)


@dataclass(frozen=True)
class _Template:
    """Parameters of a pigment template of Govardovskii et al. (2000): the α band and the β band.

    The α band is 1 / (exp A(a - x) + exp B(b - x) + exp C(c - x) + D) with x = λmax/λ (their eq. 1). The β band is a
    Gaussian (their eq. 4).

    A, a, beta_peak [nm] and beta_width [nm] are functions of λmax [nm]; the other parameters are numbers.
    """

    A: Callable[[float], float]
    a: Callable[[float], float]
    B: float
    b: float
    C: float
    c: float
    D: float
    beta_height: float
    beta_peak: Callable[[float], float]
    beta_width: Callable[[float], float]


CHROMOPHORES = {
    "A1": _Template(  # eqs. 2, 5a, 5b
        A=lambda peak: 69.7,
        a=lambda peak: 0.8795 + 0.0459 * np.exp(-((peak - 300) ** 2) / 11940),
        B=28.0,
        b=0.922,
        C=-14.9,
        c=1.104,
        D=0.674,
        beta_height=0.26,
        beta_peak=lambda peak: 189 + 0.315 * peak,
        beta_width=lambda peak: -40.5 + 0.195 * peak,
    ),
    "A2": _Template(  # eqs. 6a, 6b, 8a, 8b
        A=lambda peak: 62.7 + 1.834 * np.exp((peak - 625) / 54.2),
        a=lambda peak: 0.875 + 0.0268 * np.exp((peak - 665) / 40.7),
        B=20.85,
        b=0.9101,
        C=-10.37,
        c=1.1123,
        D=0.5343,
        beta_height=0.37,
        beta_peak=lambda peak: 216.7 + 0.287 * peak,
        beta_width=lambda peak: 317 - 1.149 * peak + 0.00124 * peak**2,
    ),
}


def pigment_absorptance(wavelengths: np.ndarray, lambda_max: float, chromophore: str = "A1") -> np.ndarray:
    """Return the quantal sensitivity of a visual pigment at `wavelengths` [m], an array of any shape.

    It is the sum of the α band, with a peak of 1 at `lambda_max` [m], and the β band.

    Raises:
        ValueError: lambda_max is outside 330-700 nm, the chromophore is neither "A1" nor "A2", or a wavelength is not
            positive or is above 1 m.
    """
    t = CHROMOPHORES[one_of("chromophore", chromophore, CHROMOPHORES)]
    peak = in_range("lambda_max", lambda_max, LAMBDA_MAX_NM[0] * 1e-9, LAMBDA_MAX_NM[1] * 1e-9) * 1e9
    nm = vacuum_wavelengths(wavelengths) * 1e9
    x = peak / nm
    slope = t.A(peak)
    alpha = 1 / (np.exp(slope * (t.a(peak) - x)) + np.exp(t.B * (t.b - x)) + np.exp(t.C * (t.c - x)) + t.D)
    return alpha + t.beta_height * np.exp(-(((nm - t.beta_peak(peak)) / t.beta_width(peak)) ** 2))


@dataclass(frozen=True)
class Pigment:
    """A receptor type with the sensitivity of its visual pigment.

    lambda_max_nm: peak of the α band [nm], in [330, 700].
    chromophore: "A1" (retinal) or "A2" (3,4-didehydroretinal, as in freshwater fish and amphibians).

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    lambda_max_nm: float
    chromophore: str = "A1"

    def __post_init__(self) -> None:
        object.__setattr__(self, "lambda_max_nm", in_range("lambda_max_nm", self.lambda_max_nm, *LAMBDA_MAX_NM))
        one_of("chromophore", self.chromophore, CHROMOPHORES)

    @property
    def peak_nm(self) -> float:
        """Wavelength of the peak of the α band [nm]."""
        return self.lambda_max_nm

    def at(self, wavelengths: np.ndarray) -> np.ndarray:
        """Return the quantal sensitivity at `wavelengths` [m], an array of any shape.

        Raises:
            ValueError: a wavelength is not positive, or is above 1 m.
        """
        return pigment_absorptance(wavelengths, self.lambda_max_nm * 1e-9, self.chromophore)
