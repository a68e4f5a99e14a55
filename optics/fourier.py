"""Centred two-dimensional Fourier sums of any size and period.

One function, `dft2`, stands for all transforms of this package:

    U[k] = Σ_j u[j] exp(± 2πi j·k / period),   j and k counted from the centre sample n//2.

The period is free (a matrix DFT evaluates any output pitch); a whole period may go through the FFT. Which of the two
runs is decided here by predicted time: Dr.Jit's matrix product does about 80 Gflop/s per 2 cores, SciPy's FFT about
8 Gflop/s, so matrices win for small windows and the FFT for large ones. Both are differentiable.
"""

from __future__ import annotations

from math import log2
from typing import Any

import numpy as np

from optics.field import Field
from optics.grid import Grid
from optics.precision import Precision

__all__ = ["dft2", "fast_length", "predicted_seconds"]


def fast_length(least: float) -> int:
    """Smallest 5-smooth integer >= least: the FFT is fast there."""
    from scipy.fft import next_fast_len

    return int(next_fast_len(max(1, int(np.ceil(least))), real=True))


def dft2(field: Field, period: float, shape: tuple[int, int], sign: int, pitch: float) -> Field:
    """Fourier sum of a field onto `shape` samples (formula above), on a grid of the given output pitch.

    sign: -1 forward (exp(-2πi...)), +1 inverse; neither is normalised.
    """
    grid = Grid(shape, pitch)
    if _fft_wins(field.grid.shape, period, shape):
        re, im = _fft(field, int(period), shape, sign)
    else:
        re, im = _matrix_dft(field, period, shape, sign)
    return Field(re, im, grid, field.types)


def predicted_seconds(shape_in: tuple[int, int], period: float, shape_out: tuple[int, int]) -> float:
    """Time one `dft2` takes on two cores, roughly."""
    if _fft_wins(shape_in, period, shape_out):
        return _fft_seconds(shape_in, int(period), shape_out)
    return _matrix_seconds(shape_in, shape_out)


def _fft_wins(shape_in: tuple[int, int], period: float, shape_out: tuple[int, int]) -> bool:
    if not float(period).is_integer():
        return False
    return _fft_seconds(shape_in, int(period), shape_out) < _matrix_seconds(shape_in, shape_out)


def _matrix_seconds(shape_in: tuple[int, int], shape_out: tuple[int, int]) -> float:
    (ny, nx), (my, mx) = shape_in, shape_out
    return 8 * (ny * nx * mx + ny * mx * my) / 80e9 + 2e-4


def _fft_seconds(shape_in: tuple[int, int], period: int, shape_out: tuple[int, int]) -> float:
    lines = shape_in[0] + shape_out[1]
    return lines * period * (5 * log2(period + 1) / 8e9 + 8e-9) + 2e-4


def _fourier_matrix(types: Precision, n_out: int, n_in: int, period: float, sign: int) -> tuple[Any, Any]:
    """cos and sin of ±2π k j / period as (k, j) tensors; the product k j loses whole periods in float64."""
    matrix = Grid((n_out, n_in), 1.0)
    j, k = matrix.coordinates(types)
    import drjit as dr

    waves = j * k / dr.opaque(types.Float64, sign * period)
    wheel = Field.from_waves(1.0, waves, matrix, types)
    return types.Tensor(wheel.re, matrix.shape), types.Tensor(wheel.im, matrix.shape)


def _matrix_dft(field: Field, period: float, shape: tuple[int, int], sign: int) -> tuple[Any, Any]:
    import drjit as dr

    matmul: Any = dr.matmul
    types, (ny, nx), (my, mx) = field.types, field.grid.shape, shape
    re, im = types.Tensor(field.re, (ny, nx)), types.Tensor(field.im, (ny, nx))
    cos, sin = _fourier_matrix(types, mx, nx, period, sign)
    re, im = (
        matmul(re, cos, Bt=True) - matmul(im, sin, Bt=True),
        matmul(re, sin, Bt=True) + matmul(im, cos, Bt=True),
    )
    if (my, ny) != (mx, nx):
        cos, sin = _fourier_matrix(types, my, ny, period, sign)
    re, im = matmul(cos, re) - matmul(sin, im), matmul(cos, im) + matmul(sin, re)
    return re.array, im.array


def _fft(field: Field, period: int, shape: tuple[int, int], sign: int) -> tuple[Any, Any]:
    import drjit as dr

    types, shape_in = field.types, field.grid.shape

    def transform(re: Any, im: Any, to: tuple[int, int], from_: tuple[int, int], turn: int) -> tuple[Any, Any]:
        u = np.empty(from_, dtype=types.complex_dtype)
        u.real, u.imag = re.numpy().reshape(from_), im.numpy().reshape(from_)
        for axis in (1, 0):
            u = _fft_axis(u, period, to[axis], turn, axis)
        return types.Float(np.ascontiguousarray(u.real).ravel()), types.Float(np.ascontiguousarray(u.imag).ravel())

    class FourierSum(dr.CustomOp):
        """Its adjoint is the sum with the other sign, from the output's samples to the input's."""

        def eval(self, re: Any, im: Any) -> tuple[Any, Any]:
            return transform(re, im, shape, shape_in, sign)

        def forward(self) -> None:
            self.set_grad_out(transform(self.grad_in("re"), self.grad_in("im"), shape, shape_in, sign))

        def backward(self) -> None:
            grad: Any = self.grad_out()
            re, im = transform(grad[0], grad[1], shape_in, shape, -sign)
            self.set_grad_in("re", re)
            self.set_grad_in("im", im)

    return dr.custom(FourierSum, field.re, field.im)


def _fft_axis(u: np.ndarray, period: int, n_out: int, sign: int, axis: int) -> np.ndarray:
    """Sum along one axis: wrap the centred samples into one period, transform, unwrap as many as asked."""
    from scipy import fft

    u = np.moveaxis(u, axis, -1)
    n_in = u.shape[-1]
    places = (np.arange(n_in) - n_in // 2) % period
    wrapped = np.zeros((*u.shape[:-1], period), dtype=u.dtype)
    for start in range(0, n_in, period):  # an input longer than the period folds onto itself
        part = slice(start, min(start + period, n_in))
        wrapped[..., places[part]] += u[..., part]
    if sign < 0:
        spectrum = fft.fft(wrapped, axis=-1, overwrite_x=True)
    else:
        spectrum = fft.ifft(wrapped, axis=-1, norm="forward", overwrite_x=True)
    return np.moveaxis(spectrum[..., (np.arange(n_out) - n_out // 2) % period], -1, axis)
