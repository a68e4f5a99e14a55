"""Refractive index of materials: constant, or dispersive after Cauchy, Sellmeier or Cornu."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from optics.numerics.arguments import finite, in_range, one_of, positive, shown, vacuum_wavelength, without_derivative
from optics.numerics.autodiff import Scalar, is_differentiable, number, of_torch

__all__ = ["MEDIA", "Cornu", "Dispersion", "RefractiveIndex", "Sellmeier", "index_of", "material", "medium"]

LARGEST = 10.0
# Fraunhofer lines of the Abbe number V_d = (n_d - 1) / (n_F - n_C) [m].
LINE_F, LINE_D, LINE_C = 486.134e-9, 587.562e-9, 656.281e-9
UM = 1e-6


class Dispersion(ABC):
    """A material's refractive index over wavelength, between 1 (vacuum) and 10."""

    def at(self, wavelength: float) -> Scalar:
        """Return n at a vacuum wavelength [m]. It carries derivatives if the coefficients do.

        Raises:
            ValueError: the wavelength is invalid, or n is outside [1, 10] there.
        """
        n = self._n(vacuum_wavelength(wavelength))
        value = self._number(wavelength, n)
        if not value >= 1:
            raise ValueError(f"n = {value:g} at wavelength {wavelength:g} m: must be at least 1")
        if value > LARGEST:
            hint = "b is in m²: 4.2e-3 µm² are 4.2e-15"
            raise ValueError(f"n = {value:g} at wavelength {wavelength:g} m: must be at most {LARGEST:g} ({hint})")
        return n

    def step(self, wavelength: float, before: float) -> Scalar:
        """Return this material's index at a vacuum wavelength [m] minus `before`, the index of the medium in front."""
        return self.at(wavelength) - before

    @property
    def is_differentiable(self) -> bool:
        """True if the curve carries derivatives."""
        return False

    @abstractmethod
    def _n(self, wavelength: float) -> Scalar:
        """Return the index at a vacuum wavelength [m], without checking its range."""

    def _number(self, wavelength: float, n: Scalar) -> float:
        """Return the refractive index `n`, a result of `_n`, as a plain number without derivatives."""
        return number(n)


@dataclass(frozen=True)
class RefractiveIndex(Dispersion):
    """n(λ) = A + B/λ² + C/λ⁴ + D/λ⁶ (Cauchy's equation; Born & Wolf, Principles of Optics, §2.3.3), λ in vacuum.

    a: A, at least 1 (vacuum).
    b, c, d: B [m²], C [m⁴] and D [m⁶]; 0 for a material without dispersion.

    a and b may carry derivatives.

    Raises:
        ValueError: a is outside [1, 10], or b, c or d is not finite.
    """

    a: Scalar
    b: Scalar = 0.0
    c: float = 0.0
    d: float = 0.0

    def __post_init__(self) -> None:
        in_range("n", self.a, 1.0, 10.0, carried=True)
        finite("b", self.b, carried=True)
        for name in ("c", "d"):
            finite(name, getattr(self, name))

    @classmethod
    def from_abbe(cls, n_d: float, abbe_number: float) -> RefractiveIndex:
        """Return the Cauchy curve with index n_d at 587.562 nm and the given Abbe number (infinite: no dispersion).

        Raises:
            ValueError: n_d or A, the curve's limit at long wavelengths, is outside [1, 10], or the Abbe number is not
                positive.
        """
        in_range("n_d", n_d, 1.0, 10.0, carried=True)
        number = positive("abbe_number", abbe_number, "1", infinite=True)
        b = (n_d - 1) / number / (LINE_F**-2 - LINE_C**-2)
        return cls(n_d - b / LINE_D**2, b)

    @property
    def is_differentiable(self) -> bool:
        return is_differentiable(self.a) or is_differentiable(self.b)

    def _n(self, wavelength: float) -> Scalar:
        return self._curve(self.a, self.b, wavelength)

    def _number(self, wavelength: float, n: Scalar) -> float:
        if of_torch(self.a) or of_torch(self.b):  # A copy of their numbers may be kept, but none of n.
            return float(self._curve(number(self.a), number(self.b), wavelength))
        return number(n)

    def _curve(self, a: Scalar, b: Scalar, wavelength: float) -> Scalar:
        square = wavelength**2
        higher = self.c / square**2 + self.d / square**3
        found = a + b / square
        return found if higher == 0 else found + higher


