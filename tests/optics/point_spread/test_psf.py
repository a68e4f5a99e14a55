"""PSFs against closed forms and the direct sum; signs, axes and centring; and refusals."""

import math

import numpy as np
import pytest

import optics
from optics import AccuracyError, BSplineRelief, Pupil
from validation import reference
from validation.reference import relative_l2

LENS = Pupil(30e-6, thin_lens_focal_length=240e-6)


def centroid(result):
    image = result.psf[0] / result.psf[0].sum()
    return float((image.sum(axis=0) * result.x).sum()), float((image.sum(axis=1) * result.y).sum())


def prism(radius, sine, n=1.5, axis=1):
    """Return a relief that deflects light by the given sine towards +x (axis 1) or +y (axis 0), where it is thicker."""
    ramp = sine / (n - 1) * (2 * np.arange(4) - 3) * radius
    points = np.broadcast_to(ramp if axis == 1 else ramp[:, None], (4, 4))
    return Pupil(radius, BSplineRelief(points), n=n)


METHODS = ["angular_spectrum", "split_angular_spectrum", "far_field", "low_rank", "rayleigh_sommerfeld"]


class TestOracles:
    """For a radius of 20 µm, a distance of 40 µm and 500 nm, the Fresnel number is 20. The exact intensity on the axis
    is 3.474; Fresnel's approximation gives 0.
    """

    a, z, wavelength = 20e-6, 40e-6, 500e-9

    def test_the_oracle_fails_the_paraxial_method(self):
        fresnel = 4 * math.sin(math.pi * self.a**2 / (2 * self.wavelength * self.z)) ** 2
        assert fresnel == pytest.approx(0, abs=1e-12)
        exact = reference.circular_aperture_on_axis(self.a, self.z, self.wavelength)
        assert exact == pytest.approx(3.474, abs=1e-3)

    @pytest.mark.parametrize(("dtype", "error"), [("float32", 5e-5), ("float64", 5e-7)])
    @pytest.mark.parametrize("method", ["angular_spectrum", "rayleigh_sommerfeld"])
    def test_circular_aperture_on_axis(self, method, dtype, error):
        result = optics.psf(
            Pupil(self.a),
            [self.wavelength],
            self.z,
            dx=0.5e-6,
            shape=(5, 5),
            tolerance=2 * error,
            method=method,
            dtype=dtype,
        )
        exact = reference.circular_aperture_on_axis(self.a, self.z, self.wavelength)
        assert result.psf[0, 2, 2] * math.pi * self.a**2 == pytest.approx(exact, rel=error)

    def test_far_field_of_an_aperture_is_fraunhofers(self):
        """The intensity at the Fresnel number 5e-4 is (πa²/λρ)² (z/ρ)² (2 J1(v)/v)² with v = ka sin θ, except for
        errors of the order of the Fresnel number squared.
        """
        from scipy.special import j1

        a, z = 2e-6, 16e-3
        result = optics.psf(Pupil(a), [self.wavelength], z, dx=0.4e-3, shape=(41, 41), tolerance=1e-3)
        rho = np.sqrt(result.x**2 + result.y[:, None] ** 2 + z**2)
        v = 2 * np.pi * a * np.sqrt(1 - (z / rho) ** 2) / self.wavelength + 1e-9
        exact = math.pi * a**2 / (self.wavelength * rho) ** 2 * (z / rho) ** 2 * (2 * j1(v) / v) ** 2
        assert relative_l2(result.psf[0], exact) < 1e-3


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("method", METHODS[:3])
def test_methods_agree_with_the_direct_sum_within_their_prediction(method, seed):
    """Reliefs and distances are random, and windows are not adapted to the optics. The error never exceeds the
    prediction of the plan.
    """
    rng = np.random.default_rng(seed)
    radius, z, n = 10 ** rng.uniform(0.2, 1.1) * 1e-6, 10 ** rng.uniform(-4, -3) * 1, rng.uniform(1, 2)
    pupil = Pupil(radius, BSplineRelief(rng.random((4, 4)) * 2 * radius), n=n)
    window = {"dx": z * rng.uniform(0.1, 0.6) / 10, "shape": (21, 17)}
    wavelength = [rng.uniform(400e-9, 700e-9)]
    exact = optics.psf(pupil, wavelength, z, **window, method="rayleigh_sommerfeld", tolerance=1e-6, dtype="float64")
    for tolerance in (1e-2, 1e-3):
        result = optics.psf(pupil, wavelength, z, **window, method=method, tolerance=tolerance)
        assert result.plan.method == method
        assert relative_l2(result.psf, exact.psf) <= result.plan.predicted_error <= tolerance


