"""Integrals over cells, compared with closed forms of the sampled function."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from optics.eye.cell_integrals import Tiles, cell_integrals, samples_per_cycle
from optics.numerics.grid import Grid


def circle():
    """Return spatial frequencies up to 1, the cut-off of a circular pupil in focus, and its MTF there times quadrature
    weights.
    """
    u, weight = np.polynomial.legendre.leggauss(400)
    angle = np.pi * (u + 1) / 4
    f = np.sin(angle)  # smooth at the end of the MTF
    mtf = 2 / np.pi * (np.arccos(f) - f * np.sqrt(1 - f * f))
    return f, mtf * weight * np.pi / 4 * np.cos(angle)


def line_spread(x):
    """Return the PSF of a circular pupil in focus, integrated along y. Its highest frequency is 1."""
    f, share = circle()
    return 2 * np.cos(2 * np.pi * np.outer(x, f)) @ share


def over_cells(middles, size, from_cell):
    """Return integrals of the line spread function over cells, for light from points or from the whole area of a scene
    cell.
    """
    f, share = circle()
    return 2 * size * np.cos(2 * np.pi * np.outer(middles, f)) @ (share * np.sinc(f * size) ** (1 + from_cell))


def integral_error(samples, size, from_cell):
    """Return the relative error of integrals over cells of this size, with `samples` per cycle of the highest
    frequency.
    """
    pitch = 1 / samples
    count = 2 * int(14 / pitch) + 1
    tiles = Tiles(2 * int(5 / size) + 1, size, from_cell)
    found = cell_integrals(count, pitch, tiles) @ line_spread(Grid((1, count), pitch).x)
    exact = over_cells((np.arange(tiles.count) - tiles.count // 2) * size, size, from_cell)
    return np.linalg.norm(found - exact) / np.linalg.norm(exact)


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("from_cell", [False, True])
@pytest.mark.parametrize("cycles", [0.1, 0.5, 0.95, 1.0, 1.5, 1.95, 2.0, 3.0])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-5])
def test_error_is_within_a_third_of_the_tolerance(tolerance, cycles, from_cell):
    """The number of samples is the smallest that the rule allows. cycles: number of cycles of the highest frequency in
    a cell
    """
    assert integral_error(samples_per_cycle(tolerance, cycles), cycles, from_cell) < tolerance / 3


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("cycles", "fewer"), [(0.5, 0.5), (0.1, 0.25)])
def test_samples_that_larger_cells_need_are_too_few_for_smaller_ones(cycles, fewer):
    """The error exceeds a third of the tolerance of 0.01 with a number of samples that is enough for larger cells."""
    assert integral_error(samples_per_cycle(1e-2, cycles) - fewer, cycles, False) > 1e-2 / 3


@pytest.mark.parametrize("from_cell", [False, True])
@pytest.mark.parametrize(
    ("samples", "cells"),
    [(3, 1), (4, 2), (5, 3), (6, 3), (8, 1), (9, 3), (11, 4), (56, 3), (57, 3), (58, 2), (64, 15), (201, 15)],
)
def test_it_is_the_spline_s_own_integral(samples, cells, from_cell):
    """The reference is SciPy's integral of splines of which a single sample is 1 and the others are 0. For light from a
    whole cell, the spline is integrated twice.
    """
    pitch = 0.3
    size = samples * pitch / cells * 0.8
    x, degree = Grid((1, samples), pitch).x, min(7, (samples - 2) // 2 * 2 + 1)
    primitive = make_interp_spline(x, np.eye(samples), k=degree).antiderivative()
    edges = (np.arange(cells + 1 + from_cell) - (cells + from_cell) / 2) * size
    inside = np.clip(edges, x[0], x[-1])
    exact = np.diff(primitive(inside), axis=0)
    if from_cell:
        second = primitive.antiderivative()(inside) + primitive(inside) * (edges - inside)[:, None]
        exact = np.diff(second, 2, axis=0) / size
    found = cell_integrals(samples, pitch, Tiles(cells, size, from_cell))
    assert np.abs(found - exact).max() < 1e-11 * np.abs(exact).max()


def test_fewer_samples_for_looser_tolerances():
    wanted = [samples_per_cycle(tolerance) for tolerance in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)]
    assert wanted == sorted(wanted, reverse=True)
    assert wanted[-1] > 2  # Nyquist
    assert samples_per_cycle(1e-4) == 3.1
    assert samples_per_cycle(1e-4 / 2**8) == pytest.approx(6.2)  # the error falls with the eighth power
    assert samples_per_cycle(1e-4 * 10**0.5) == pytest.approx(3.1 - 0.425 / 2)


def test_fewer_samples_for_larger_cells_where_tolerances_are_loose():
    by_cells = [
        [samples_per_cycle(tolerance, cycles) for cycles in (0.9, 1.0, 2.0)] for tolerance in (1e-2, 1e-3, 1e-4)
    ]
    assert by_cells[0] == [2.25, 2.0, 1.75]
    assert by_cells[1] == pytest.approx([2.675, 2.425, 2.425])
    assert by_cells[2] == pytest.approx([3.1, 3.1, 3.1])