@dataclass(frozen=True)
class Sellmeier(Dispersion):
    """n²(λ) = 1 + Σ B λ²/(λ² - C), λ in vacuum.

    strengths: B, a tuple or a list.
    poles_um2: C [µm²], one for each of the strengths.

    Raises:
        ValueError: an argument is neither a tuple nor a list, there are no terms, the numbers of strengths and poles
            differ, or a number is not finite.
    """

    strengths: tuple[float, ...]
    poles_um2: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("strengths", "poles_um2"):
            values = without_derivative(name, getattr(self, name))
            if not isinstance(values, (tuple, list)) or not values:
                raise ValueError(f"{name} = {shown(values)}: must be a row of numbers")
            object.__setattr__(self, name, tuple(finite(name, value) for value in values))
        if len(self.strengths) != len(self.poles_um2):
            raise ValueError(f"{len(self.poles_um2)} poles_um2: must be one per strength, {len(self.strengths)}")

    def _n(self, wavelength: float) -> float:
        square = (wavelength / UM) ** 2
        if any(square == pole for pole in self.poles_um2):
            return math.inf
        total = 1 + sum(b * square / (square - c) for b, c in zip(self.strengths, self.poles_um2, strict=True))
        return math.sqrt(max(total, 0.0))


@dataclass(frozen=True)
class Cornu(Dispersion):
    """n(λ) = a + b/(λ - c), λ in vacuum; b and c in µm. Only wavelengths above c are valid.

    Raises:
        ValueError: a number is not finite.
    """

    a: float
    b_um: float
    c_um: float

    def __post_init__(self) -> None:
        for name in ("a", "b_um", "c_um"):
            finite(name, getattr(self, name))

    def _n(self, wavelength: float) -> float:
        beyond = wavelength / UM - self.c_um
        return self.a + self.b_um / beyond if beyond > 0 else math.inf


def _cauchy(a: float, b: float, c: float, d: float) -> RefractiveIndex:
    """Return the Cauchy curve for coefficients that refer to wavelengths in nm."""
    return RefractiveIndex(a, b * 1e-18, c * 1e-36, d * 1e-54)


MEDIA: dict[str, Dispersion] = {
    # Daimon & Masumura, Appl. Opt. 46, 3811 (2007): distilled water at 20 °C, 182 to 1129 nm.
    "water": Sellmeier(
        (5.684027565e-1, 1.726177391e-1, 2.086189578e-2, 1.130748688e-1),
        (5.101829712e-3, 1.821153936e-2, 2.620722293e-2, 1.069792721e1),
    ),
    # Atchison & Smith, J. Opt. Soc. Am. A 22, 29 (2005), table 2: human media after Le Grand, 400 to 900 nm.
    "cornea": _cauchy(1.361594, 6009.687, -6.760760e8, 5.908450e13),
    "aqueous": _cauchy(1.321631, 6070.796, -7.062305e8, 6.147861e13),
    "vitreous": _cauchy(1.322357, 5560.240, -5.817391e8, 5.036810e13),
    # Thibos, Ye, Zhang & Bradley, Appl. Opt. 31, 3594 (1992): one medium with the dispersion of a whole human eye.
    "chromatic_eye": Cornu(1.320535, 0.004685, 0.214102),
}


def medium(name: str) -> Dispersion:
    """Return the dispersion of a medium of eyes.

    name: "water", "cornea", "aqueous", "vitreous", or "chromatic_eye", the single medium of Thibos' reduced human eye.
        The curve of water was measured from 182 to 1129 nm. The curves of cornea, aqueous and vitreous hold from 400 to
        900 nm. Beyond these ranges, the curves are extrapolated.

    Raises:
        ValueError: the medium is unknown.
    """
    return MEDIA[one_of("medium", name, MEDIA)]


def index_of(name: str, value: Any) -> Dispersion:
    """Return a dispersion curve without derivatives: `value` itself, or a constant curve if it is a number.

    name: name of the argument, for error messages.

    Raises:
        ValueError: value is neither a number in [1, 10] nor a curve, or it carries a derivative.
    """
    if isinstance(value, Dispersion):
        if value.is_differentiable:
            raise ValueError(f"{name} requires a derivative, but none is propagated through it: pass plain numbers")
        return value
    _refuse_name(name, value)
    return _constant(in_range(name, value, 1.0, 10.0))


@lru_cache(maxsize=64)
def _constant(n: float) -> RefractiveIndex:
    """Return the curve of a medium without dispersion. Curves are cached, because many pupils have the same medium."""
    return RefractiveIndex(n)


def material(name: str, value: Any) -> Dispersion:
    """Return a dispersion curve: `value` itself, or a constant curve if `value` is a number.

    The value may carry derivatives, which are kept.

    name: name of the argument, for error messages.

    Raises:
        ValueError: value is neither a number in [1, 10] nor a curve.
    """
    if isinstance(value, Dispersion):
        return value
    _refuse_name(name, value)
    in_range(name, value, 1.0, 10.0, carried=True)
    return RefractiveIndex(value)


def _refuse_name(name: str, value: Any) -> None:
    if isinstance(value, str):
        raise ValueError(f"{name} = {value!r}: must be a number, or a curve such as optics.medium('water')")
