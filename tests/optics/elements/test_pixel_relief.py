"""Pixelated reliefs: stepped gratings and lenses against closed forms, and both methods against each other."""

import drjit as dr
import numpy as np
import pytest

import optics
from optics import AccuracyError, Annulus, Circle, PixelRelief, Polygon, Pupil, Slit
from optics.numerics.precision import precision
from validation import reference

WAVELENGTH = 550e-9
WAVE = WAVELENGTH / 0.5  # height of a full turn in glass of index 1.5
METHODS = ["low_rank", "angular_spectrum", "split_angular_spectrum", "rayleigh_sommerfeld"]


def centres(count, radius):
    return ((np.arange(count) + 0.5) * 2 / count - 1) * radius


class TestGratings:
    """Gratings behind a lens of f/50. Order m lies at m λf/period, and its peak relative to that of the open slit is
    the efficiency of the order.
    """

    RADIUS, FOCAL_LENGTH, PERIODS = 0.5e-3, 50e-3, 20
    OPENING = Slit(1.4, 1.4)  # 14 whole periods

    def efficiency(self, levels, order, relief=PixelRelief):
        step = np.arange(levels * self.PERIODS) % levels * WAVE / levels
        heights = np.broadcast_to(step, (step.size, step.size))
        period = 2 * self.RADIUS / self.PERIODS
        at = self.FOCAL_LENGTH * np.tan(np.arcsin(order * WAVELENGTH / period))
        peaks = []
        for height, where in ((None, 0.0), (relief(heights), at)):
            pupil = Pupil(self.RADIUS, height, thin_lens_focal_length=self.FOCAL_LENGTH, aperture=self.OPENING)
            window = optics.psf(pupil, [WAVELENGTH], self.FOCAL_LENGTH, dx=2e-6, shape=(9, 17), centre=(where, 0.0))
            peaks.append(window.psf.max())
        return peaks[1] / peaks[0]

    @pytest.mark.fast_cases(1)
    @pytest.mark.parametrize(("levels", "order"), [(2, 1), (4, 1), (2, -1), (2, 3), (4, -3), (8, 1), (8, -7)])
    def test_efficiency_of_a_staircase(self, levels, order):
        """Order m of a staircase of N levels has the efficiency sinc²(m/N) (Swanson 1989), reduced by 1 % in the
        seventh order, because the lens focuses slightly nearer off the axis and oblique light is weaker.
        """
        expected = reference.staircase_grating_efficiency(order, levels)
        assert self.efficiency(levels, order) == pytest.approx(expected, rel=0.02)

    @pytest.mark.slow
    def test_splines_through_the_same_heights_are_another_grating(self):
        """A smooth spline through the same samples is far less efficient."""
        steps = self.efficiency(4, 1)
        splines = self.efficiency(4, 1, optics.HeightMap)
        assert splines < 0.85 * steps


class TestLenses:
    RADIUS, FOCAL_LENGTH = 30e-6, 240e-6

    def lens(self, count, levels=None):
        x = centres(count, self.RADIUS)
        r2 = x**2 + x[:, None] ** 2
        heights = -r2 / (np.sqrt(r2 + self.FOCAL_LENGTH**2) + self.FOCAL_LENGTH) / 0.5
        if levels:
            heights = np.floor(heights % WAVE / (WAVE / levels)) * (WAVE / levels)
        return heights

    def strehl(self, heights, **options):
        pupil = Pupil(self.RADIUS, PixelRelief(heights))
        return optics.strehl_ratio(optics.psf(pupil, [WAVELENGTH], self.FOCAL_LENGTH, shape=(65, 65), **options))[0]

    @pytest.mark.slow
    @pytest.mark.parametrize("levels", [2, 4, 8])
    def test_a_lens_of_levels_focuses_as_a_grating_of_as_many(self, levels):
        """The focus has sinc²(1/N) of the light of a lens with the same pixels of any height. With two levels, other
        orders add 3 %.
        """
        smooth = self.strehl(self.lens(128))
        expected = reference.staircase_grating_efficiency(1, levels)
        assert self.strehl(self.lens(128, levels)) / smooth == pytest.approx(
            expected, rel=0.04 if levels == 2 else 3e-3
        )

    @pytest.mark.slow
    def test_whole_waves_change_nothing(self):
        """A lens whose heights are wrapped to one wave equals the full lens at this wavelength."""
        whole = self.lens(24)
        assert self.strehl(whole % WAVE) == pytest.approx(self.strehl(whole), rel=1e-5)

    @pytest.mark.slow
    def test_finer_pixels_become_the_smooth_relief(self):
        """The phase error in a pixel is the slope times the distance from the pixel's centre. Its mean effect falls
        with the square of the pixel's width.
        """
        counts, off = (64, 128, 256), []
        smooth = Pupil(self.RADIUS, thin_lens_focal_length=self.FOCAL_LENGTH)
        limit = optics.strehl_ratio(optics.psf(smooth, [WAVELENGTH], self.FOCAL_LENGTH, shape=(65, 65)))[0]
        for count in counts:
            off.append(limit - self.strehl(self.lens(count)))
        assert reference.order_of_convergence(counts, off) == pytest.approx(-2, abs=0.05)


