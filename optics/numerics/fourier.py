"""Centred two-dimensional Fourier sums of any size and period.

One function, `dft2`, stands for all transforms of this package:

    U[k] = Σ_j u[j] exp(± 2πi j·k / period),   j and k counted from the centre sample n//2.

The period is free (a matrix DFT evaluates any output pitch); a whole period may go through the FFT. Which of the two
runs is decided here by predicted time on one core: Dr.Jit's matrix product does about 45 Gflop/s, SciPy's FFT about
12 Gflop/s less the copies, so matrices win for small windows and the FFT for large ones. Both are differentiable.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, log2
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array, Scalar, is_differentiable
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.matrices import complex_matmul
from optics.numerics.precision import Precision, opaque, padded_for_packets

__all__ = [
    "dft2",
    "fast_length",
    "fourier_sum",
    "kept_indices",
    "periodic_spectrum",
    "periodic_sum",
    "predicted_seconds",
]

LONGEST_FFT = 2**31


def fast_length(least: float) -> int:
    """Smallest 5-smooth integer >= least: the FFT is fast there."""
    from scipy.fft import next_fast_len

    if least > LONGEST_FFT:
        return ceil(least)  # no FFT will be that long
    return int(next_fast_len(max(1, ceil(least)), real=True))


def dft2(
    field: Field,
    period: Scalar,
    shape: tuple[int, int],
    sign: int,
    pitch: float,
    centre: tuple[float, float] = (0.0, 0.0),
) -> Field:
    """Fourier sum of a field onto `shape` samples (formula above), on a grid of the given output pitch.

    centre: where the output's centre sample lies (x, y), in units of the pitch times its index (k = centre / pitch).

    sign: -1 forward (exp(-2πi...)), +1 inverse; neither is normalised.
    """
    grid = Grid(shape, pitch, centre)
    if centre != (0.0, 0.0):
        field = _recentred(field, period, (sign * centre[0] / pitch, sign * centre[1] / pitch))
    if not is_differentiable(period) and _fft_wins(field.grid.shape, period, shape):
        re, im = _fft(field, int(period), shape, sign)
    else:
        re, im = _matrix_dft(field, period, shape, sign)
    return Field(re, im, grid, field.types)


def fourier_sum(u: np.ndarray, period: float, shape: tuple[int, int], sign: int) -> np.ndarray:
    """The same sum of a complex NumPy array, without derivative and without the way through Dr.Jit."""
    if _fft_wins(u.shape, period, shape):
        for axis in (1, 0):
            u = _fft_axis(u, int(period), shape[axis], sign, axis)
        return u
    down, across = (dft_matrix(m, n, period, sign, u.dtype.str) for m, n in zip(shape, u.shape, strict=True))
    return down @ u @ across.T


@lru_cache(maxsize=16)
def dft_matrix(n_out: int, n_in: int, period: float, sign: int, dtype: str) -> np.ndarray:
    """exp(±2πi k j / period) as a (k, j) matrix."""
    waves = np.outer(np.arange(n_out) - n_out // 2, np.arange(n_in) - n_in // 2) / period
    return np.exp(2j * np.pi * sign * (waves - np.round(waves))).astype(dtype)


def _recentred(field: Field, period: Scalar, by: tuple[float, float]) -> Field:
    """Field times exp(2πi j·by / period), which moves the sum's centre."""
    types = field.types
    x, y = Grid(field.grid.shape, 1.0).coordinates(types)
    waves = (x * opaque(types, by[0]) + y * opaque(types, by[1])) / opaque(types, period)
    return field * Field.from_waves(1.0, waves, field.grid, types)


def periodic_spectrum(u: np.ndarray, period: int, across: int) -> np.ndarray:
    """Σ_j u[j] exp(-2πi j·k / period) of a complex NumPy array u (y, x) no larger than a period, as (across fx, period
    fy): FFT order, along fx only `kept_indices(period, across)`. Lines that lie in one piece transform twice as fast,
    hence fy is last."""
    from scipy import fft

    rows = fft.fft(_wrap(u, period, 1), axis=1, overwrite_x=True)
    if across < period:
        rows = rows[:, kept_indices(period, across)]
    return fft.fft(_wrap(np.ascontiguousarray(rows.T), period, 1), axis=1, overwrite_x=True)