@pytest.mark.parametrize("method", METHODS[:2])
def test_error_follows_the_tolerance(method):
    """Every requested digit is obtained in float64."""
    r = np.hypot(*np.meshgrid(*[np.arange(-15, 16) * 0.5e-6] * 2))
    exact = np.abs(reference.ideal_lens_field(r.ravel(), 550e-9, 30e-6, 240e-6)).reshape(r.shape) ** 2 / LENS.area
    for tolerance in (1e-2, 1e-4, 1e-6, 1e-8):
        result = optics.psf(
            LENS, [550e-9], dx=0.5e-6, shape=(31, 31), tolerance=tolerance, method=method, dtype="float64"
        )
        assert relative_l2(result.psf[0], exact) < tolerance / 2


class TestConventions:
    def test_centre_sample_holds_the_focus(self):
        for shape in ((32, 33), (33, 32)):
            image = optics.psf(LENS, [550e-9], dx=0.5e-6, shape=shape).psf[0]
            assert np.unravel_index(np.argmax(image), shape) == (16, 16)

    @pytest.mark.parametrize("axis", [0, 1])
    def test_prism_deflects_towards_its_thick_side(self, axis):
        result = optics.psf(prism(20e-6, 0.2, axis=axis), [550e-9], 200e-6, dx=1e-6, shape=(161, 161), tolerance=1e-2)
        deflection = 200e-6 * math.tan(math.asin(0.2))
        expected = (0, deflection) if axis == 0 else (deflection, 0)
        assert centroid(result) == pytest.approx(expected, abs=1e-6)

    def test_height_array_is_y_x(self):
        """Glass that is thicker in the last rows deflects light towards +y."""
        rows = np.repeat(np.linspace(-1, 1, 32)[:, None], 32, axis=1)
        result = optics.psf(
            Pupil(20e-6, 4e-6 * rows, n=1.5), [550e-9], 200e-6, dx=1e-6, shape=(121, 121), tolerance=1e-2
        )
        x, y = centroid(result)
        assert y > 15e-6
        assert abs(x) < 1e-6

    def test_convex_relief_focuses_and_concave_spreads(self):
        radius, f = 20e-6, 240e-6
        convex, concave = (BSplineRelief.paraboloid(10e-6, sign / (0.5 * f), radius) for sign in (1, -1))
        peaks = [optics.psf(Pupil(radius, h), [550e-9], f, tolerance=1e-2).psf.max() for h in (convex, None, concave)]
        assert peaks[0] > 10 * peaks[1] > 10 * peaks[2]
        assert optics.strehl_ratio(optics.psf(Pupil(radius, convex), [550e-9], f)) > 0.95

    def test_index_of_the_medium_makes_any_relief_vanish(self):
        relief = np.random.default_rng(0).random((16, 16)) * 20e-6
        arguments = {"wavelengths": [550e-9], "sensor_distance": 150e-6, "shape": (65, 65)}
        with_relief = optics.psf(Pupil(20e-6, relief, n=1.33, medium_n=1.33), **arguments)
        np.testing.assert_array_equal(with_relief.psf, optics.psf(Pupil(20e-6, medium_n=1.33), **arguments).psf)

    def test_medium_shortens_the_wavelength(self):
        in_water = optics.psf(Pupil(30e-6, thin_lens_focal_length=240e-6, medium_n=1.33), [550e-9])
        in_air = optics.psf(LENS, [550e-9 / 1.33])
        assert relative_l2(in_water.psf, in_air.psf) < 1e-5

    def test_tilted_wave_is_focused_where_it_travels_to(self):
        angle = (0.1, -0.05)
        result = optics.psf(LENS, [550e-9], source_angle=angle, dx=0.5e-6, shape=(161, 161), tolerance=1e-2)
        row, column = np.unravel_index(np.argmax(result.psf[0]), (161, 161))
        expected = [240e-6 * math.tan(theta) for theta in angle]
        # the ideal lens is made for the axis: coma shifts the peak by a few per cent
        assert (result.x[column], result.y[row]) == pytest.approx(expected, abs=1e-6)

    def test_thin_lens_equation(self):
        """A source at 3 f has its sharpest image at 1.5 f, not at f."""
        f = 120e-6
        pupil = Pupil(20e-6, thin_lens_focal_length=f)
        peaks = [
            optics.psf(pupil, [550e-9], s * f, source_distance=3 * f, dx=0.5e-6, shape=(9, 9)).psf.max()
            for s in (1.0, 1.3, 1.5, 1.7, 2.0)
        ]
        assert np.argmax(peaks) == 2