RANDOM = np.random.default_rng(3).random((12, 12)) * 2e-6
OPENINGS = {
    "circle": Circle(),
    "annulus": Annulus(0.4),
    "triangle": Polygon.regular(3, 10.0),
    "slit": Slit(1.2, 0.7),
}


class TestMethods:
    PUPIL = Pupil(12e-6, PixelRelief(RANDOM))

    def seen(self, method, opening, tolerance=1e-5, pupil=None, dtype="float64", **options):
        pupil = Pupil(12e-6, PixelRelief(RANDOM), aperture=opening) if pupil is None else pupil
        options = {"dx": 0.5e-6, "shape": (41, 37), "tolerance": tolerance, "dtype": dtype, **options}
        return optics.psf(pupil, [WAVELENGTH], 150e-6, method=method, **options)

    @pytest.mark.fast_cases(2)
    @pytest.mark.parametrize("opening", OPENINGS)
    @pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-8])
    def test_all_keep_the_tolerance(self, opening, tolerance):
        exact = self.seen("rayleigh_sommerfeld", OPENINGS[opening], 1e-11).psf
        for method in METHODS:
            found = self.seen(method, OPENINGS[opening], tolerance)
            assert reference.relative_l2(found.psf, exact) < tolerance
            assert found.plan.predicted_error <= tolerance

    def test_against_a_plain_sum(self):
        """The reference is the first Rayleigh-Sommerfeld integral over 16 x 16 points in every pixel."""
        n, fine, radius, z, k = 12, 16, 12e-6, 150e-6, 2 * np.pi / WAVELENGTH
        at = centres(n * fine, radius)
        open_ = np.abs(at) < 0.5 * radius + 1e-12
        heights = np.repeat(np.repeat(RANDOM, fine, 0), fine, 1)[np.ix_(open_, open_)]
        eta, xi = np.meshgrid(at[open_], at[open_], indexing="ij")
        seen = optics.psf(
            Pupil(radius, PixelRelief(RANDOM), aperture=Slit(1.0, 1.0)), [WAVELENGTH], z, dx=3e-6, shape=(5, 5)
        )
        expected = np.empty((5, 5))
        for row, y in enumerate(seen.y):
            for column, x in enumerate(seen.x):
                d = np.sqrt((x - xi) ** 2 + (y - eta) ** 2 + z**2)
                wave = np.exp(1j * k * (0.5 * heights + d)) * z / (2 * np.pi * d**2) * (1 / d - 1j * k)
                expected[row, column] = np.abs(wave.sum() * (2 * radius / n / fine) ** 2) ** 2 / radius**2
        np.testing.assert_allclose(seen.psf[0], expected, rtol=0, atol=1e-3 * expected.max())

    def test_auto_weighs_all_four(self):
        plan = self.seen("auto", Circle(), 1e-4).plan
        assert [option.method for option in plan.options] == METHODS
        assert plan.method != "rayleigh_sommerfeld"
        assert "cheapest" in plan.why

    def test_wide_windows_are_not_for_the_direct_sum(self):
        """The spectral method is at least ten times faster for wide windows."""
        options = {
            option.method: option.seconds
            for option in optics.plan(self.PUPIL, WAVELENGTH, 150e-6, shape=(801, 801)).options
        }
        assert options["angular_spectrum"] < 0.1 * options["rayleigh_sommerfeld"]

    @pytest.mark.parametrize("method", ["far_field", "fresnel", "fraunhofer", "geometric", "hankel"])
    def test_grids_are_refused(self, method):
        with pytest.raises(AccuracyError, match=r"pixelated relief.*method='auto' or one of low_rank, angular"):
            self.seen(method, Circle())

    @pytest.mark.fast_cases(4)
    @pytest.mark.parametrize("method", METHODS)
    @pytest.mark.parametrize("name", ["radius", "n", "distance"])
    def test_derivatives(self, method, name):
        """The reference is a central difference, in forward mode."""
        import drjit as dr

        def total(values):
            pupil = Pupil(values["radius"], PixelRelief(RANDOM), n=values["n"])
            seen = optics.psf(
                pupil, [WAVELENGTH], values["distance"], dx=0.7e-6, shape=(15, 17), tolerance=1e-8, method=method,
                dtype="float64",
            )  # fmt: skip
            weight = np.random.default_rng(5).random((15, 17)).ravel()
            return dr.sum(seen.tensor.array * precision("float64").Float(weight)) * 1e-10

        values = {"radius": 12e-6, "n": 1.5, "distance": 120e-6}
        step = 1e-6 * values[name]
        high, low = (total({**values, name: values[name] + sign * step}).numpy()[0] for sign in (1, -1))
        x = precision("float64").Float(values[name])
        dr.enable_grad(x)
        out = total({**values, name: x})
        dr.forward(x)
        assert dr.grad(out).numpy()[0] == pytest.approx((high - low) / (2 * step), rel=1e-4)

    @pytest.mark.fast_cases(2)
    @pytest.mark.parametrize("method", METHODS)
    def test_derivatives_by_the_pixels(self, method):
        import drjit as dr

        def total(heights):
            seen = self.seen(method, Circle(), 1e-8, Pupil(12e-6, PixelRelief(heights)), shape=(15, 17))
            weight = np.random.default_rng(5).random((15, 17)).ravel()
            return dr.sum(seen.tensor.array * precision("float64").Float(weight)) * 1e-10

        heights = precision("float64").Tensor(RANDOM)
        dr.enable_grad(heights)
        dr.backward(total(heights))
        found = dr.grad(heights).numpy()
        for index in ((5, 6), (1, 3), (0, 0)):
            step = np.zeros_like(RANDOM)
            step[index] = 1e-11
            high, low = (total(RANDOM + sign * step).numpy()[0] for sign in (1, -1))
            assert found[index] == pytest.approx((high - low) / 2e-11, abs=1e-4 * np.abs(found).max())
        assert found[0, 0] == 0, "outside the circle"


