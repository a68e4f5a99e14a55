"""The eye: orientation, throughput, kernels against finer PSFs and geometric shadows, and points seen by the right
receptor."""

import math

import numpy as np
import pytest

from optics import AccuracyError, BSplineRelief, Eye, Pupil
from optics.spectra.bands import daylight

S = 4  # cells per receptor


def prism(radius, sine, axis=1):
    ramp = sine / 0.5 * (2 * np.arange(4) - 3) * radius
    return BSplineRelief(np.broadcast_to(ramp if axis == 1 else ramp[:, None], (4, 4)))


def white(eye, cells):
    return np.broadcast_to(daylight(eye.spectral_bands.wavelengths)[:, None, None], (eye.bands, *cells))


def centroid(kernel):
    """Return the centroid of a kernel, (row, column), in cells from the middle of the array."""
    rows, columns = (np.arange(n) - n // 2 for n in kernel.shape)
    total = kernel.sum()
    return (kernel.sum(axis=1) @ rows) / total, (kernel.sum(axis=0) @ columns) / total


class TestPerfectLens:
    def test_kernel_is_one(self):
        np.testing.assert_array_equal(Eye(bands=3).kernel(S), np.ones((3, 1, 1)))

    def test_white_in_daylight_gives_one_in_every_channel(self):
        eye = Eye(resolution=(5, 8))
        signal = eye.see(white(eye, (20, 32)), S)
        assert signal.shape == (eye.channels, 5, 8) == (3, 5, 8)
        assert signal.dtype == np.float32
        np.testing.assert_allclose(signal, 1, rtol=1e-6)
        mosaic = Eye(resolution=(5, 8), receptors=eye.receptors.arranged([[0, 1], [2, 1]]))
        assert mosaic.see(white(mosaic, (20, 32)), S).shape == (mosaic.channels, 5, 8) == (1, 5, 8)

    def test_a_point_of_light_falls_on_the_receptor_that_looks_at_it(self):
        eye = Eye(resolution=(6, 10))
        scene = np.zeros((4, 24 + 8, 40 + 8), dtype=np.float32)
        scene[:, 4 + S * 1 + 2, 4 + S * 7 + 1] = 1  # row 1 from the top, column 7 from the left
        signal = eye.see(scene, S)[0]
        assert np.unravel_index(np.argmax(signal), signal.shape) == (1, 7)
        assert np.count_nonzero(signal) == 1

    def test_psf_holds_all_power(self):
        result = Eye().psf()
        np.testing.assert_allclose(result.power, 1)
        assert result.plan.method == "perfect_lens"


def test_geometry():
    eye = Eye(Pupil(50e-6), resolution=(10, 20), fov_deg=60)
    assert eye.sensor_distance == pytest.approx(200e-6 / (2 * math.tan(math.radians(30))))
    assert eye.receptor_pitch == pytest.approx(10e-6)
    assert eye.relative_aperture == pytest.approx(0.5)
    assert eye.throughput == pytest.approx(0.25)


class TestOrientation:
    """Rows and columns of the retina ascend with y and x. This is the order of the visual field, from the top left."""

    @pytest.mark.parametrize("axis", [0, 1])
    def test_prism_shifts_the_scene_away_from_its_thick_side(self, axis):
        """Light that is deflected towards +x lands at +x, on the owner's left, and therefore appears on the right."""
        eye = Eye(Pupil(15e-6, prism(15e-6, 0.15, axis)), bands=1)
        shift = eye.sensor_distance * math.tan(math.asin(0.15)) / (eye.receptor_pitch / S)
        expected = (shift, 0) if axis == 0 else (0, shift)
        assert centroid(eye.kernel(S)[0]) == pytest.approx(expected, abs=0.5)

    def test_prism_makes_the_right_receptor_see_a_point(self):
        eye = Eye(Pupil(15e-6, prism(15e-6, 0.15)), resolution=(7, 15), bands=1)
        scene = np.zeros((1, 7 * S, 15 * S), dtype=np.float32)
        scene[0, 14, 40] = 1  # receptor (3, 10)
        seen = eye.see(scene, S)[0]
        column = (seen.sum(axis=0) @ np.arange(15)) / seen.sum()
        shift = eye.sensor_distance * math.tan(math.asin(0.15)) / eye.receptor_pitch
        assert column == pytest.approx(40.5 / S - 0.5 + shift, abs=0.15)

    def test_kernel_has_the_order_of_the_psf(self):
        points = np.random.default_rng(3).random((4, 4)) * 20e-6
        eye = Eye(Pupil(20e-6, BSplineRelief(points)), bands=1)
        image = eye.psf().psf[0]
        x = eye.psf().x
        seen = centroid(eye.kernel(S)[0])
        on_retina = image.sum(axis=1) @ x / image.sum(), image.sum(axis=0) @ x / image.sum()
        cell = eye.receptor_pitch / S
        assert np.hypot(*seen) > 0.5
        assert seen == pytest.approx((on_retina[0] / cell, on_retina[1] / cell), abs=0.05)


class TestKernel:
    def test_lens_focuses_into_the_centre(self):
        eye = Eye(Pupil(50e-6, thin_lens_focal_length=Eye().sensor_distance))
        kernel = eye.kernel(S)
        assert kernel.shape[0] == 4
        assert kernel.shape[1] % 2 == kernel.shape[2] % 2 == 1
        middle = kernel.shape[1] // 2
        np.testing.assert_allclose(
            kernel[:, middle - 1 : middle + 2, middle - 1 : middle + 2].sum(axis=(1, 2)), 0.95, atol=0.02
        )
        assert ((kernel.sum(axis=(1, 2)) > 0.99) & (kernel.sum(axis=(1, 2)) < 1.001)).all()

    @pytest.mark.parametrize("relative_aperture", [0.3, 1.0])
    def test_open_pupil_casts_its_geometric_shadow(self, relative_aperture):
        """Without glass the kernel is the pupil's disk, blurred by diffraction only near its edge."""
        eye = Eye(Pupil(relative_aperture * 100e-6), resolution=(20, 20), fov_deg=80, bands=1)
        kernel = eye.kernel(2)[0]
        cell = eye.receptor_pitch / 2
        x = (np.arange(len(kernel)) - len(kernel) // 2) * cell
        r = np.hypot(x[:, None], x)
        radius = relative_aperture * 100e-6
        fringe = math.sqrt(450e-9 * eye.sensor_distance)
        inside, outside = r < radius - 2.5 * fringe - cell, r > radius + 2.5 * fringe + cell
        assert kernel[inside].mean() == pytest.approx(cell**2 / (math.pi * radius**2), rel=0.04)
        assert kernel[outside].sum() < 0.03
        assert 0.99 < kernel.sum() < 1.001

    def test_strong_relief_follows_its_rays(self):
        """Waves and rays through 60 µm of random glass reach the same place, to within the width of diffraction."""
        pupil = Pupil(60e-6, BSplineRelief(np.random.default_rng(5).random((4, 4)) * 60e-6), n=1.6)
        eye = Eye(pupil, bands=1)
        kernel = eye.kernel(2)[0].astype(np.float64)
        wavelength = float(eye.spectral_bands.wavelengths[0])
        from optics import PointSource

        x, y = pupil.slopes(wavelength, PointSource()).rays(eye.sensor_distance, 1.0)
        cell = eye.receptor_pitch / 2
        edges = (np.arange(len(kernel) + 1) - len(kernel) / 2) * cell
        rays = np.histogram2d(y, x, bins=(edges, edges))[0] / x.size
        for wave, ray in ((kernel.sum(axis=0), rays.sum(axis=0)), (kernel.sum(axis=1), rays.sum(axis=1))):
            centres = (edges[1:] + edges[:-1]) / 2
            mean, spread = wave @ centres / wave.sum(), ray @ centres / ray.sum()
            assert mean == pytest.approx(spread, abs=0.3 * cell)
            assert np.abs(np.cumsum(wave) - np.cumsum(ray)).max() < 0.05  # Kolmogorov's distance

    @pytest.mark.fast_cases(2)
    @pytest.mark.parametrize("seed", range(4))
    def test_cells_hold_the_integral_of_a_finer_psf(self, seed):
        import optics

        rng = np.random.default_rng(seed)
        eye = Eye(
            Pupil(rng.uniform(10, 30) * 1e-6, BSplineRelief(rng.random((4, 4)) * 20e-6), n=rng.uniform(1, 2)),
            resolution=(9, 9),
            fov_deg=rng.uniform(40, 70),
            bands=1,
        )
        kernel = eye.kernel(2)[0]
        n, cell, m = len(kernel), eye.receptor_pitch / 2, 15
        fine = optics.psf(
            eye.pupil,
            eye.spectral_bands.wavelengths,
            eye.sensor_distance,
            dx=cell / m,
            shape=(n * m, n * m),
            tolerance=2e-3,
        )
        summed = fine.psf[0].reshape(n, m, n, m).sum(axis=(1, 3)) * (cell / m) ** 2
        assert np.linalg.norm(kernel - summed) < eye.tolerance * np.linalg.norm(summed)

    def test_near_objects_blur(self):
        eye = Eye(Pupil(50e-6, thin_lens_focal_length=Eye().sensor_distance), bands=1)
        assert eye.kernel(S, z=1e-3).max() < 0.5 * eye.kernel(S).max()

    def test_index_of_air_makes_the_relief_vanish(self):
        relief = BSplineRelief(np.random.default_rng(0).random((4, 4)) * 60e-6)
        np.testing.assert_array_equal(Eye(Pupil(40e-6, relief, n=1.0)).kernel(2), Eye(Pupil(40e-6)).kernel(2))

    def test_narrow_views_of_strong_glass_are_refused_with_the_reason(self):
        relief = BSplineRelief(np.random.default_rng(0).random((4, 4)) * 60e-6)
        eye = Eye(Pupil(20e-6, relief, n=2.0), resolution=(25, 25), fov_deg=2)
        with pytest.raises(AccuracyError, match="cells"):
            eye.kernel(4)


class TestSee:
    def test_light_falls_with_the_aperture_squared(self):
        """A wide white field gives the throughput a², minus the kernel's loss."""
        signals = []
        for radius in (50e-6, 25e-6):
            eye = Eye(Pupil(radius, thin_lens_focal_length=Eye().sensor_distance), resolution=(3, 3))
            signals.append(eye.see(white(eye, (12 + 200, 12 + 200)), S)[:, 1, 1])
            np.testing.assert_allclose(signals[-1], eye.throughput, rtol=0.01)
        np.testing.assert_allclose(signals[0] / signals[1], 4, rtol=0.01)

    def test_noise_does_not_shrink_with_the_light(self):
        eye = Eye(Pupil(10e-6, thin_lens_focal_length=Eye().sensor_distance), resolution=(30, 30), noise_sigma=0.1)
        scene = white(eye, (120, 120))
        noise = eye.see(scene, S, np.random.default_rng(0)) - eye.see(scene, S)
        assert noise.std() == pytest.approx(0.1, rel=0.05)
        assert noise.mean() == pytest.approx(0, abs=0.01)
        np.testing.assert_array_equal(eye.see(scene, S, np.random.default_rng(0)) - eye.see(scene, S), noise)

    def test_blur_averages(self):
        """Stripes finer than the kernel vanish; the perfect lens preserves them."""
        blind = Eye(Pupil(80e-6), resolution=(16, 16))
        scene = white(blind, (64, 64)) * (np.arange(64) // S % 2)
        assert np.ptp(Eye(resolution=(16, 16)).see(scene, S)[0, 8]) == pytest.approx(1, rel=1e-5)
        assert np.ptp(blind.see(scene, S)[0, 8, 6:10]) < 0.1 * blind.throughput

    @pytest.mark.parametrize("shape", [(4, 59, 60), (4, 60, 61), (3, 60, 60), (60, 60), (4, 40, 60)])
    def test_scenes_that_do_not_fit(self, shape):
        with pytest.raises(ValueError, match=r"radiance has"):
            Eye().see(np.zeros(shape), S)

    def test_scenes_with_nan(self):
        with pytest.raises(ValueError, match="radiance holds NaN"):
            Eye().see(np.full((4, 60, 60), np.nan), S)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"resolution": (0, 5)}, r"resolution = \(0, 5\)"),
        ({"resolution": 15}, "resolution = 15"),
        ({"fov_deg": 0.0}, "fov_deg = 0.0: must lie in"),
        ({"fov_deg": 180.0}, "fov_deg"),
        ({"fov_deg": math.nan}, "fov_deg = nan"),
        ({"sensor_width": -1e-4}, "sensor_width"),
        ({"bands": 0}, "bands"),
        ({"noise_sigma": -0.1}, "noise_sigma"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"pupil": Pupil(101e-6)}, r"pupil\.aperture_radius = 0\.000101: must be at most sensor_width / 2"),
    ],
)
def test_bad_eyes(arguments, message):
    with pytest.raises(ValueError, match=message):
        Eye(**arguments)


