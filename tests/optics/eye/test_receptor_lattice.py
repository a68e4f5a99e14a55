"""Rectangles of receptors, from edges that are given as numbers."""

import math

import numpy as np
import pytest

from optics.eye import receptor_lattice
from optics.eye.receptor_density import DensityMap
from optics.eye.receptor_lattice import NARROWEST, ReceptorLattice, even_lattice, overlaps

ROWS = np.array([-1.0, 0.5, 1.0])
COLUMNS = np.array([[-1.5, -0.5, 0.25, 1.5], [-1.5, 0.0, 1.1, 1.5]])
LATTICE = ReceptorLattice(ROWS, COLUMNS)


def test_sides_and_middles():
    heights, widths = LATTICE.sides
    np.testing.assert_allclose(heights, [[1.5] * 3, [0.5] * 3])
    np.testing.assert_allclose(widths, [[1, 0.75, 1.25], [1.5, 1.1, 0.4]])
    np.testing.assert_allclose(LATTICE.areas, [[1.5, 1.125, 1.875], [0.75, 0.55, 0.2]])
    assert LATTICE.smallest == (0.5, pytest.approx(0.4))
    np.testing.assert_allclose(LATTICE.middles[..., 0], [[-1, -0.125, 0.875], [-0.75, 0.55, 1.3]])
    np.testing.assert_allclose(LATTICE.middles[..., 1], [[-0.25] * 3, [0.75] * 3])


def test_directions_of_receptors():
    right, up = LATTICE.directions_deg((0.5, 2.0), (0.25, -1.0))
    np.testing.assert_allclose(np.tan(np.radians(right[0])), [-0.25, 0.1875, 0.6875])
    np.testing.assert_allclose(np.tan(np.radians(up)), [[1.5] * 3, [-0.5] * 3])


def test_angles_between_the_edges_of_receptors():
    """An edge at the tangents (x, y) has the direction (x, y, 1)."""
    size, middle = np.array([0.5, 2.0]), np.array([0.25, -1.0])
    vertical, horizontal = LATTICE.angles_deg(tuple(size), tuple(middle))

    def angle(one, other):
        a, b = (np.array([*(np.array(at) * size + middle), 1]) for at in (one, other))
        return math.degrees(math.acos(a @ b / math.sqrt((a @ a) * (b @ b))))

    for i, j in np.ndindex(2, 3):
        x, y = LATTICE.middles[i, j]
        assert horizontal[i, j] == pytest.approx(angle((COLUMNS[i, j], y), (COLUMNS[i, j + 1], y)))
        assert vertical[i, j] == pytest.approx(angle((x, ROWS[i]), (x, ROWS[i + 1])))


PLACES = [
    ((-1.5, -1.0), (-1.5, -1.0)),  # the top left corner
    ((-0.5, 0.0), (0.0, 0.5)),  # the top left corner of the receptor (1, 1)
    ((0.5, -0.5), (0.25, -0.25)),
    ((0.0, 0.5), (0.55, 0.75)),  # the middle of row 1 and of its column 1
    ((1.5, 1.0), (1.5, 1.0)),
    ((-2.0, -1.5), (-2.0, -1.75)),  # beyond the rim, by half a receptor
    ((2.0, 1.5), (1.7, 1.25)),
]


@pytest.mark.parametrize(("counted", "place"), PLACES)
def test_places_of_counting_coordinates(counted, place):
    np.testing.assert_allclose(LATTICE.places(np.array([counted])), [place])
    np.testing.assert_allclose(LATTICE.counted(np.array([place])), [counted], atol=1e-12)
    np.testing.assert_allclose(LATTICE.counted(np.array([[place]])), [[counted]], atol=1e-12)


@pytest.mark.parametrize("columns", [[-1.5, -1.4, -1.2, 1.5], [-1.5, 1.2, 1.4, 1.5]])
def test_places_near_the_rim(columns):
    lattice = ReceptorLattice(np.array([-1.0, -0.8, 1.0]), np.array([columns, COLUMNS[0]]))
    middles = np.array([[[-1.0, -0.5], [0.0, -0.5], [1.0, -0.5]], [[-1.0, 0.5], [0.0, 0.5], [1.0, 0.5]]])
    np.testing.assert_allclose(lattice.counted(lattice.middles), middles, atol=1e-12)
    np.testing.assert_allclose(lattice.places(middles.reshape(6, 2)), lattice.middles.reshape(6, 2), atol=1e-12)


def test_receptors_at_the_middles_of_cells():
    """Cells of 1/4 of an average receptor: rows 0 to 5 belong to the upper row of receptors."""
    found = LATTICE.receptors_at((8, 12))
    assert found.dtype == int
    x = (np.arange(12) + 0.5) / 4 - 1.5
    np.testing.assert_array_equal(found[:6], [np.searchsorted(COLUMNS[0], x) - 1] * 6)
    np.testing.assert_array_equal(found[6:], [np.searchsorted(COLUMNS[1], x) + 2] * 2)


def test_even_lattices():
    lattice = even_lattice((2, 3))
    np.testing.assert_array_equal(lattice.rows, [-1, 0, 1])
    np.testing.assert_array_equal(lattice.columns, [[-1.5, -0.5, 0.5, 1.5]] * 2)


def test_overlaps_of_cells():
    found = overlaps(np.array([-1.0, 0.25, 0.75, 2.5, 9.0]), 3)
    np.testing.assert_allclose(found, [[0.25, 0, 0], [0.5, 0, 0], [0.25, 1, 0.5], [0, 0, 0.5]])


def test_edges_divide_a_map_into_equal_sums():
    """The first row holds a quarter of the density. The second row of receptors begins inside the map's second row."""
    density = DensityMap(np.array([[1.0, 1.0], [1.0, 5.0]]))
    found = receptor_lattice.receptor_lattice(density, (2, 2), (1.0, 1.0), (0.0, 0.0))
    np.testing.assert_allclose(found.rows, [-1, 1 / 3, 1])
    # Upper receptors: 1 + 1/3 on the left and 1 + 5/3 on the right. Lower ones: 1 on the left and 5 on the right.
    np.testing.assert_allclose(found.columns, [[-1, 1 / 4, 1], [-1, 0.4, 1]])
    three = receptor_lattice._edges(np.array([[1.0, 2.0], [3.0, 0.0]]), 3)
    np.testing.assert_allclose(three, [[-1.5, 0, 0.75, 1.5], [-1.5, -1, -0.5, 1.5]])


@pytest.mark.parametrize("value", [0.3, 2.0])
def test_an_even_map_has_no_lattice(value):
    assert receptor_lattice.receptor_lattice(DensityMap(np.full((2, 2), value)), (2, 2), (1.0, 1.0), (0.0, 0.0)) is None


def test_the_narrowest_receptor():
    """The density is d on one of 200 cells and 1 elsewhere. Of 200 receptors, the narrowest has the side
    (199 + d)/(200 d).
    """
    assert NARROWEST == 0.01

    def narrowest(density, axis):
        values = np.ones((1, 200))
        values[0, 0] = density
        shape = (1, 200) if axis else (200, 1)
        lattice = receptor_lattice.receptor_lattice(DensityMap(values.reshape(shape)), shape, (1.0, 1.0), (0.0, 0.0))
        return lattice.smallest[axis]

    for axis in (0, 1):
        assert narrowest(197, axis) == pytest.approx(396 / 200 / 197)
        with pytest.raises(
            ValueError, match=r"narrowest receptor 0\.0099 times the average: must be at least 0\.01, so"
        ):
            narrowest(203, axis)
