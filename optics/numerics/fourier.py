"""Centred two-dimensional Fourier sums of any size and period.

`dft2` computes the following sum for fields of Dr.Jit, and `fourier_sum` computes it for NumPy arrays:

    U[k] = Σ_j u[j] exp(± 2πi j·k / period),   j and k counted from the centre sample n//2.

Products with matrices compute the sum for any period. If the period is a whole number, the FFT can be used instead.
`dft2` selects the faster of the two by their predicted times (optics.numerics.cost). Dr.Jit's matrix product executes
more operations per second, but SciPy's FFT needs fewer, so matrices are faster for small windows, and the FFT for large
ones. In `dft2`, both are differentiable.
"""

from __future__ import annotations

from bisect import bisect_left
from functools import lru_cache
from math import ceil, log2
from typing import Any

import numpy as np

from optics.numerics.array_sum_cost import fft_wins
from optics.numerics.autodiff import Array, Scalar, is_differentiable
from optics.numerics.cost import DFT_CALL, FFT_COPY, FFT_FLOPS, FFT_LINE_SAMPLE
from optics.numerics.field import Field
from optics.numerics.fourier_matrices import matrix_seconds, matrix_sum
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, aligned, opaque

__all__ = [
    "dft2",
    "fast_length",
    "fourier_sum",
    "kept_indices",
    "periodic_spectrum",
    "periodic_sum",
    "predicted_bytes",
    "predicted_seconds",
]

LONGEST_FFT = 2**31
SUM_ARRAYS = 4  # real arrays that each complex array of a sum needs: two parts, each with a temporary array
AT_A_TIME, FEWEST_LINES = 2**17, 16  # choice: samples transformed at once (a megabyte), and fewest lines


def fast_length(least: float) -> int:
    """Return a length of at least `least` for which the FFT is fast: the smallest integer of the form 2^a 3^b 5^c.

    If `least` is above LONGEST_FFT, the result is `least`, rounded up, because no FFT is used for such lengths.
    """
    if least > LONGEST_FFT:
        return ceil(least)  # no FFT is used for such lengths
    lengths = _smooth_numbers()
    return lengths[bisect_left(lengths, max(1, ceil(least)))]


@lru_cache(maxsize=1)
def _smooth_numbers() -> list[int]:
    """Return all numbers 2^a 3^b 5^c up to LONGEST_FFT in ascending order."""
    threes_and_fives = [3**b * 5**c for b in range(20) for c in range(14)]
    return sorted(n << a for n in threes_and_fives for a in range(32) if n << a <= LONGEST_FFT)


def dft2(
    field: Field,
    period: Scalar,
    shape: tuple[int, int],
    sign: int,
    pitch: float,
    centre: tuple[float, float] = (0.0, 0.0),
) -> Field:
    """Return the Fourier sum U[k] = Σ_j u[j] exp(± 2πi j·k / period) of a field u, at `shape` output samples k.

    j and k are counted from the centre samples n//2. The result is a Field on a grid of the given output pitch.

    sign: sign of the exponent: -1 for the forward, +1 for the inverse transform, both without normalisation.
    centre: (x, y) of the output's centre sample, in the unit of `pitch`.
    """
    grid = Grid(shape, pitch, centre)
    if centre != (0.0, 0.0):
        field = _recentred(field, period, (sign * centre[0] / pitch, sign * centre[1] / pitch))
    if not is_differentiable(period) and _fft_wins(field.grid.shape, period, shape):
        re, im = _fft(field, int(period), shape, sign)
    else:
        re, im = matrix_sum(field, period, shape, sign)
    return Field(re, im, grid, field.types)


def fourier_sum(u: np.ndarray, period: float, shape: tuple[int, int], sign: int) -> np.ndarray:
    """Return the Fourier sum that `dft2` computes, for a complex NumPy array, without Dr.Jit and derivatives."""
    shape_in = (u.shape[0], u.shape[1])
    if fft_wins(shape_in, period, shape, u.real.dtype.name):
        for axis in (1, 0):
            u = _fft_axis(u, int(period), shape[axis], sign, axis)
        return u
    down, across = (dft_matrix(m, n, period, sign, u.dtype.str) for m, n in zip(shape, u.shape, strict=True))
    return down @ u @ across.T