@pytest.mark.parametrize("samples", [0, -1, 1.5, 65])
def test_bad_samples_per_receptor(samples):
    with pytest.raises(ValueError, match="samples_per_receptor"):
        Eye().kernel(samples)


def test_bad_distance():
    with pytest.raises(ValueError, match=r"z = -1\.0"):
        Eye().kernel(4, z=-1.0)


class TestBands:
    """bands="auto" is compared with the same eye with 64 bands."""

    @pytest.mark.fast_cases(1)
    @pytest.mark.parametrize(("tolerance", "seed"), [(0.1, 0), (0.05, 1)])
    def test_signals_are_those_of_64_bands(self, tolerance, seed):
        """The scene consists of random patches with smooth spectra. The lens is random glass, whose speckle differs
        between bands.
        """
        rng = np.random.default_rng(seed)
        pupil = Pupil(15e-6, BSplineRelief(rng.random((4, 4)) * 10e-6))
        few, many = (Eye(pupil, (6, 6), bands=bands, tolerance=tolerance, noise_sigma=0) for bands in ("auto", 64))
        assert 1 < few.bands < 64
        phase = rng.uniform(0, 2 * np.pi, (28, 28))

        def seen(eye):
            nm = eye.spectral_bands.wavelengths[:, None, None] * 1e9
            reflectance = (1 + np.cos(2 * np.pi * nm / 300 + phase)) / 2
            return eye.see(reflectance * daylight(nm[:, 0, 0] * 1e-9)[:, None, None], 2) / eye.throughput

        assert np.abs(seen(few) - seen(many)).max() <= tolerance

    def test_a_finer_tolerance_takes_more_bands(self):
        assert Eye(bands="auto", tolerance=0.1).bands < Eye(bands="auto", tolerance=0.003).bands

    @pytest.mark.parametrize("bands", ["all", 0, 2.5, None, math.nan])
    def test_bad_bands(self, bands):
        with pytest.raises(ValueError, match=r"bands = .*must be a whole number in \[1, 64\]"):
            Eye(bands=bands)


class TestDtype:
    def test_float64_carries_what_float32_cannot(self):
        lens = Pupil(20e-6, thin_lens_focal_length=Eye().sensor_distance)
        single, double = (Eye(lens, bands=1, tolerance=1e-3, dtype=dtype).kernel(S) for dtype in ("float32", "float64"))
        assert (single.dtype, double.dtype) == (np.float32, np.float64)
        np.testing.assert_allclose(single, double, atol=1e-5 * double.max())
        with pytest.raises(AccuracyError, match="float32"):
            Eye(lens, bands=1, tolerance=3e-6).kernel(S)

    def test_bad_dtype(self):
        with pytest.raises(ValueError, match="dtype = 'float16'"):
            Eye(dtype="float16")


def test_an_annulus_lets_in_what_is_open():
    from optics import Annulus

    eye = Eye(Pupil(50e-6, aperture=Annulus(0.5)))
    assert eye.throughput == pytest.approx(0.25 * 0.75)