class TestWindow:
    """A window off the axis agrees with a larger one on the axis."""

    @pytest.mark.parametrize("method", METHODS)
    def test_off_the_axis(self, method):
        pupil = Pupil(12e-6, BSplineRelief(np.random.default_rng(3).random((4, 4)) * 3e-6))
        asked = {"wavelengths": [550e-9], "sensor_distance": 150e-6, "method": method, "tolerance": 1e-4}
        whole = optics.psf(pupil, dx=1e-6, shape=(81, 81), **asked)
        part = optics.psf(pupil, dx=1e-6, shape=(21, 15), centre=(20e-6, -12e-6), **asked)
        assert relative_l2(part.psf[0], whole.psf[0, 40 - 12 - 10 : 40 - 12 + 11, 40 + 20 - 7 : 40 + 20 + 8]) < 2e-3
        np.testing.assert_allclose(part.x, whole.x[53:68], atol=1e-15)
        np.testing.assert_allclose(part.y, whole.y[18:39], atol=1e-15)

    def test_follows_an_oblique_wave_with_few_samples(self):
        """A wave from 20° off the axis has its focus 100 µm from the axis. A small window there does not need a large
        transform.
        """
        angle = math.radians(20)
        place = 240e-6 * math.tan(angle)
        result = optics.psf(
            LENS, [550e-9], source_angle=(angle, 0.0), dx=1e-6, shape=(65, 65), centre=(place, 0.0), tolerance=1e-3
        )
        assert result.power[0] > 0.8
        assert math.prod(result.plan.samples) < 0.1 * 371**2, "samples of the angular spectrum"

    def test_must_be_a_point(self):
        with pytest.raises(ValueError, match="centre = 3"):
            optics.psf(LENS, centre=3)


class TestPower:
    @pytest.mark.parametrize("method", ["angular_spectrum", "far_field"])
    def test_a_wide_window_holds_all_power(self, method):
        """The sum of samples equals the integral if they resolve the highest frequency of the intensity."""
        result = optics.psf(
            prism(8e-6, 0.1), [550e-9], 120e-6, dx=1e-6, shape=(281, 281), tolerance=2e-3, method=method
        )
        outside = 2 / (math.pi * 2 * math.pi * 8e-6 * 0.6 / 550e-9)  # Airy's tail beyond sine 0.6
        assert result.power[0] == pytest.approx(1, abs=outside + 2e-3)
        assert result.power[0] < 1.001

    def test_evanescent_light_does_not_arrive(self):
        """Almost no light arrives behind a relief that is so steep that the deflected light is evanescent."""
        lost = optics.psf(
            prism(8e-6, 1.5), [550e-9], 120e-6, dx=2e-6, shape=(141, 141), tolerance=1e-2, dtype="float64"
        )
        assert lost.power[0] < 0.05


