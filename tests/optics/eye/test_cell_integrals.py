"""Integrals over cells, held against closed forms of what the samples are of."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from optics.eye.cell_integrals import Tiles, cell_integrals, samples_per_cycle
from optics.numerics.grid import Grid


def spot(x, cutoff):
    """A slit's in focus, sinc²: its spectrum falls to nothing at the cutoff more slowly than a circle's."""
    return np.sinc(cutoff * x / 2) ** 2


@pytest.mark.parametrize("cells", [1.0, 3.0, 12.0])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-6])
def test_error_is_within_a_third_of_the_tolerance(tolerance, cells):
    """cells: of the spot's frequency limit per cell; samples as few as are taken for a tolerance."""
    cutoff, size = 1.0, cells / 3
    pitch = 1 / (samples_per_cycle(tolerance) * cutoff)
    count = 2 * int(12 / pitch) + 1
    tiles = Tiles(2 * int(10 / size) + 1, size, False)
    found = cell_integrals(count, pitch, tiles) @ spot(Grid((1, count), pitch).x, cutoff)
    fine = 1e-3
    x = np.arange(-15, 15, fine) + fine / 2
    whole = np.concatenate([[0], np.cumsum(spot(x, cutoff)) * fine])
    edges = (np.arange(tiles.count + 1) - tiles.count / 2) * size
    exact = np.diff(np.interp(edges, np.append(x - fine / 2, 15), whole))
    assert np.linalg.norm(found - exact) < max(tolerance / 3, 2e-7) * np.linalg.norm(exact)


def test_half_as_many_samples_are_too_few():
    """The rule is no luxury: at Nyquist's rate integrals over small cells are wrong by more than a third of a
    hundredth."""
    pitch = 2 / samples_per_cycle(1e-2)
    grid, tiles = Grid((1, 41), pitch), Tiles(41, 0.25, False)
    found = cell_integrals(41, pitch, tiles) @ spot(grid.x, 1.0)
    exact = 0.25 * spot((np.arange(41) - 20) * 0.25, 1.0)
    assert np.linalg.norm(found - exact) > 1e-2 / 3 * np.linalg.norm(exact)


@pytest.mark.parametrize("from_cell", [False, True])
@pytest.mark.parametrize(("samples", "cells"), [(3, 1), (5, 3), (9, 3), (64, 15)])
def test_it_is_the_spline_s_own_integral(samples, cells, from_cell):
    """The spline itself, integrated by SciPy, for every sample that is 1 alone; from a cell: twice."""
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
