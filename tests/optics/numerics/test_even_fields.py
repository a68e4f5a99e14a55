"""Fourier sums of fields with symmetry on all four sides, against sums over the whole plane."""

import drjit as dr
import numpy as np
import pytest

from optics.numerics.even_fields import even_sum, quarter, whole
from optics.numerics.field import Field
from optics.numerics.fourier import dft2
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

SHAPES = [((9, 9), (7, 7)), ((8, 11), (6, 13)), ((5, 4), (12, 3)), ((1, 6), (4, 1))]
TYPES = precision("float64")


def even_field(shape, seed=0):
    """Return a symmetric field as one quarter and as the whole plane. Samples without a mirror image are 0."""
    rng, small = np.random.default_rng(seed), [n // 2 + 1 for n in shape]
    u = rng.normal(size=small) + 1j * rng.normal(size=small)
    u[(shape[0] + 1) // 2 :] = u[:, (shape[1] + 1) // 2 :] = 0
    row, column = (np.abs(np.arange(n) - n // 2) for n in shape)
    part = Field.from_numpy(u, 1.0, TYPES)
    return part, Field.from_numpy(u[row[:, None], column[None, :]], 1.0, TYPES)


@pytest.mark.parametrize("period", [16, 11.7])
@pytest.mark.parametrize(("shape", "out"), SHAPES)
def test_sum_is_that_of_the_whole_plane(shape, out, period):
    part, full = even_field(shape)
    grid = Grid(out, 0.3)
    found = whole(even_sum(part, shape, period, grid), grid).numpy()
    for sign in (-1, 1):
        np.testing.assert_allclose(found, dft2(full, period, out, sign, 0.3).numpy(), atol=1e-12)


@pytest.mark.parametrize("shape", [(9, 9), (8, 11), (1, 6)])
def test_quarters_go_from_the_centre_on(shape):
    grid = Grid(shape, 0.25)
    part = quarter(grid)
    assert part.x[0] == part.y[0] == 0
    np.testing.assert_allclose(part.x[-1], np.abs(grid.x).max(), rtol=1e-15)
    np.testing.assert_allclose(part.y[-1], np.abs(grid.y).max(), rtol=1e-15)


def test_a_lone_sample_counts_half_on_either_side():
    u = np.zeros((1, 5), complex)
    u[0, 4] = 1  # sample -4 of 8
    part = Field.from_numpy(u, 1.0, TYPES)
    found = even_sum(part, (1, 8), 16, Grid((1, 9), 1.0)).numpy()[0]
    np.testing.assert_allclose(found, np.cos(2 * np.pi * 4 * np.arange(5) / 16), atol=1e-12)


def test_derivatives_flow_through_field_and_period():
    part, full = even_field((8, 11))
    period = TYPES.Float64(11.7)
    slopes = []
    for field, add in ((part, True), (full, False)):
        at = type(period)(period)
        dr.enable_grad(at)
        scaled = field.scaled(at)
        grid = Grid((6, 13), 0.3)
        found = whole(even_sum(scaled, (8, 11), at, grid), grid) if add else dft2(scaled, at, (6, 13), 1, 0.3)
        dr.backward(dr.sum(found.intensity * TYPES.Float64(np.arange(78.0))))
        slopes.append(at.grad[0])
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-12)
