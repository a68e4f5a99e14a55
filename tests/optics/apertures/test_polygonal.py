"""Polygons: their shape, their limit, and bad input."""

import numpy as np
import pytest

from optics.apertures.circular import Annulus, Circle
from optics.apertures.polygonal import Polygon, Slit
from optics.apertures.triangulation import _meet, triangles
from optics.numerics.precision import precision

TYPES = precision("float64")
U_SHAPE = [(-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (0.4, 0.6), (0.4, -0.4), (-0.4, -0.4), (-0.4, 0.6), (-0.6, 0.6)]


def at(shape, x, y):
    soft = shape.soften(5.0, 1e-8)
    return soft.transmittance(TYPES.Float64(x), TYPES.Float64(y), TYPES).numpy()


def test_areas():
    assert Circle().area == pytest.approx(np.pi)
    assert Annulus(0.6).area == pytest.approx(0.64 * np.pi)
    assert Polygon.regular(6).area == pytest.approx(1.5 * np.sqrt(3))
    assert Polygon(U_SHAPE).area == Polygon(U_SHAPE[::-1]).area == pytest.approx(1.44 - 0.8)
    assert Slit(0.2, 1.5).area == pytest.approx(0.3)


def test_regular_polygon_tends_to_the_circle():
    """For a polygon of n sides that are shorter than the kernel resolves, the difference from the circle falls like
    n^-2, as does the sagitta of a side.
    """
    x, y = np.random.default_rng(0).uniform(-1.1, 1.1, (2, 2000))
    circle = at(Circle(), x, y)
    error = [np.abs(at(Polygon.regular(n), x, y) - circle).max() for n in (128, 256, 512)]
    assert np.log2(error[0] / error[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(error[1] / error[2]) == pytest.approx(2, abs=0.05)
    area = [np.pi - Polygon.regular(n).area for n in (64, 128)]
    assert np.log2(area[0] / area[1]) == pytest.approx(2, abs=0.01)


def test_corner_and_edge_values():
    """The transmittance at a corner is the angle of the corner divided by 2π. On an edge far from corners, it is
    1/2.
    """
    hexagon = Polygon.regular(6)
    soft = hexagon.soften(30.0, 1e-8)
    middle = (hexagon.vertices + np.roll(hexagon.vertices, -1, axis=0)) / 2
    points = np.concatenate([hexagon.vertices, middle])
    values = soft.transmittance(TYPES.Float64(points[:, 0].copy()), TYPES.Float64(points[:, 1].copy()), TYPES).numpy()
    np.testing.assert_allclose(values, 6 * [1 / 3] + 6 * [1 / 2], atol=1e-8)


def test_slit_is_the_rectangle():
    x, y = np.random.default_rng(0).uniform(-1.1, 1.1, (2, 500))
    rectangle = Polygon([(-0.05, -0.9), (-0.05, 0.9), (0.05, 0.9), (0.05, -0.9)])
    # The slit's narrow half width leads to another transition, so both are compared at the same reach.
    slit = Slit(0.1, 1.8)
    assert slit.half_widths == rectangle.half_widths
    np.testing.assert_allclose(at(slit, x, y), at(rectangle, x, y), atol=1e-12)
    assert (slit.contains(x, y) == rectangle.contains(x, y)).all()


def test_turning_the_polygon_turns_the_mask():
    x, y = np.random.default_rng(3).uniform(-1.1, 1.1, (2, 500))
    c, s = np.cos(np.deg2rad(25)), np.sin(np.deg2rad(25))
    turned = at(Polygon.regular(5, 25), c * x - s * y, s * x + c * y)
    np.testing.assert_allclose(turned, at(Polygon.regular(5), x, y), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_triangles_cover_any_simple_polygon(seed):
    """The number of triangles around a point is 1 inside the polygon and 0 outside."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 15))
    radius = rng.uniform(0.1, 1, 15)
    shape = Polygon(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    x, y = rng.uniform(-1, 1, (2, 2000))
    count = sum(Polygon(corners).contains(x, y).astype(int) for corners in triangles(shape.vertices))
    assert (count == shape.contains(x, y)).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Polygon([(0, 0), (1, 0)]), r"vertices has shape \(2, 2\)"),
        (lambda: Polygon([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), r"vertices has shape \(3, 3\)"),
        (lambda: Polygon("abc"), "vertices = 'abc'"),
        (lambda: Polygon([(0, 0), (1, 0), (0, np.nan)]), "vertices holds NaN"),
        (lambda: Polygon([(0, 0), (1, 0), (1, 1)]), "vertices reach out to 1.41421 R"),
        (lambda: Polygon([(0, 0), (0.5, 0), (0.5, 0), (0, 0.5)]), "edge of length 0 R"),
        (lambda: Polygon([(-0.5, -0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, 0.5)]), "edges 0 and 2 cross"),
        (lambda: Polygon([(0, 0), (0.5, 0), (0.2, 0), (0, 0.5)]), "edges 0 and 1 cross"),
        (lambda: Polygon([(0, 0), (0.3, 0), (0.6, 0)]), "edges . and . cross"),
        (lambda: Polygon([(-0.5, 0), (0.5, 0), (0.5, 0.5), (0, 0), (-0.5, 0.5)]), "edges 0 and 2 cross"),
        (lambda: Polygon.regular(2), "n = 2"),
        (lambda: Polygon.regular(6, np.inf), "rotation_deg = inf"),
        (lambda: Slit(0, 1), "width = 0"),
        (lambda: Slit(1, np.nan), "height = nan"),
        (lambda: Slit(0.1, 2.0), "must fit into the unit circle"),
        (lambda: Annulus(1.0), "inner = 1.0"),
        (lambda: Annulus(0.0), "inner = 0.0"),
        (lambda: Annulus(float("nan")), "inner = nan"),
        (lambda: Circle().soften(-1.0, 1e-3), "passband = -1.0"),
        (lambda: Circle().soften(1.0, 0.0), "ripple = 0.0"),
        (lambda: Circle().soften(1.0, 1e-3, -0.1), "widest_reach = -0.1"),
        (lambda: Circle().soften(float("inf"), 1e-3), "passband = inf"),
        (lambda: Circle().nodes(-1.0, 3), "cycles = -1.0"),
        (lambda: Slit(0.1, 1).nodes(1.0, float("nan")), "digits = nan"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_segments_that_only_touch_share_a_point():
    """Segments meet if the end of one lies on the middle or the end of the other, up to rounding; a gap of a millionth
    separates them."""
    a, along = np.array([0.0, 0.0]), np.array([2.0, 0.0])
    starts = np.array([[1.0, 0.0], [2.0, 0.0], [1.0, 1e-6], [1.0, -1.0], [2.000001, -1.0]])
    ends = np.array([[1.0, 1.0], [3.0, 1.0], [1.0, 1.0], [1.0, 0.0], [2.000001, 1.0]])
    assert _meet(a, along, starts, ends - starts).tolist() == [True, True, False, True, False]