def periodic_sum(spectrum: np.ndarray, period: int, step: int, shape: tuple[int, int]) -> np.ndarray:
    """Σ_k U[k] exp(2πi j·k / period) of what `periodic_spectrum` returns, at every `step`-th j around the centre, as
    (y, x)."""
    from scipy import fft

    rows, columns = ((np.arange(n) - n // 2) * step % period for n in shape)
    lines = fft.ifft(spectrum, axis=1, norm="forward", overwrite_x=True)[:, rows].T
    if spectrum.shape[0] < period:
        whole = np.zeros((len(rows), period), spectrum.dtype)
        whole[:, kept_indices(period, spectrum.shape[0])] = lines
        lines = whole
    else:
        lines = np.ascontiguousarray(lines)
    return fft.ifft(lines, axis=1, norm="forward", overwrite_x=True)[:, columns]


def kept_indices(period: int, across: int) -> np.ndarray:
    """The `across` indices nearest 0, in FFT order: 0, 1, …, -2, -1."""
    kept = np.arange(across) - across // 2
    return np.roll(kept, -(across // 2))


def predicted_seconds(shape_in: tuple[int, int], period: float, shape_out: tuple[int, int]) -> float:
    """Time one `dft2` takes on one core, roughly."""
    if _fft_wins(shape_in, period, shape_out):
        return _fft_seconds(shape_in, int(period), shape_out)
    return _matrix_seconds(shape_in, shape_out)


def _fft_wins(shape_in: tuple[int, int], period: float, shape_out: tuple[int, int]) -> bool:
    if not float(period).is_integer():
        return False
    return _fft_seconds(shape_in, int(period), shape_out) < _matrix_seconds(shape_in, shape_out)


def _matrix_seconds(shape_in: tuple[int, int], shape_out: tuple[int, int]) -> float:
    (ny, nx), (my, mx) = shape_in, shape_out
    return 8 * (ny * nx * mx + ny * mx * my) / 45e9 + 2e-4


def _fft_seconds(shape_in: tuple[int, int], period: int, shape_out: tuple[int, int]) -> float:
    lines, copied = shape_in[0] + shape_out[1], shape_in[0] * shape_in[1] + shape_out[0] * shape_out[1]
    return lines * period * (5 * log2(period + 1) / 12e9 + 5e-9) + copied * 8e-9 + 2e-4


def _fourier_matrix(types: Precision, n_out: int, n_in: int, period: Scalar, sign: int) -> tuple[Array, Array]:
    """cos and sin of ±2π k j / period as (k, j) tensors; the product k j loses whole periods in float64."""
    matrix = Grid((n_out, n_in), 1.0)
    j, k = matrix.coordinates(types)
    waves = j * k / opaque(types, sign * period)
    wheel = Field.from_waves(1.0, waves, matrix, types)
    return types.Tensor(wheel.re, matrix.shape), types.Tensor(wheel.im, matrix.shape)


def _matrix_dft(field: Field, period: Scalar, shape: tuple[int, int], sign: int) -> tuple[Array, Array]:
    types, (ny, nx), (my, mx) = field.types, field.grid.shape, shape
    u = types.Tensor(field.re, (ny, nx)), types.Tensor(field.im, (ny, nx))
    wheel = _fourier_matrix(types, mx, nx, period, sign)
    u = complex_matmul(u, wheel, transposed=True)
    if (my, ny) != (mx, nx):
        wheel = _fourier_matrix(types, my, ny, period, sign)
    re, im = complex_matmul(wheel, u)
    return re.array, im.array


def _fft(field: Field, period: int, shape: tuple[int, int], sign: int) -> tuple[Array, Array]:
    import drjit as dr

    types, shape_in = field.types, field.grid.shape

    def transform(re: Array, im: Array, to: tuple[int, int], from_: tuple[int, int], turn: int) -> tuple[Array, Array]:
        u = np.empty(from_, dtype=types.complex_dtype)
        u.real, u.imag = re.numpy().reshape(from_), im.numpy().reshape(from_)
        for axis in (1, 0):
            u = _fft_axis(u, period, to[axis], turn, axis)
        return types.Float(padded_for_packets(u.real)), types.Float(padded_for_packets(u.imag))

    class FourierSum(dr.CustomOp):
        """Its adjoint is the sum with the other sign, from the output's samples to the input's."""

        def eval(self, re: Array, im: Array) -> tuple[Array, Array]:
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

    wrapped = _wrap(u, period, axis)
    if sign < 0:
        spectrum = fft.fft(wrapped, axis=axis, overwrite_x=True)
    else:
        spectrum = fft.ifft(wrapped, axis=axis, norm="forward", overwrite_x=True)
    if n_out > period:
        return np.take(spectrum, (np.arange(n_out) - n_out // 2) % period, axis=axis)
    before, after = np.split(spectrum, [n_out - n_out // 2], axis=axis)
    return np.concatenate([after[_along(axis, period - n_out, None)], before], axis=axis)


def _wrap(u: np.ndarray, period: int, axis: int) -> np.ndarray:
    """Centred samples in FFT order, zero-padded to one period; more than a period folds onto itself."""
    n = u.shape[axis]
    start = -(n // 2) % period
    periods = -(-(start + n) // period)
    shape = list(u.shape)
    if n <= period:
        shape[axis] = period
        wrapped = np.zeros(shape, dtype=u.dtype)
        wrapped[_along(axis, 0, n - n // 2)] = u[_along(axis, n // 2, None)]
        wrapped[_along(axis, period - n // 2, None)] = u[_along(axis, 0, n // 2)]
        return wrapped
    shape[axis] = periods * period
    padded = np.zeros(shape, dtype=u.dtype)
    padded[_along(axis, start, start + n)] = u
    return padded.reshape(*shape[:axis], periods, period, *shape[axis + 1 :]).sum(axis=axis)


def _along(axis: int, start: int, stop: int | None) -> tuple[slice, ...]:
    """Index that cuts one axis of a two-dimensional array."""
    cut = slice(start, stop)
    return (cut, slice(None)) if axis == 0 else (slice(None), cut)