class TestScatter:
    """Pixels scatter light to places that smooth glass does not reach."""

    def test_of_a_grating_it_is_the_order_that_the_share_reaches(self):
        """The two first orders of two levels have 0.811 of the light, the third orders 0.09, and the fifth 0.032."""
        count, periods = 128, 32
        heights = np.broadcast_to(np.arange(count) // 2 % 2 * WAVE / 2, (count, count))
        pupil = Pupil(1e-3, PixelRelief(heights), aperture=Slit(1.4, 1.4))
        for share, order in ((0.5, 1), (0.3, 3), (0.17, 5)):
            # Along y only the slit spreads light; along x half of the share counts.
            assert pupil.scatter(WAVELENGTH, share) * 2e-3 / periods == pytest.approx(order, abs=0.1)

    def test_smooth_and_level_reliefs_scatter_nothing(self):
        smooth = optics.BSplineRelief(np.random.default_rng(0).random((4, 4)) * 1e-6)
        assert Pupil(1e-3, smooth).scatter(WAVELENGTH, 0.01) == 0
        assert Pupil(1e-3, PixelRelief(smooth.control_points), n=1.0).scatter(WAVELENGTH, 0.01) == 0

    def test_an_eye_sees_by_pixels(self):
        """A lens of pixels 0.8 µm wide is compared with the ideal lens at an edge. The scattered light is missing on
        the bright side, and little of it reaches the dark side.
        """
        eye = optics.Eye(pupil=None, resolution=(9, 9), fov_deg=45, bands=1)
        focal_length = eye.sensor_distance
        x = centres(64, 25e-6)
        r2 = x**2 + x[:, None] ** 2
        # At the wavelength of the eye's one band.
        wave = eye.spectral_bands.wavelengths[0] / 0.5
        lens = PixelRelief(-r2 / (np.sqrt(r2 + focal_length**2) + focal_length) / 0.5 % wave)
        scene = np.zeros((1, 9, 9))
        scene[:, :, 5:] = 1
        seen = []
        for pupil in (Pupil(25e-6, lens), Pupil(25e-6, thin_lens_focal_length=focal_length)):
            seen.append(optics.Eye(pupil=pupil, resolution=(9, 9), fov_deg=45, bands=1).see(scene, 1)[:, 4])
        ours, ideal = seen
        np.testing.assert_allclose(ours[:, 5:], ideal[:, 5:], rtol=0.1)
        assert np.all(ours[:, 5:] < ideal[:, 5:])
        assert np.all(np.abs(ours[:, :4] - ideal[:, :4]) < 0.05 * ideal.max())

    def test_level_pixels_are_plain_glass(self):
        plain = optics.Eye(pupil=Pupil(25e-6), bands=1)
        level = optics.Eye(pupil=Pupil(25e-6, PixelRelief(np.full((5, 5), 3e-7))), bands=1)
        np.testing.assert_allclose(level.kernel(2)[:, 1:-1, 1:-1], plain.kernel(2), rtol=1e-2, atol=2e-6)
        assert level.psf().plan.method == plain.psf().plan.method
        in_the_opening = np.zeros((3, 3))
        in_the_opening[0, 0] = 1e-6
        assert Pupil(1e-3, PixelRelief(in_the_opening), aperture=Slit(0.2, 0.2)).scatter(WAVELENGTH, 0.01) == 0

    @pytest.mark.slow
    def test_light_that_goes_everywhere_is_seen_too(self):
        """Random heights scatter light up to the eye's rim. All cells together receive the light of a wide window."""
        noise = PixelRelief(np.random.default_rng(0).random((32, 32)) * 1e-6)
        eye = optics.Eye(pupil=Pupil(25e-6, noise), resolution=(9, 9), fov_deg=45, bands=1)
        kernel = eye.kernel(1)
        half = 1.2 * eye.sensor_distance
        side = 2 * round(half / 1e-6) + 1
        wide = optics.psf(eye.pupil, eye.spectral_bands.wavelengths, eye.sensor_distance, dx=1e-6, shape=(side, side))
        assert kernel.sum() == pytest.approx(wide.power[0], abs=0.02)
        assert kernel.shape[-1] * eye.receptor_pitch > 2 * eye.sensor_distance


@pytest.mark.parametrize(
    "heights",
    [np.zeros((2, 3)), np.zeros(4), np.zeros((0, 0)), np.full((2, 2), np.nan), 1j * np.ones((2, 2)), [["a"]], [[1], 2]],
)
def test_bad_heights_are_named(heights):
    with pytest.raises(ValueError, match="height"):
        PixelRelief(heights)


def test_a_flat_relief_is_known_to_be_flat_unless_it_may_change():
    """A flat relief is rotationally symmetric, except if derivatives with respect to its heights are requested."""
    assert PixelRelief(np.full((3, 3), 1e-7)).rotationally_symmetric
    assert not PixelRelief(np.diag([1e-7, 0.0, 0.0])).rotationally_symmetric
    types = precision("float64")
    samples = types.Tensor64(types.Float64(np.full(9, 1e-7)), (3, 3))
    dr.enable_grad(samples)
    assert not PixelRelief(samples).rotationally_symmetric
