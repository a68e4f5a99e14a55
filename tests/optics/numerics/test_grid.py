"""Samples lie in the right places: sample n//2 at the origin, rows are y."""

import numpy as np
import pytest

from optics import Grid
from optics.numerics.precision import precision


@pytest.mark.parametrize("shape", [(4, 7), (5, 2), (1, 1)])
def test_coordinates(shape):
    grid = Grid(shape, 0.5)
    x, y = (c.numpy().reshape(shape) for c in grid.coordinates(precision("float32")))
    expected_y, expected_x = np.meshgrid(*[(np.arange(n) - n // 2) * 0.5 for n in shape], indexing="ij")
    np.testing.assert_array_equal(x, expected_x)
    np.testing.assert_array_equal(y, expected_y)
    np.testing.assert_array_equal(grid.x, expected_x[0])
    np.testing.assert_array_equal(grid.y, expected_y[:, 0])
    assert grid.half_diagonal == np.hypot(expected_x, expected_y).max()


def test_rows_of_a_large_grid_are_counted_exactly():
    grid = Grid((4093, 4099), 1.0)
    x, y = grid.coordinates(precision("float64"))
    assert x.numpy().reshape(grid.shape)[:, 0].tolist() == [-2049.0] * 4093
    assert (y.numpy().reshape(grid.shape)[:, -1] == np.arange(4093) - 2046).all()


@pytest.mark.parametrize(("shape", "dx"), [((0, 3), 1.0), ((3,), 1.0), ((3, 3), 0.0), ((3, 3), -1.0), (None, 1.0)])
def test_bad_grids(shape, dx):
    with pytest.raises(ValueError, match=r"shape|dx"):
        Grid(shape, dx)
