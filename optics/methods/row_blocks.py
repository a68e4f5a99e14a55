"""Blocks of rows of a pupil that is too large to be evaluated at once.

A Fourier sum is computed over the samples of each block. The sums of all blocks add up to the spectrum of the pupil.
Memory then depends on the size of a block and of the spectrum, and not on the number of samples of the pupil.
"""

from __future__ import annotations

from collections.abc import Iterator

from optics.numerics.autodiff import Scalar
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque

__all__ = ["block_size", "row_blocks", "with_rows_moved"]

AT_ONCE = 2**24  # choice, limited by memory: largest number of samples of a block


def block_size(grid: Grid) -> tuple[int, int]:
    """Return the number of blocks of rows into which a grid is divided, and the rows of each block except the last."""
    height, width = grid.shape
    rows = -(-height // -(-height * width // AT_ONCE))
    return -(-height // rows), rows


def row_blocks(grid: Grid) -> Iterator[tuple[int, Grid]]:
    """Yield, for each block of rows of a grid, the index of its first row and the grid of its samples.

    A small grid is a single block.
    """
    height, width = grid.shape
    count, rows = block_size(grid)
    if count == 1:
        yield 0, grid
        return
    for first in range(0, height, rows):
        here = min(rows, height - first)
        y = grid.centre[1] + (first + here // 2 - height // 2) * grid.dx
        yield first, Grid((here, width), grid.dx, (grid.centre[0], y))


def with_rows_moved(spectrum: Field, rows: int, period: Scalar, sign: int) -> Field:
    """Return the Fourier sum of samples after they are moved by `rows` rows along y.

    spectrum: Fourier sum of the samples before they are moved.
    period, sign: arguments of `fourier.dft2`, with which `spectrum` was computed.
    """
    if rows == 0:
        return spectrum
    types = spectrum.types
    _, k = Grid(spectrum.grid.shape, 1.0).coordinates(types)
    waves = k * opaque(types, sign * rows) / opaque(types, period)
    return spectrum * Field.from_waves(1.0, waves, spectrum.grid, types)
