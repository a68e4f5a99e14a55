"""The pupil's optical path, and messages about bad pupils."""

import math

import numpy as np
import pytest

from optics import BSplineRelief, HeightMap, PixelRelief, PointSource, Pupil, RefractiveIndex
from optics.apertures.aperture import EDGE_REACH
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

TYPES = precision("float64")
X, Y = np.random.default_rng(0).uniform(-30e-6, 30e-6, (2, 50))


def path(pupil, wavelength=550e-9):
    return pupil.path(TYPES.Float64(X), TYPES.Float64(Y), wavelength, PointSource()).numpy()


@pytest.mark.parametrize("f", [100e-6, -100e-6])
def test_ideal_lens(f):
    exact = -np.sign(f) * (np.sqrt(X**2 + Y**2 + f**2) - abs(f))
    np.testing.assert_allclose(path(Pupil(30e-6, thin_lens_focal_length=f)), exact, atol=1e-18)


def test_glass_of_height_h_adds_the_index_step_times_h():
    relief = BSplineRelief(np.random.default_rng(1).random((4, 4)) * 1e-5)
    height = relief.height(TYPES.Float64(X / 30e-6), TYPES.Float64(Y / 30e-6)).numpy()
    np.testing.assert_allclose(path(Pupil(30e-6, relief, n=1.6, medium_n=1.25)), 0.35 * height, rtol=1e-12)


def test_index_of_the_medium_makes_any_relief_vanish():
    relief = np.random.default_rng(1).random((9, 9)) * 1e-5
    np.testing.assert_array_equal(path(Pupil(30e-6, relief, n=1.33, medium_n=1.33)), 0)


def test_dispersion_bends_blue_more():
    glass = RefractiveIndex.from_abbe(1.5, 30)
    pupil = Pupil(30e-6, np.full((4, 4), 1e-5), n=glass)
    assert path(pupil, 450e-9)[0] > path(pupil, 650e-9)[0] > 0


def test_array_and_height_map_are_the_same():
    samples = np.random.default_rng(1).random((12, 12)) * 1e-6
    np.testing.assert_array_equal(path(Pupil(30e-6, samples)), path(Pupil(30e-6, HeightMap(samples))))


def test_slopes_and_rays_of_a_prism():
    tilt = 0.2 / 0.5  # height per metre; a ray leaves with sine 0.2
    pupil = Pupil(30e-6, BSplineRelief(np.outer(np.ones(4), tilt * (2 * np.arange(4) - 3) * 30e-6)), n=1.5)
    slopes = pupil.slopes(550e-9, PointSource())
    assert slopes.steepest == pytest.approx(0.2, rel=1e-9)
    x, y = slopes.rays(1e-3, 1.0)
    assert x.mean() == pytest.approx(1e-3 * math.tan(math.asin(0.2)), rel=1e-6)
    assert y.mean() == pytest.approx(0, abs=1e-9)


def test_wavelengths_share_slopes_where_the_glass_does_not_disperse():
    relief = BSplineRelief(np.random.default_rng(0).random((4, 4)) * 1e-5)
    red, blue = (Pupil(30e-6, relief, n=1.5).slopes(wavelength, PointSource()) for wavelength in (650e-9, 450e-9))
    np.testing.assert_array_equal(red.along_x, blue.along_x)
    pupil = Pupil(30e-6, relief, n=RefractiveIndex.from_abbe(1.5, 30))
    red, blue = (pupil.slopes(wavelength, PointSource()) for wavelength in (650e-9, 450e-9))
    steps = [pupil.index_step(wavelength) for wavelength in (650e-9, 450e-9)]
    assert steps[1] > 1.01 * steps[0]
    np.testing.assert_allclose(blue.along_x, red.along_x * (steps[1] / steps[0]), rtol=1e-9)


def test_slopes_of_a_lens_hold_out_to_the_rim_of_its_soft_edge():
    """A lens changes the phase by thousands of waves. If slopes at the ends of the grid were accurate to first order
    only, their error would dominate the small difference that remains in the focus, and more samples would be
    needed.
    """
    f = 100e-6
    slopes = Pupil(30e-6, thin_lens_focal_length=f).slopes(550e-9, PointSource())
    x, y = slopes.grid.x[None, :], slopes.grid.y[:, None]
    exact = -x / np.sqrt(x * x + y * y + f * f)
    np.testing.assert_allclose(slopes.along_x, exact, atol=1e-5)
    np.testing.assert_allclose(slopes.along_y, exact.T, atol=1e-5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"aperture_radius": 0.0}, r"aperture_radius = 0\.0: must be greater than 0"),
        ({"aperture_radius": -1e-6}, "aperture_radius"),
        ({"aperture_radius": math.nan}, "aperture_radius"),
        ({"aperture_radius": math.inf}, "aperture_radius"),
        ({"aperture_radius": "wide"}, "aperture_radius = 'wide': must be a number"),
        ({"aperture_radius": 1e-5, "n": 0.5}, r"n = 0\.5: must lie in \[1, 10\]"),
        ({"aperture_radius": 1e-5, "medium_n": 0.0}, "medium_n"),
        ({"aperture_radius": 1e-5, "thin_lens_focal_length": 0.0}, "thin_lens_focal_length"),
        ({"aperture_radius": 1e-5, "height": np.zeros(3)}, "height has shape"),
        ({"aperture_radius": 1e-5, "height": np.full((4, 4), np.nan)}, "height holds NaN"),
        ({"aperture_radius": "20e-6"}, "aperture_radius = '20e-6': must be a number"),
        (
            {"aperture_radius": 1e-5, "aperture": "circle"},
            "aperture = 'circle': must be a kind of Aperture, such as Circle",
        ),
        ({"aperture_radius": 1e-5, "thin_lens_focal_length": "a"}, "thin_lens_focal_length = 'a': must be a number"),
        ({"aperture_radius": 1e-5, "height": "lens"}, "height: must be real numbers, not 'lens'"),
        ({"aperture_radius": 1e-5, "height": np.full((2, 2), 1j)}, "height: must be real numbers, not complex"),
    ],
)
def test_bad_pupils(arguments, message):
    with pytest.raises(ValueError, match=message):
        Pupil(**arguments)


def test_path_and_pupil_turn_together_most_at_the_rim():
    """Without a relief, the slope of the path to a point on the axis at the distance D is n times the sine of the angle
    to the rim, R / √(R² + D²).
    """
    radius, distance = 30e-6, 200e-6
    slopes = Pupil(radius, medium_n=1.33).slopes(550e-9, PointSource())
    soft, disk = slopes.turning(distance, Grid((1, 1), 1e-6), 1.33)
    rim = 1.33 * radius / math.hypot(radius, distance)
    assert rim <= disk <= 1.1 * rim
    reach = (1 + EDGE_REACH) * radius
    assert soft == pytest.approx(1.33 * reach / math.hypot(reach, distance), rel=0.02)


def test_a_message_takes_one_line_whatever_it_is_about():
    """A value that would fill a page is named by its kind and shape."""
    relief = PixelRelief(np.zeros((16, 16)))
    for wrong, named in (
        (relief, "aperture_radius = PixelRelief"),
        (np.zeros((30, 30)), r"ndarray of shape \(30, 30\)"),
    ):
        with pytest.raises(ValueError, match=named) as caught:
            Pupil(wrong)
        assert "\n" not in str(caught.value)
