"""The class `Field`: complex numbers on a grid, which represent a light field or a phase factor."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from optics.numerics.autodiff import Array, Scalar
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, padded_for_packets

__all__ = ["Field"]


@dataclass(frozen=True)
class Field:
    """Complex amplitude on a grid; re and im are flat Dr.Jit arrays, row by row."""

    re: Array
    im: Array
    grid: Grid
    types: Precision

    @classmethod
    def from_waves(cls, amplitude: Array, waves: Array, grid: Grid, types: Precision) -> Field:
        """Return amplitude · exp(2πi waves), with waves in float64.

        Whole waves are subtracted before the conversion to the type of the field.
        """
        import drjit as dr

        angle = types.Float(waves - dr.round(waves)) * (2 * pi)
        sin, cos = dr.sincos(angle)
        amplitude = types.Float(amplitude)
        return cls(amplitude * cos, amplitude * sin, grid, types)

    @classmethod
    def from_numpy(cls, u: np.ndarray, dx: float, types: Precision) -> Field:
        u = np.asarray(u, dtype=types.complex_dtype)
        return cls(
            types.Float(padded_for_packets(u.real)), types.Float(padded_for_packets(u.imag)), Grid(u.shape, dx), types
        )

    def __mul__(self, other: Field) -> Field:
        re = self.re * other.re - self.im * other.im
        im = self.re * other.im + self.im * other.re
        return Field(re, im, self.grid, self.types)

    def __add__(self, other: Field) -> Field:
        return Field(self.re + other.re, self.im + other.im, self.grid, self.types)

    def scaled(self, factor: Scalar) -> Field:
        scale = self.types.Float(opaque(self.types, factor))
        return Field(self.re * scale, self.im * scale, self.grid, self.types)

    @property
    def intensity(self) -> Array:
        return self.re * self.re + self.im * self.im

    def evaluated(self) -> Field:
        """Return this field after evaluating its real and imaginary part in one kernel.

        If the parts were evaluated one after the other, their common terms would be computed twice.
        """
        import drjit as dr

        dr.eval(self.re, self.im)
        return self

    def tensors(self) -> tuple[Array, Array]:
        """Return the real and the imaginary part as Dr.Jit tensors (y, x)."""
        re, im = (self.types.Tensor(part, self.grid.shape) for part in (self.re, self.im))
        return re, im

    def numpy(self) -> np.ndarray:
        self.evaluated()
        found = np.empty(self.grid.shape, self.types.complex_dtype)
        found.real, found.imag = (part.numpy().reshape(self.grid.shape) for part in (self.re, self.im))
        return found