@lru_cache(maxsize=16)
def dft_matrix(n_out: int, n_in: int, period: float, sign: int, dtype: str) -> np.ndarray:
    """Return the matrix of a sum along one axis: exp(±2πi k j / period), k = row - n_out//2, j = column - n_in//2.

    Only the fractional part of k j / period matters. The whole part is subtracted before the exponential is computed.
    """
    k, j = np.arange(n_out) - n_out // 2, np.arange(n_in) - n_in // 2
    waves = np.outer(k, j) / period
    return np.exp(2j * np.pi * sign * (waves - np.round(waves))).astype(dtype)


def _recentred(field: Field, period: Scalar, by: tuple[float, float]) -> Field:
    """Return u[j] exp(±2πi j·c / period) for a field u. The `dft2` of this product at k is the `dft2` of u at k + c.

    by: ±c, (x, y), in samples of the output. Fractions are allowed.
    """
    types = field.types
    j_x, j_y = Grid(field.grid.shape, 1.0).coordinates(types)
    waves = (j_x * opaque(types, by[0]) + j_y * opaque(types, by[1])) / opaque(types, period)
    return field * Field.from_waves(1.0, waves, field.grid, types)


def periodic_spectrum(u: np.ndarray, period: int, across: int) -> np.ndarray:
    """Return Σ_j u[j] exp(-2πi j·k / period) for a complex NumPy array u (y, x) that is at most one period wide.

    The result (fx, fy) contains all frequencies fy, but only the `across` frequencies fx nearest 0, both in FFT order.
    The last axis is fy, because the last FFT, along y, is twice as fast if its lines are contiguous in memory.
    """
    from scipy import fft

    rows = fft.fft(_wrap(u, period, 1), axis=1, overwrite_x=True)
    if across < period:
        rows = rows[:, kept_indices(across)]
    return fft.fft(_wrap(np.ascontiguousarray(rows.T), period, 1), axis=1, overwrite_x=True)


