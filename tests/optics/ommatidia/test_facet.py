"""Facet lenses: published ones, and the formulas' limits."""

import math

import pytest

import optics
from optics import FacetLens

DROSOPHILA = FacetLens(16e-6, 11e-6, -11e-6, 8e-6, 1.45, 1.0, 1.34)


def test_the_lens_of_a_fruit_fly():
    """The lens has a power of 0.049 µm⁻¹ and focal lengths of 20.6 and 27.5 µm (Stavenga 2003, appendix 1)."""
    assert DROSOPHILA.power(550e-9) == pytest.approx(0.049e6, rel=0.01)
    assert DROSOPHILA.object_focal_length() == pytest.approx(20.6e-6, rel=3e-3)
    assert DROSOPHILA.focal_length() == pytest.approx(27.5e-6, rel=3e-3)


def test_one_surface_and_a_ball():
    """A single surface has f = n'r/(n' - n₀). A ball of index 2 in air focuses light on its back, and both principal
    planes are in its middle.
    """
    single = FacetLens(20e-6, 10e-6, n=1.4, medium_n=1.4)
    assert single.focal_length() == pytest.approx(1.4 * 10e-6 / 0.4)
    assert single.principal_planes() == pytest.approx((0.0, 0.0))
    ball = FacetLens(5e-6, 10e-6, -10e-6, 20e-6, n=2.0, medium_n=1.0)
    assert ball.focal_length() == pytest.approx(10e-6)
    assert ball.principal_planes() == pytest.approx((10e-6, 10e-6))


def test_a_ray_through_both_surfaces_meets_the_axis_where_the_formulas_say():
    """The reference is paraxial refraction at one surface after the other."""
    height, slope = 1.0, 0.0
    slope = (slope * 1.0 - height * (1.45 - 1.0) / 11e-6) / 1.45
    height += slope * 8e-6
    slope = (slope * 1.45 - height * (1.34 - 1.45) / -11e-6) / 1.34
    behind_front = 8e-6 - height / slope
    assert DROSOPHILA.principal_planes()[1] + DROSOPHILA.focal_length() == pytest.approx(behind_front, rel=1e-12)


def test_its_pupil_is_a_hexagon_that_focuses():
    pupil = DROSOPHILA.pupil()
    assert pupil.area == pytest.approx(math.sqrt(3) / 2 * 16e-6**2)
    assert optics.strehl_ratio(optics.psf(pupil, dx=0.1e-6, shape=(9, 9)))[0] == pytest.approx(1, abs=2e-3)
    assert FacetLens(16e-6, 11e-6, shape="circle").pupil().area == pytest.approx(math.pi / 4 * 16e-6**2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FacetLens(-1, 11e-6), "diameter = -1"),
        (lambda: FacetLens(16e-6, 0.0), r"abs\(radius_front\) = 0"),
        (lambda: FacetLens(16e-6, -11e-6), "must make a lens that focuses"),
        (lambda: FacetLens(16e-6, 11e-6, thickness=-1e-6), "thickness = -1e-06"),
        (lambda: FacetLens(16e-6, 11e-6, shape="square"), "shape = 'square'"),
        (lambda: FacetLens(16e-6, 11e-6, n=0.5), "n = 0.5"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()
