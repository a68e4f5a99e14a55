"""Fourier sums Σ_j u[j] exp(±2πi j·k / period) as matrix products in Dr.Jit.

The period of a sum may have any value and may carry a derivative. Samples j of the field u and frequencies k are
counted from the centre. cos(2πjk/period) is even in j and in k, and sin(2πjk/period) is odd in both. Large sums
therefore use u[j] ± u[-j] for j >= 0, and a real matrix of cosines and one of sines for j, k >= 0. Each has a quarter
of the entries of the whole complex matrix. The results for k and for -k follow from the same products, so that only a
quarter of the products is needed.
"""

from __future__ import annotations

from optics.numerics.autodiff import Array, Scalar
from optics.numerics.cost import DFT_CALL, FOLDED_SAMPLE, MATMUL_FLOPS
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.matrices import complex_flops, complex_matmul, matmul
from optics.numerics.precision import Precision, opaque

__all__ = ["by_halves", "by_whole_matrices", "halves_pay", "matrix_seconds", "matrix_sum"]

Parts = tuple[Array, Array]
Shape = tuple[int, int]


def matrix_sum(field: Field, period: Scalar, shape: Shape, sign: int) -> Parts:
    """Return the sum of `fourier.dft2` as its real and imaginary parts, flat."""
    way = by_halves if halves_pay(field.grid.shape, shape) else by_whole_matrices
    return way(field, period, shape, sign)


def matrix_seconds(shape_in: Shape, shape_out: Shape) -> float:
    """Return the approximate time [s] of `matrix_sum`."""
    halves, whole = _halves_seconds(shape_in, shape_out), _whole_seconds(shape_in, shape_out)
    return DFT_CALL + min(halves, whole)


def halves_pay(shape_in: Shape, shape_out: Shape) -> bool:
    return _halves_seconds(shape_in, shape_out) < _whole_seconds(shape_in, shape_out)


def _products(shape_in: Shape, shape_out: Shape) -> tuple[int, int]:
    """Return the numbers of multiplications in the two steps of a Fourier sum: along x, and then along y."""
    (ny, nx), (my, mx) = shape_in, shape_out
    return ny * nx * mx, ny * mx * my


def _whole_seconds(shape_in: Shape, shape_out: Shape) -> float:
    return sum(map(complex_flops, _products(shape_in, shape_out))) / MATMUL_FLOPS["float32"]


def _halves_seconds(shape_in: Shape, shape_out: Shape) -> float:
    (ny, nx), (my, mx) = shape_in, shape_out
    folded = ny * nx + 2 * ny * mx + 2 * my * mx
    return 2 * sum(_products(shape_in, shape_out)) / MATMUL_FLOPS["float32"] + folded * FOLDED_SAMPLE + 2 * DFT_CALL


def by_whole_matrices(field: Field, period: Scalar, shape: Shape, sign: int) -> Parts:
    """Return the Fourier sum of the field u as A_y u A_xᵀ, with the Fourier matrices A_y and A_x of both axes."""
    types, (ny, nx), (my, mx) = field.types, field.grid.shape, shape
    u = types.Tensor(field.re, (ny, nx)), types.Tensor(field.im, (ny, nx))
    along_x = along_y = _matrix(types, mx, nx, period, sign)
    u = complex_matmul(u, along_x, transposed=True)
    if (my, ny) != (mx, nx):
        along_y = _matrix(types, my, ny, period, sign)
    re, im = complex_matmul(along_y, u)
    return re.array, im.array


def _matrix(types: Precision, n_out: int, n_in: int, period: Scalar, sign: int) -> Parts:
    """Return the matrix exp(±2πi k j / period), where k = row - n_out//2 and j = column - n_in//2.

    The result is two tensors: real and imaginary part.
    """
    entries = Grid((n_out, n_in), 1.0)
    j, k = entries.coordinates(types)
    matrix = Field.from_waves(1.0, j * k / opaque(types, sign * period), entries, types)
    return types.Tensor(matrix.re, entries.shape), types.Tensor(matrix.im, entries.shape)


def by_halves(field: Field, period: Scalar, shape: Shape, sign: int) -> Parts:
    """Return the same Fourier sum as `by_whole_matrices`, computed with smaller, real matrices.

    Each matrix has a quarter of the entries of the complex Fourier matrix. A matrix of cosines multiplies u[j] + u[-j],
    and a matrix of sines multiplies u[j] - u[-j]. Here u is the field, and samples j >= 0 are counted from the centre.
    The sum along x is computed first, then the sum along y.
    """
    types, (ny, nx), (my, mx) = field.types, field.grid.shape, shape
    cosine, sine = along_y = _quarter(types, mx, nx, period, sign)
    even, odd = _folded_columns(field)
    across = [matmul(part, cosine, transposed=True) for part in even] + [matmul(part, sine, True) for part in odd]
    if (my, ny) != (mx, nx):
        along_y = _quarter(types, my, ny, period, sign)
    even, odd = _folded_rows(across, (ny, mx), types)
    down = [matmul(along_y[0], part) for part in even] + [matmul(along_y[1], part) for part in odd]
    return _unfolded_rows(down, shape, types)