def test_bands_are_independent_and_keep_their_order():
    both = optics.psf(LENS, [450e-9, 650e-9], shape=(33, 33))
    for index, wavelength in enumerate((450e-9, 650e-9)):
        np.testing.assert_array_equal(both.psf[index], optics.psf(LENS, [wavelength], shape=(33, 33)).psf[0])
    assert both.psf[0].max() > both.psf[1].max()
    assert both.psf.dtype == np.float32
    assert optics.psf(LENS, [550e-9], dtype="float64").psf.dtype == np.float64


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"wavelengths": [0.0]}, "wavelength"),
        ({"wavelengths": []}, "wavelengths is empty"),
        ({"wavelengths": [math.nan]}, "wavelength"),
        ({"wavelengths": [550]}, r"wavelength = 550\.0: .* in m \(550 nm is 550e-9\)"),
        ({"wavelengths": [[5e-7]]}, r"wavelengths has shape \(1, 1\)"),
        ({"wavelengths": [[5e-7], [4e-7, 5e-7]]}, "wavelengths: must be real numbers"),
        ({"wavelengths": [5e-7j]}, "wavelengths: must be real numbers, not complex"),
        ({"wavelengths": "green"}, "wavelengths: must be real numbers, not 'green'"),
        ({"source_angle": 0.1}, r"source_angle = 0\.1: must be two angles"),
        ({"sensor_distance": -1e-3}, "sensor_distance"),
        ({"sensor_distance": math.inf}, "sensor_distance"),
        ({"source_distance": 0.0}, "source_distance"),
        ({"source_angle": (0.0, 2.0)}, "source_angle"),
        ({"dx": 0.0}, "dx"),
        ({"shape": (0, 0)}, r"shape = \(0, 0\)"),
        ({"shape": (3.5, 4)}, "shape"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": "1e-3"}, "tolerance = '1e-3': must be a number"),
        ({"tolerance": 2.0}, r"tolerance = 2\.0: must lie in"),
        ({"method": "magic"}, "method = 'magic'"),
        ({"dtype": "float16"}, "dtype = 'float16'"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        optics.psf(LENS, **arguments)


@pytest.mark.parametrize("pupil", [None, 20e-6])
def test_what_is_no_pupil_is_named(pupil):
    with pytest.raises(ValueError, match=r"pupil = .*: must be a kind of Pupil, such as"):
        optics.psf(pupil)


class TestRefusals:
    def test_float32_has_a_floor(self):
        with pytest.raises(AccuracyError, match=r"float32 allows at least 1e-05; dtype='float64'"):
            optics.psf(LENS, [550e-9], tolerance=1e-7)

    def test_a_pupil_of_millimetres_and_a_wide_window_are_too_much(self):
        """The light is oblique, so a transform along one radius cannot represent it."""
        pupil, window = Pupil(2e-3, thin_lens_focal_length=4e-3), {"dx": 20e-6, "shape": (201, 201)}
        with pytest.raises(AccuracyError, match="samples across"):
            optics.psf(pupil, [550e-9], 4e-3, **window, source_angle=(0.1, 0.0))

    def test_a_dark_window_is_less_accurate_and_says_so(self):
        """The focus of a tilted wave is far outside the window. The little diffracted light in the window is closer to
        the rounding of float32.
        """
        window = {"wavelengths": [550e-9], "dx": 1e-6, "shape": (17, 17)}
        bright, dark = (
            optics.psf(LENS, **window, source_angle=(angle, 0.0), method="rayleigh_sommerfeld") for angle in (0.0, 0.6)
        )
        exact = optics.psf(LENS, **window, source_angle=(0.6, 0.0), tolerance=1e-7, dtype="float64")
        assert dark.psf.max() < 1e-5 * bright.psf.max()
        assert dark.plan.predicted_error > bright.plan.predicted_error
        assert relative_l2(dark.psf, exact.psf) < dark.plan.predicted_error
