"""Derivatives of fields through steps from plane to plane. The steps are linear maps computed in NumPy.

A step maps the field u to A u. Its adjoint Aᴴ carries the gradient of a loss backward: the transforms have the opposite
sign, and factors are conjugate. The rate ∂A/∂z of a step multiplies each wave of the spectrum by ik (cos θ - 1). The
rate ik of the carrier exp(ikz) is left out. It is the same for all waves, so it has no effect on the intensity except
rounding errors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array, Scalar, carries_derivative, number
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, padded_for_packets

__all__ = ["LinearMap", "mapped"]

Complexes = np.ndarray


@dataclass(frozen=True)
class LinearMap:
    """A linear map A of complex fields (y, x), its adjoint, and its rate ∂A/∂z.

    rate: None if the map has no parameter z.
    """

    forward: Callable[[Complexes], Complexes]
    adjoint: Callable[[Complexes], Complexes]
    rate: Callable[[Complexes], Complexes] | None = None


def mapped(field: Field, values: Complexes, grid: Grid, linear: LinearMap, z: Scalar = 0.0) -> Field:
    """Return the field A u on a grid, the result of applying a linear map A to a field u.

    The result carries the derivatives of u. If the rate ∂A/∂z of A is given (`LinearMap.rate`), the result also carries
    the derivatives of the parameter z.

    field: u.
    values: A u (y, x), which has been computed before.
    """
    import drjit as dr

    types, shape, rate = field.types, field.grid.shape, None
    if linear.rate is not None and carries_derivative(z):
        rate = linear.rate(field.numpy())

    class LinearStep(dr.CustomOp):
        """The linear map A as an operation of Dr.Jit that carries derivatives forward and backward."""

        def eval(self, re: Array, im: Array, z: Array) -> tuple[Array, Array]:
            return _parts(values, types)

        def forward(self) -> None:
            change = linear.forward(_complexes(self.grad_in("re"), self.grad_in("im"), shape, types))
            if rate is not None:
                change = change + rate * rate.dtype.type(number(self.grad_in("z")))
            self.set_grad_out(_parts(change, types))

        def backward(self) -> None:
            grad: Any = self.grad_out()
            given = _complexes(grad[0], grad[1], grid.shape, types)
            re, im = _parts(linear.adjoint(given), types)
            self.set_grad_in("re", re)
            self.set_grad_in("im", im)
            if rate is not None:
                self.set_grad_in("z", types.Float64(float(np.vdot(given.astype(np.complex128), rate).real)))

    re, im = dr.custom(LinearStep, field.re, field.im, opaque(types, z))
    return Field(re, im, grid, types)


def _complexes(re: Array, im: Array, shape: tuple[int, int], types: Precision) -> Complexes:
    return Field(types.Float(re), types.Float(im), Grid(shape, 1.0), types).numpy()


def _parts(values: Complexes, types: Precision) -> tuple[Array, Array]:
    re, im = (types.Float(padded_for_packets(np.asarray(part, types.dtype))) for part in (values.real, values.imag))
    return re, im
