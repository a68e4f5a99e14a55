"""Strehl ratios of aberrated pupils: the relief carries the aberration, and the oracle gives the loss.

f/20: the exact integral's weights differ from the paraxial ones by NA², 6e-4.
"""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import optics
from validation import reference

WAVELENGTH, RADIUS, FOCAL_LENGTH, INDEX = 550e-9, 50e-6, 2e-3, 1.5
SAMPLES = 64


def disk():
    x = (np.arange(SAMPLES) + 0.5) * 2 / SAMPLES - 1
    return np.hypot(x[None, :], x[:, None]), np.arctan2(x[:, None], x[None, :])


def aberrated(wavefront, **changes):
    """Return a pupil whose glass adds the phase `wavefront` [waves]."""
    settings = {"n": INDEX, "thin_lens_focal_length": FOCAL_LENGTH} | changes
    return optics.Pupil(RADIUS, wavefront * WAVELENGTH / (INDEX - 1), **settings)


def on_axis(pupil, distance=FOCAL_LENGTH):
    """Return the PSF on the axis, relative to that without aberration. It may be higher at another point."""
    result = optics.psf(pupil, [WAVELENGTH], distance, dx=1e-6, shape=(1, 1), tolerance=1e-5, dtype="float64")
    return float(result.psf[0, 0, 0]) * pupil.area / abs(converging(pupil.aperture_radius, distance)) ** 2


def converging(radius, distance):
    return reference.converging_wave_at_focus(radius, distance, WAVELENGTH)


RHO, THETA = disk()
WAVEFRONTS = {
    "defocus": (lambda w: w * RHO**2, reference.strehl_defocus),
    "spherical": (lambda w: w * RHO**4, reference.strehl_spherical),
    "balanced spherical": (lambda w: w * (RHO**4 - RHO**2), lambda w: reference.strehl_spherical(w, -w)),
    "coma": (lambda w: w * RHO**3 * np.cos(THETA), reference.strehl_coma),
    "balanced coma": (
        lambda w: w * (RHO**3 - 2 * RHO / 3) * np.cos(THETA),
        lambda w: reference.strehl_coma(w, -2 * w / 3),
    ),
    "astigmatism": (lambda w: w * (RHO * np.cos(THETA)) ** 2, reference.strehl_astigmatism),
    "balanced astigmatism": (
        lambda w: w * RHO**2 * (np.cos(THETA) ** 2 - 0.5),
        lambda w: reference.strehl_astigmatism(w, -w / 2),
    ),
}


