"""Quadrature over pixelated openings, against the openings' own edge-fitted rules, which do not depend on pixels."""

import numpy as np
import pytest

from optics import Annulus, Circle, Polygon, Slit
from optics.apertures.pixelated import PixelatedAperture

OPENINGS = {
    "circle": Circle(),
    "annulus": Annulus(0.37),
    "slit": Slit(1.3, 0.9),
    "pentagon": Polygon.regular(5, 7.0),
    "notched": Polygon(np.array([[-0.8, -0.5], [0.8, -0.5], [0.1, 0.0], [0.5, 0.6], [-0.6, 0.7]])),
    "whole square": Slit(np.sqrt(2), np.sqrt(2)),
}
CYCLES = 3.0


def wave(x, y):
    """A wave of at most three cycles per radius, oblique to both axes."""
    return np.exp(2j * np.pi * (1.7 * x - 2.4 * y) + 0.3j * x * x)


@pytest.fixture(params=OPENINGS)
def opening(request):
    return OPENINGS[request.param]


@pytest.fixture
def exact(opening):
    nodes = opening.nodes(CYCLES, 13.0)
    return np.sum(nodes.weight * wave(nodes.x, nodes.y))


@pytest.mark.fast_cases(10)
@pytest.mark.parametrize("count", [1, 2, 5, 16, 33])
@pytest.mark.parametrize("digits", [3.0, 6.0, 10.0])
def test_nodes_are_as_good_as_they_are_asked_to_be(opening, exact, count, digits):
    """No border between 33 pixels lies on an axis, but some borders between 16 pixels do. The last case is a single
    pixel.
    """
    nodes = PixelatedAperture(opening, count).nodes(CYCLES, digits)
    assert abs(np.sum(nodes.weight * wave(nodes.x, nodes.y)) - exact) < 10**-digits * opening.area
    assert np.all(opening.contains(nodes.x, nodes.y))


@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("count", [16, 33])
@pytest.mark.parametrize("digits", [3.0, 6.0, 10.0])
def test_rows_and_columns_of_nodes_are_as_good(opening, exact, count, digits):
    pixels = PixelatedAperture(opening, count)
    across = pixels.nodes_across(CYCLES, digits)
    at = pixels.rows(across)
    assert abs(np.sum(pixels.weights(across) * wave(at[None, :], at[:, None])) - exact) < 10**-digits * opening.area


@pytest.mark.parametrize("fixed", [4, 7])
def test_cells_of_different_widths_integrate_polynomials_exactly(opening, fixed):
    """The function is a product of two splines with uneven knots. It is a cubic polynomial in x and in y in every
    cell.
    """
    borders = (-1.0, -0.7, -0.65, -0.1, 0.2, 0.5, 0.95, 1.0)
    cells = PixelatedAperture.between(opening, borders, fixed)
    slopes = np.random.default_rng(0).standard_normal((2, 7, 4))

    def pieces(x, y):
        parts = []
        for at, slope in zip((x, y), slopes, strict=True):
            cell = np.searchsorted(borders, at).clip(1, 7) - 1
            parts.append(sum(slope[cell, k] * (at - np.asarray(borders)[cell]) ** k for k in range(4)))
        return parts[0] * parts[1]

    at, nodes = cells.rows(fixed), cells.nodes(0.0, 3.0)
    strips = PixelatedAperture.between(opening, borders).nodes(1.0, 12.0)
    exact = np.sum(strips.weight * pieces(strips.x, strips.y))
    assert abs(np.sum(cells.weights(fixed) * pieces(at[None, :], at[:, None])) - exact) < 1e-7
    assert abs(np.sum(nodes.weight * pieces(nodes.x, nodes.y)) - exact) < 1e-7
    assert len(nodes) == cells.node_count(0.0, 3.0) < (7 * fixed) ** 2


def test_pixels_cannot_be_left_out_or_taken_whole():
    """The usual method counts a whole pixel if its centre lies in the opening. With 33 pixels, this edge of steps has
    an error of 3e-3, a thousand times the tolerance above.
    """
    count, circle = 33, Circle()
    centres = (np.arange(count) + 0.5) * 2 / count - 1
    x, y = np.meshgrid(centres, centres)
    area = np.count_nonzero(circle.contains(x, y)) * (2 / count) ** 2
    assert abs(area / circle.area - 1) > 1e-3
    assert np.sum(PixelatedAperture(circle, count).nodes(0.0, 6.0).weight) == pytest.approx(circle.area, rel=1e-7)


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("count", [5, 16])
def test_no_panel_crosses_a_border_between_pixels(opening, count):
    """A function that is constant in every pixel, and jumps at the borders, is integrated as accurately as the sum over
    pixels.
    """
    heights = np.random.default_rng(0).random((count, count))

    def jumping(nodes):
        row, column = (np.floor((at + 1) * count / 2).astype(int) for at in (nodes.y, nodes.x))
        return np.sum(nodes.weight * heights[row, column])

    coarse, fine = (jumping(PixelatedAperture(opening, count).nodes(CYCLES, digits)) for digits in (6.0, 12.0))
    assert coarse == pytest.approx(fine, abs=1e-6)
    ignorant = [jumping(PixelatedAperture(opening, count - 1).nodes(CYCLES, digits)) for digits in (6.0, 12.0)]
    assert abs(ignorant[0] - ignorant[1]) > 1e-4, "nodes fitted to other pixels have a large error"


def test_coarse_pixels_have_no_rows_and_columns():
    """The rule would need polynomials through more than 32 nodes."""
    assert PixelatedAperture(Circle(), 2).nodes_across(20.0, 6.0) is None
    assert PixelatedAperture(Circle(), 2).nodes_across(3.0, 6.0) is not None


def test_a_soft_edge_is_refused():
    with pytest.raises(TypeError, match="no band limit"):
        PixelatedAperture(Circle(), 4).soften(3.0, 1e-3)


@pytest.mark.parametrize(
    "opening",
    [
        Polygon(np.array([[-0.9, -0.1], [0.9, 0.0], [-0.9, 0.1]])),
        Polygon.regular(3, 10.0),
        Polygon.regular(6),
        Circle(),
    ],
)
@pytest.mark.parametrize(("count", "cycles"), [(1, 10.0), (2, 10.0), (4, 30.0)])
def test_edges_that_slant_have_nodes_for_what_they_slide_by(opening, count, cycles):
    """Along a slanted side, x changes much while y changes little. If the number of nodes followed from y alone, the
    error would be 1e-3.
    """
    angle = np.deg2rad(25)

    def turning(nodes):
        return np.sum(nodes.weight * np.exp(2j * np.pi * cycles * (nodes.x * np.cos(angle) + nodes.y * np.sin(angle))))

    exact = turning(opening.nodes(cycles, 13.0))
    assert abs(turning(PixelatedAperture(opening, count).nodes(cycles, 5.0)) - exact) < 1e-5 * opening.area


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("inner", [0.5 + 1e-6, 0.501, 0.53])
@pytest.mark.parametrize("count", [3, 4, 7, 8])
def test_a_border_that_nearly_touches_a_circle_does_no_harm(inner, count):
    opening = Annulus(inner)
    nodes, exact = PixelatedAperture(opening, count).nodes(CYCLES, 9.0), opening.nodes(CYCLES, 13.0)
    wrong = np.sum(nodes.weight * wave(nodes.x, nodes.y)) - np.sum(exact.weight * wave(exact.x, exact.y))
    assert abs(wrong) < 2e-9 * opening.area
