"""Predicted times of the Fourier sums that `optics.propagate` computes, over complex NumPy arrays.

These times do not hold for fields of Dr.Jit. Their sums are computed with products of real matrices, and these products
take about twice as long (optics.numerics.fourier_matrices).
"""

from __future__ import annotations

from math import log2

from optics.numerics.cost import ARRAY_FFT_FLOPS, ARRAY_LINE_SAMPLE, ARRAY_MATMUL_FLOPS, ARRAY_MATRIX_ENTRY

__all__ = ["fft_seconds", "fft_wins", "lines_seconds", "products_seconds", "sum_seconds"]

Shape = tuple[int, int]


def lines_seconds(lines: int, period: int, real: str) -> float:
    """Return the time [s] of the fast Fourier transforms of some lines of an array, each padded to `period` samples.

    The time includes the padding and the copy of the needed results. The samples of a line are contiguous in memory.

    real: type of real and imaginary parts, "float32" or "float64".
    """
    return lines * period * (5 * log2(period + 1) / ARRAY_FFT_FLOPS[real] + ARRAY_LINE_SAMPLE[real])


def products_seconds(shape_in: Shape, shape_out: Shape, real: str, terms: int = 1) -> float:
    """Return the time [s] to multiply an array by one matrix along y and one along x, for `terms` such pairs."""
    (ny, nx), (my, mx) = shape_in, shape_out
    return 8 * terms * (my * ny * nx + my * nx * mx) / ARRAY_MATMUL_FLOPS[real]


def fft_seconds(shape_in: Shape, period: int, shape_out: Shape, real: str) -> float:
    return lines_seconds(shape_in[0] + shape_out[1], period, real)


def fft_wins(shape_in: Shape, period: float, shape_out: Shape, real: str) -> bool:
    """Return whether fast Fourier transforms compute a two-dimensional Fourier sum faster than products with matrices.

    The time for computing these matrices is not counted.

    shape_in, shape_out: numbers of rows and columns of samples, and of results.
    period: period of the sum in samples. Fast Fourier transforms require a period that is a whole number.
    real: type of real and imaginary parts, "float32" or "float64".
    """
    if not float(period).is_integer():
        return False
    return fft_seconds(shape_in, int(period), shape_out, real) < products_seconds(shape_in, shape_out, real)


def sum_seconds(shape_in: Shape, period: float, shape_out: Shape, real: str) -> float:
    """Return the time [s] of `fourier.fourier_sum`, including the computation of its matrices."""
    if fft_wins(shape_in, period, shape_out, real):
        return fft_seconds(shape_in, int(period), shape_out, real)
    entries = shape_in[0] * shape_out[0] + shape_in[1] * shape_out[1]
    return products_seconds(shape_in, shape_out, real) + entries * ARRAY_MATRIX_ENTRY