class TestStrehlRatio:
    @pytest.mark.parametrize("name", WAVEFRONTS)
    @pytest.mark.parametrize("sigma", [0.05, 0.15])
    def test_closed_forms(self, name, sigma):
        wavefront, law = WAVEFRONTS[name]
        w = sigma / reference.RMS_PER_WAVE[name]
        expected = law(w)
        got = on_axis(aberrated(wavefront(w)))
        assert got == pytest.approx(expected, abs=1e-3)
        assert got == pytest.approx(reference.marechal_strehl(sigma), abs=0.003 if sigma < 0.1 else 0.08)
        # an RMS off by a tenth, or a wave taken for a radian, gives a different result
        assert abs(law(1.1 * w) - expected) > 0.015
        assert abs(law(w / (2 * np.pi)) - expected) > 0.09

    @pytest.mark.parametrize("sigma", [0.05, 0.15])
    def test_peak_of_coma_lies_where_a_tilt_balances_it(self, sigma):
        """`strehl_ratio` refers to the brightest place, wherever samples lie: the maximum of the closed form over all
        tilts. The value on the axis is lower, and a window that ends there is refused."""
        w = sigma / reference.RMS_PER_WAVE["coma"]
        best = minimize_scalar(lambda tilt: -reference.strehl_coma(w, tilt), bounds=(-w, 0), options={"xatol": 1e-6})
        pupil = aberrated(WAVEFRONTS["coma"][0](w))
        result = optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH, dx=5e-6, shape=(21, 21), tolerance=1e-4, dtype="float64")
        (got,), (error,) = optics.strehl_ratio(result, with_error=True)
        assert got == pytest.approx(-best.fun, abs=1e-3)
        assert error < 1e-3
        assert reference.strehl_coma(w) < 0.93 * got
        one = optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH, dx=1e-6, shape=(1, 1))
        with pytest.raises(optics.AccuracyError, match="increases towards"):
            optics.strehl_ratio(one)

    @pytest.mark.parametrize("j", range(4, 16))
    def test_zernikes_cost_by_their_rms_alone(self, j):
        """For σ = 0.04 waves of any Zernike mode, the Strehl ratio is exp(-(2πσ)²), except for a third moment of order
        σ³.
        """
        got = on_axis(aberrated(0.04 * reference.zernike(j, RHO, THETA)))
        assert got == pytest.approx(reference.marechal_strehl(0.04), abs=3e-3)

    def test_balance_has_a_sign(self):
        """W040 with W020 = -W040 is balanced; +W040 instead gives the worst case."""
        right, wrong = (on_axis(aberrated(1.5 * (RHO**4 + sign * RHO**2))) for sign in (-1, 1))
        assert right == pytest.approx(reference.strehl_spherical(1.5, -1.5), abs=2e-3)
        assert wrong == pytest.approx(reference.strehl_spherical(1.5, 1.5), abs=2e-3)
        assert right > 20 * wrong

    def test_sensor_balances_what_glass_adds(self):
        """Glass that is thicker at the rim delays light there. A positive W diverges, so the sensor has to move back,
        not forward. Paraxially, the sensor at z adds W020 = R² (1/z - 1/f) / (2λ).
        """
        w = 1.0
        shifted = {}
        for sign in (-1, 1):
            z = 1 / (1 / FOCAL_LENGTH + sign * 2 * WAVELENGTH * w / RADIUS**2)
            shifted[sign] = on_axis(aberrated(w * RHO**4), z)
        assert shifted[-1] == pytest.approx(reference.strehl_spherical(w, -w), abs=5e-3)
        assert shifted[1] == pytest.approx(reference.strehl_spherical(w, w), abs=5e-3)

    @pytest.mark.parametrize("waves", [-0.8, -0.3, 0.3, 0.8])
    def test_defocus_by_lens_relief_or_sensor_is_the_same(self, waves):
        """Three kinds of defocus give the same sinc². The path in glass is (n - 1) h, so the test covers n, λ and h."""
        expected = reference.strehl_defocus(waves)
        curvature = waves * 2 * WAVELENGTH / RADIUS**2
        by_relief = on_axis(aberrated(waves * RHO**2))
        by_lens = on_axis(optics.Pupil(RADIUS, thin_lens_focal_length=1 / (1 / FOCAL_LENGTH - curvature)))
        by_sensor = on_axis(
            optics.Pupil(RADIUS, thin_lens_focal_length=FOCAL_LENGTH), 1 / (1 / FOCAL_LENGTH + curvature)
        )
        assert by_relief == pytest.approx(expected, abs=1e-3)
        assert by_lens == pytest.approx(expected, abs=1e-3)
        assert by_sensor == pytest.approx(expected, abs=1e-3)

    def test_departure_from_the_closed_form_falls_like_the_aperture_squared(self):
        """The defocus is half a wave, and the Fresnel number is constant."""
        apertures, errors = (0.05, 0.1, 0.2), []
        for aperture in apertures:
            f = 20 * WAVELENGTH / aperture**2
            radius = aperture * f
            bent = 1 / (1 / f - 2 * 0.5 * WAVELENGTH / radius**2)
            pupil = optics.Pupil(radius, thin_lens_focal_length=bent)
            result = optics.psf(pupil, [WAVELENGTH], f, dx=1e-7, shape=(1, 1), tolerance=1e-6, dtype="float64")
            errors.append(abs(optics.strehl_ratio(result)[0] - reference.strehl_defocus(0.5)))
        assert errors[-1] < 0.05
        assert reference.order_of_convergence(apertures, errors) > 1.8

    def test_samples_of_the_relief_converge_with_the_fourth_power(self):
        """An asymmetric wavefront of half a wave is interpolated by cubic splines from 8, 16 and 32 samples across."""

        def strehl(count):
            x = (np.arange(count) + 0.5) * 2 / count - 1
            return on_axis(aberrated(0.5 * np.sin(3 * x)[None, :] * (x[None, :] ** 2 + x[:, None] ** 2)))

        counts = (8, 16, 32)
        errors = np.abs(np.array([strehl(count) for count in counts]) - strehl(256))
        assert reference.order_of_convergence(counts, errors) < -3.4