def periodic_sum(spectrum: np.ndarray, period: int, step: int, shape: tuple[int, int]) -> np.ndarray:
    """Return Σ_k U[k] exp(2πi j·k / period) at every `step`-th j, with j = 0 at sample n//2 of the result, (y, x).

    spectrum: U as returned by `periodic_spectrum`.
    """
    from scipy import fft

    rows, columns = ((np.arange(n) - n // 2) * step % period for n in shape)
    lines = fft.ifft(spectrum, axis=1, norm="forward", overwrite_x=True)[:, rows].T
    if spectrum.shape[0] < period:
        whole = np.zeros((len(rows), period), spectrum.dtype)
        whole[:, kept_indices(spectrum.shape[0])] = lines
        lines = whole
    else:
        lines = np.ascontiguousarray(lines)
    return fft.ifft(lines, axis=1, norm="forward", overwrite_x=True)[:, columns]


def kept_indices(across: int) -> np.ndarray:
    """Return the `across` indices nearest 0. They are in FFT order: 0, 1, …, -2, -1 (-1: last sample of a period)."""
    kept = np.arange(across) - across // 2
    return np.roll(kept, -(across // 2))


def predicted_seconds(shape_in: tuple[int, int], period: float, shape_out: tuple[int, int]) -> float:
    """Return the approximate time [s] of one `dft2`."""
    if _fft_wins(shape_in, period, shape_out):
        return _fft_seconds(shape_in, int(period), shape_out)
    return matrix_seconds(shape_in, shape_out)


def predicted_bytes(shape_in: tuple[int, int], shape_out: tuple[int, int], item: float) -> float:
    """Return the approximate memory of one `dft2`, including its input and output, for real numbers of `item` bytes."""
    (ny, nx), (my, mx) = shape_in, shape_out
    return SUM_ARRAYS * item * (ny * nx + ny * mx + my * mx + mx * nx + my * ny)


def _fft_wins(shape_in: tuple[int, int], period: float, shape_out: tuple[int, int]) -> bool:
    if not float(period).is_integer():
        return False
    return _fft_seconds(shape_in, int(period), shape_out) < matrix_seconds(shape_in, shape_out)


def _fft_seconds(shape_in: tuple[int, int], period: int, shape_out: tuple[int, int]) -> float:
    lines, copied = shape_in[0] + shape_out[1], shape_in[0] * shape_in[1] + shape_out[0] * shape_out[1]
    return lines * period * (5 * log2(period + 1) / FFT_FLOPS + FFT_LINE_SAMPLE) + copied * FFT_COPY + DFT_CALL


def _fft(field: Field, period: int, shape: tuple[int, int], sign: int) -> tuple[Array, Array]:
    import drjit as dr

    types, shape_in = field.types, field.grid.shape

    def transform(re: Array, im: Array, to: tuple[int, int], from_: tuple[int, int], turn: int) -> tuple[Array, Array]:
        dr.eval(re, im)  # one kernel for both, since separate kernels would compute their common terms twice
        parts = re.numpy().reshape(from_), im.numpy().reshape(from_)
        return _fft_of_parts(parts, period, to, turn, types)

    class FourierSum(dr.CustomOp):
        """The Fourier sum, differentiable. Its adjoint sums over the output, with the opposite sign of the exponent."""

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


def _fft_of_parts(
    parts: tuple[np.ndarray, np.ndarray], period: int, to: tuple[int, int], sign: int, types: Precision
) -> tuple[Array, Array]:
    """Return the real and imaginary part, flat, of the sum of `dft2`, by FFTs. parts: real and imaginary part of u.

    The FFTs are computed for blocks of lines, because a whole plane, padded to one period, exceeds the cache.
    """
    from scipy import fft

    turned, norm = (fft.fft, None) if sign < 0 else (fft.ifft, "forward")
    (ny, nx), (my, mx) = parts[0].shape, to
    rows = np.empty((ny, mx), types.complex_dtype)
    found = [aligned(my * mx, types.dtype) for _ in parts]
    re, im = (part.reshape(to) for part in found)
    for some in _lines(ny, period):
        lines = np.zeros((rows[some].shape[0], period), types.complex_dtype)
        for here, there in _runs(nx, period):
            lines.real[:, there] += parts[0][some, here]
            lines.imag[:, there] += parts[1][some, here]
        lines = turned(lines, axis=1, norm=norm, overwrite_x=True)
        for here, there in _runs(mx, period):
            rows[some, here] = lines[:, there]
    for some in _lines(mx, period):
        lines = np.zeros((period, rows[:, some].shape[1]), types.complex_dtype)
        for here, there in _runs(ny, period):
            lines[there] += rows[here, some]
        lines = turned(lines, axis=0, norm=norm, overwrite_x=True)
        for here, there in _runs(my, period):
            re[here, some], im[here, some] = lines[there].real, lines[there].imag
    return types.Float(found[0]), types.Float(found[1])


def _lines(n: int, period: int) -> list[slice]:
    """Return slices that divide n lines of `period` samples into blocks of lines that are transformed together."""
    step = max(FEWEST_LINES, AT_A_TIME // period)
    return [slice(start, min(start + step, n)) for start in range(0, n, step)]


def _runs(n: int, period: int) -> list[tuple[slice, slice]]:
    """Return pairs of slices that divide n centred samples into runs which are contiguous in FFT order.

    The first slice selects a run, the second its place within one period. Samples beyond a period are aliased onto it.
    """
    found, start = [], 0
    while start < n:
        place = (start - n // 2) % period
        length = min(n - start, period - place)
        found.append((slice(start, start + length), slice(place, place + length)))
        start += length
    return found


def _fft_axis(u: np.ndarray, period: int, n_out: int, sign: int, axis: int) -> np.ndarray:
    """Return the Fourier sum along one axis at n_out centred samples, by an FFT of u, wrapped into one period."""
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
    """Return centred samples in FFT order, zero-padded to one period. Samples beyond one period are aliased onto it."""
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
    """Return an index that slices one axis of a two-dimensional array."""
    cut = slice(start, stop)
    return (cut, slice(None)) if axis == 0 else (slice(None), cut)
