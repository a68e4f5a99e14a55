"""Refractive index of the pupil's material: constant, or dispersive after Cauchy."""

from __future__ import annotations

from dataclasses import dataclass

from optics.numerics.arguments import finite, in_range, positive, vacuum_wavelength, without_derivative
from optics.numerics.autodiff import Scalar, number

__all__ = ["RefractiveIndex"]

LARGEST = 10.0
# Fraunhofer lines of the Abbe number V_d = (n_d - 1) / (n_F - n_C) [m].
LINE_F, LINE_D, LINE_C = 486.134e-9, 587.562e-9, 656.281e-9


@dataclass(frozen=True)
class RefractiveIndex:
    """n(λ) = A + B/λ² (Cauchy's equation; Born & Wolf, Principles of Optics, §2.3.3), λ in vacuum.

    a: A, at least 1 (vacuum): this package's media neither amplify nor have negative index.
    b: B [m²]; 0 is a material without dispersion.
    """

    a: Scalar
    b: Scalar = 0.0

    def __post_init__(self) -> None:
        in_range("n", self.a, 1.0, 10.0)
        finite("b", self.b)

    @classmethod
    def from_abbe(cls, n_d: float, abbe_number: float) -> RefractiveIndex:
        """The Cauchy curve with index n_d at 587.562 nm and the given Abbe number (infinite: no dispersion)."""
        in_range("n_d", n_d, 1.0, 10.0)
        number = positive("abbe_number", without_derivative("abbe_number", abbe_number), "1", infinite=True)
        b = (n_d - 1) / number / (LINE_F**-2 - LINE_C**-2)
        return cls(n_d - b / LINE_D**2, b)

    def at(self, wavelength: float) -> Scalar:
        """n at a vacuum wavelength [m]; a Dr.Jit array if the coefficients are.

        Raises:
            ValueError: the curve leaves [1, 10] there.
        """
        n = self.a + self.b / vacuum_wavelength(wavelength) ** 2
        value = number(n)
        if not value >= 1:
            raise ValueError(f"n = {value:g} at wavelength {wavelength:g} m: must be at least 1")
        if value > LARGEST:
            hint = "b is in m²: 4.2e-3 µm² are 4.2e-15"
            raise ValueError(f"n = {value:g} at wavelength {wavelength:g} m: must be at most {LARGEST:g} ({hint})")
        return n