def _quarter(types: Precision, n_out: int, n_in: int, period: Scalar, sign: int) -> Parts:
    """Return cos(2πkj/period) and ± sin(2πkj/period) in row k and column j, both counted from 0."""
    entries = Grid((n_out // 2 + 1, n_in // 2 + 1), 1.0)
    j, k = _counted(entries.shape, types)
    wave = Field.from_waves(1.0, j * k / opaque(types, sign * period), entries, types)
    wave.evaluated()
    return types.Tensor(wave.re, entries.shape), types.Tensor(wave.im, entries.shape)


def _folded_columns(field: Field) -> tuple[list[Array], list[Array]]:
    """Return [re, im] of u[y, j] + u[y, -j], and of u[y, j] - u[y, -j], for columns j >= 0 counted from the middle.

    At j = 0, the term u[y, j] is replaced by 0 in both, so that the sum is u[y, 0], not twice this value. The
    difference at j = 0 does not matter, because sin 0 multiplies it.
    """
    types, (ny, nx) = field.types, field.evaluated().grid.shape
    shape = ny, nx // 2 + 1
    j, y = _counted(shape, types)
    middle = y * opaque(types, nx) + opaque(types, nx // 2)
    there = (j > 0) & (j < opaque(types, nx - nx // 2))
    ahead, behind = types.Index(middle + j), types.Index(middle - j)
    parts = [_read(part, ahead, behind, there) for part in (field.re, field.im)]
    return _sums_and_differences(parts, shape, types)


def _folded_rows(across: list[Array], size: Shape, types: Precision) -> tuple[list[Array], list[Array]]:
    """Return v[j, k] + v[-j, k] and v[j, k] - v[-j, k], where v is the Fourier sum of a field along x alone.

    The row j >= 0 is counted from the middle row of the field. k is the frequency along x, of either sign. Each result
    is a list of real and imaginary part, (j, k). At j = 0, the term v[j, k] is replaced by 0 in both, so that the sum
    is v[0, k], not twice this value.

    across: four tensors (row, |k|), from which `_both_sides` computes v for k of either sign. Let e be the part of the
        field that is even in x, and o the odd part. The first two tensors are the real and imaginary part of the sum of
        e · cosine along x, and the last two are the real and imaginary part of the sum of o · sine along x.
    size: number of rows of the field, and number of frequencies k.
    """
    ny, mx = size
    shape = ny // 2 + 1, mx
    column, j = _counted(shape, types)
    k = column - opaque(types, mx // 2)
    middle, width = opaque(types, ny // 2), opaque(types, mx // 2 + 1)
    there = (j > 0) & (j < opaque(types, ny - ny // 2))
    ahead = _both_sides(across, (middle + j) * width + abs(k), k, types, there)
    behind = _both_sides(across, (middle - j) * width + abs(k), k, types)
    return _sums_and_differences(list(zip(ahead, behind, strict=True)), shape, types)


def _sums_and_differences(pairs: list[Parts], shape: Shape, types: Precision) -> tuple[list[Array], list[Array]]:
    import drjit as dr

    sums, differences = [a + b for a, b in pairs], [a - b for a, b in pairs]
    dr.eval(sums, differences)
    return [types.Tensor(each, shape) for each in sums], [types.Tensor(each, shape) for each in differences]


def _unfolded_rows(down: list[Array], shape: Shape, types: Precision) -> Parts:
    column, row = _counted(shape, types)
    k = row - opaque(types, shape[0] // 2)
    return _both_sides(down, abs(k) * opaque(types, shape[1]) + column, k, types)


def _both_sides(halves: list[Array], place: Array, k: Array, types: Precision, there: Array = True) -> Parts:
    """Return the real and imaginary part of C + iS if k >= 0, and of C - iS if k < 0.

    C is the sum of the even part of a field times cos(2πj|k|/period) over its samples j. S is the sum of its odd part
    times ± sin(2πj|k|/period).

    halves: four arrays: real and imaginary part of C, followed by those of S.
    place: for each entry of the result, the flat index at which the four arrays are read.
    there: mask of the result. Where it is False, the result is 0.
    """
    import drjit as dr

    index, sign = types.Index(place), dr.select(k < 0, types.Float(-1), types.Float(1))
    even_re, even_im, odd_re, odd_im = (dr.gather(types.Float, part.array, index, there) for part in halves)
    return even_re - sign * odd_im, even_im + sign * odd_re


def _read(part: Array, ahead: Array, behind: Array, there: Array) -> Parts:
    """Return two arrays: part[ahead], with 0 where the mask `there` is False, and part[behind], without a mask."""
    import drjit as dr

    return dr.gather(type(part), part, ahead, there), dr.gather(type(part), part, behind)


def _counted(shape: Shape, types: Precision) -> Parts:
    """Return the column and the row of every entry of an array of this shape, counted from 0, in float64, flat."""
    x, y = Grid(shape, 1.0).coordinates(types)
    return x + opaque(types, shape[1] // 2), y + opaque(types, shape[0] // 2)
