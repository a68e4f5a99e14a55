"""Reliefs: the gene's patch contains every paraboloid, maps are joined exactly, rows are y."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from optics import BSplineRelief, HeightMap
from optics.numerics.precision import precision

TYPES = precision("float64")


def heights(relief, x, y):
    x, y = np.broadcast_arrays(x, y)
    flat = relief.height(TYPES.Float64(np.ravel(x)), TYPES.Float64(np.ravel(y))).numpy()
    return flat.reshape(x.shape)


def random_places(n=200):
    return np.random.default_rng(0).uniform(-1, 1, (2, n))


@pytest.mark.parametrize("curvature", [-3e3, 1.7e4])
def test_patch_contains_every_paraboloid(curvature):
    radius, top = 60e-6, 12e-6
    x, y = random_places()
    exact = top - curvature * ((radius * x) ** 2 + (radius * y) ** 2) / 2
    np.testing.assert_allclose(heights(BSplineRelief.paraboloid(top, curvature, radius), x, y), exact, atol=1e-18)


def test_patch_is_the_uniform_cubic_b_spline_on_knots_minus_3_to_4():
    points = np.random.default_rng(1).random((4, 4))
    x, y = random_places()
    basis = [BSpline.basis_element(np.arange(i - 3, i + 2), extrapolate=False) for i in range(4)]
    bx, by = (np.nan_to_num([b((t + 1) / 2) for b in basis]) for t in (x, y))
    np.testing.assert_allclose(
        heights(BSplineRelief(points), x, y), np.einsum("ij,ip,jp->p", points, by, bx), atol=1e-14
    )


def test_rows_are_y_and_columns_x():
    points = np.zeros((4, 4))
    points[3] = 1  # last row: large y
    relief = BSplineRelief(points)
    assert heights(relief, 0.3, 0.9) > 2 * heights(relief, 0.9, 0.3) > 0
    samples = np.zeros((8, 8))
    samples[6] = 1
    assert heights(HeightMap(samples), 0.125, 0.625) == pytest.approx(1, abs=1e-12)
    assert heights(HeightMap(samples), 0.625, 0.125) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("n", [4, 5, 16, 33])
def test_map_is_exact_for_cubics(n):
    """The map is also exact in the half cell between the outermost centres and the pupil's edge."""

    def cubic(x, y):
        return 1 + x - 2 * x**3 + (y**3 - y**2) * (0.5 + x**2)

    centres = (2 * np.arange(n) + 1) / n - 1
    x, y = random_places()
    np.testing.assert_allclose(heights(HeightMap(cubic(centres, centres[:, None])), x, y), cubic(x, y), atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_few_samples_make_the_polynomial_through_them(n):
    centres = (2 * np.arange(n) + 1) / n - 1
    samples = np.add.outer(centres ** (n - 1), 2 * centres ** (n - 1))
    x, y = random_places()
    np.testing.assert_allclose(heights(HeightMap(samples), x, y), y ** (n - 1) + 2 * x ** (n - 1), atol=1e-12)


def test_map_converges_in_fourth_order():
    x, y = random_places(2000)
    exact = np.sin(4 * x) * np.cos(3 * y)
    errors = []
    for n in (32, 64):
        centres = (2 * np.arange(n) + 1) / n - 1
        relief = HeightMap(np.sin(4 * centres) * np.cos(3 * centres[:, None]))
        errors.append(np.sqrt(np.mean((heights(relief, x, y) - exact) ** 2)))
    assert 3.5 < np.log2(errors[0] / errors[1]) < 5


@pytest.mark.parametrize(
    "samples", [np.zeros((3, 4, 1)), np.zeros((0, 0)), np.zeros((0, 4)), np.zeros(4), np.full((4, 4), np.nan)]
)
def test_bad_maps(samples):
    with pytest.raises(ValueError, match="height"):
        HeightMap(samples)


@pytest.mark.parametrize("points", [np.zeros((3, 3)), np.full((4, 4), np.inf)])
def test_bad_control_points(points):
    with pytest.raises(ValueError, match="control_points"):
        BSplineRelief(points)


@pytest.mark.parametrize("shape", [(4, 9), (12, 5), (1, 6), (7, 2)])
def test_rows_and_columns_may_differ_in_number(shape):
    """The spline is a tensor product. It is therefore exact for a product of one polynomial in x and one in y that the
    samples along each side determine.
    """
    y, x = ((2 * np.arange(n) + 1) / n - 1 for n in shape)
    down, across = (min(n - 1, 3) for n in shape)
    relief = HeightMap((1 + y**down)[:, None] * (2 - x**across))
    at_x, at_y = random_places()
    exact = (1 + at_y**down) * (2 - at_x**across)
    np.testing.assert_allclose(heights(relief, at_x, at_y), exact, atol=1e-12)
    np.testing.assert_allclose(relief.on_grid(at_x), relief.height(*np.meshgrid(at_x, at_x)), atol=1e-12)
    mirrored = HeightMap(relief.samples.T)
    assert mirrored.bandwidth(1e-3) == pytest.approx(relief.bandwidth(1e-3))
    assert mirrored.detail(1e-3) == pytest.approx(relief.detail(1e-3))
    assert (relief.knots, relief.rotationally_symmetric) == (max(shape), False)
