"""Fields that are even in x and y, stored on a quarter of the plane, and their Fourier sums.

In sums over an even field, only the cosine of the factor exp(2πi jk/period) contributes. A sum by matrices therefore
takes a sixteenth of the real multiplications: halved numbers of rows and columns reduce them to an eighth, and real
cosines halve them again. A phase factor e^{iφ} is computed only on the quarter, so it takes a quarter of the sines and
cosines.

Sample n//2 of the n samples along an axis is the centre. If n is even, there is one more sample before the centre than
after it. The quarter extends from the centre to the last sample of the longer side. This sample has no mirror image on
the shorter side, so its weight is halved.
"""

from __future__ import annotations

from optics.numerics.autodiff import Array, Scalar
from optics.numerics.cost import DFT_CALL, MATMUL_FLOPS
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.matrices import matmul
from optics.numerics.precision import Precision, opaque

__all__ = ["even_seconds", "even_sum", "quarter", "whole"]

Shape = tuple[int, int]


def quarter(grid: Grid) -> Grid:
    """Return the grid of one quarter of a centred grid, with n//2 + 1 of the n samples along each axis.

    The quarter starts at the centre sample n//2. If n is even, one side of the centre has one more sample than the
    other, and the quarter covers this longer side. Its coordinates are distances from the centre.
    """
    height, width = (n // 2 + 1 for n in grid.shape)
    return Grid((height, width), grid.dx, (width // 2 * grid.dx, height // 2 * grid.dx))


def even_seconds(shape_in: Shape, shape_out: Shape) -> float:
    """Return the approximate time [s] of `even_sum`."""
    (ny, nx), (my, mx) = shape_in, shape_out
    return (ny * nx * mx + ny * mx * my) / 2 / MATMUL_FLOPS["float32"] + 2 * DFT_CALL


def even_sum(field: Field, shape: Shape, period: Scalar, grid: Grid, first: int = 0) -> Field:
    """Return the Fourier sum of an even field u, Σ_j u[j] exp(± 2πi j·k / period), on one quarter of `grid`.

    j and k are counted from the centre sample, as in `fourier.dft2`. Along each axis, the field and the result contain
    only the samples from the centre to one end, see `quarter`. If the number of samples is even, one side of the centre
    has one more sample than the other. The field and the result then contain the samples of this longer side.

    field: u on the quarter of a plane of `shape` samples, or on some rows of this quarter, which start at row `first`.
    """
    types, (ny, nx), (my, mx) = field.types, shape, grid.shape
    quarters = field.evaluated().grid.shape
    across = down = _cosines(types, mx, nx, period)
    if (ny, my) != (nx, mx) or quarters[0] != ny // 2 + 1:
        down = _cosines(types, my, ny, period, first, quarters[0])
    re, im = (
        matmul(down, matmul(types.Tensor(part, quarters), across, transposed=True)).array
        for part in (field.re, field.im)
    )
    return Field(re, im, quarter(grid), types)


def _cosines(
    types: Precision, n_out: int, n_in: int, period: Scalar, first: int = 0, count: int | None = None
) -> Array:
    """Return the matrix (k, j) of the cosines by which samples j contribute to frequencies k.

    j and k are counted from the centre. An entry is the contribution of sample j plus that of its mirror image.

    first, count: first sample j and number of samples. None: all samples from `first` on.
    """
    import drjit as dr

    entries = Grid((n_out // 2 + 1, n_in // 2 + 1 if count is None else count), 1.0)
    x, y = entries.coordinates(types)
    j, k = x + opaque(types, entries.shape[1] // 2 + first), y + opaque(types, entries.shape[0] // 2)
    alone = (j == 0) | (j > opaque(types, (n_in - 1) // 2))
    wave = Field.from_waves(
        dr.select(alone, types.Float(1), types.Float(2)), j * k / opaque(types, period), entries, types
    )
    return types.Tensor(wave.re, entries.shape)


def whole(field: Field, grid: Grid) -> Field:
    """Return a field on a whole centred grid, given the field on its quarter."""
    import drjit as dr

    types, width = field.types, field.grid.shape[1]
    x, y = Grid(grid.shape, 1.0).coordinates(types)
    place = types.Index(abs(y) * opaque(types, width) + abs(x))
    return Field(dr.gather(types.Float, field.re, place), dr.gather(types.Float, field.im, place), grid, types)
