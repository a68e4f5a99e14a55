"""Lenses and round apertures against closed forms and the exact integral, at every aperture and distance."""

import math

import numpy as np
import pytest

import optics
from validation import reference

WAVELENGTH = 550e-9


def lens(f_number, focal_length=300e-6):
    return optics.Pupil(focal_length / (2 * f_number), thin_lens_focal_length=focal_length)


def distances(result):
    return np.hypot(result.x[None, :], result.y[:, None])


def exact_psf(result):
    """The exact integral on the result's window."""
    r = distances(result)
    pupil = result.pupil
    focal_length = pupil.thin_lens_focal_length or math.inf
    profile = reference.ideal_lens_profile(
        float(r.max()), WAVELENGTH, pupil.aperture_radius, focal_length, result.sensor_distance
    )
    return np.abs(profile(r)) ** 2 / pupil.area


class TestExactIntegral:
    @pytest.mark.parametrize("f_number", [1.4, 2, 2.8, 4, 8, 16])
    def test_lens_in_focus(self, f_number):
        """The window is ±10 λ f/D. Seven digits are requested and obtained. Airy's pattern has errors of 2e-3 at f/16
        and 0.1 at f/1.4.
        """
        result = optics.psf(
            lens(f_number), [WAVELENGTH], 300e-6, dx=WAVELENGTH * f_number / 4, shape=(81, 81), tolerance=1e-7,
            dtype="float64",
        )  # fmt: skip
        exact = exact_psf(result)
        airy = reference.airy_psf(distances(result), WAVELENGTH, result.pupil.aperture_radius, 300e-6)
        assert reference.relative_l2(result.psf[0], exact) < result.plan.predicted_error <= 1e-7
        assert reference.relative_l2(airy, exact) > 1e-3

    @pytest.mark.parametrize("f_number", [1, 2, 8, 30])
    def test_middle_of_a_focus_alone(self, f_number):
        """All paths to the focus are equal, but the kernel falls towards the rim at the distance L: |U| = |1 - z/L -
        ikz ln(L/z)|.
        """
        focus = {"sensor_distance": 300e-6, "shape": (1, 1), "tolerance": 1e-8, "dtype": "float64"}
        result = optics.psf(lens(f_number), [WAVELENGTH], **focus)
        z, radius = 300e-6, result.pupil.radius
        slant = math.hypot(z, radius)
        field = 1 - z / slant - 2j * math.pi / WAVELENGTH * z * math.log(slant / z)
        assert result.psf[0, 0, 0] == pytest.approx(abs(field) ** 2 / result.pupil.area, rel=1e-8)

    @pytest.mark.fast_cases(1)
    @pytest.mark.parametrize(("dtype", "tolerance"), [("float32", 1e-4), ("float64", 1e-7)])
    def test_aperture_in_the_near_field(self, dtype, tolerance):
        """A radius of 50 µm at 200 µm gives the Fresnel number 23. The window of ±60 µm contains light and shadow."""
        result = optics.psf(
            optics.Pupil(50e-6), [WAVELENGTH], 200e-6, dx=1.5e-6, shape=(81, 81), tolerance=tolerance, dtype=dtype
        )
        exact = exact_psf(result)
        assert reference.relative_l2(result.psf[0], exact) < result.plan.predicted_error <= tolerance
        cut = exact[40, 40:]
        paraxial = reference.defocused_psf(result.x[40:], WAVELENGTH, 50e-6, math.inf, 200e-6)
        assert reference.relative_l2(paraxial, cut) > 1e-2

    @pytest.mark.parametrize("z", [5e-6, 17e-6, 40e-6, 300e-6, 2e-3])
    def test_axis_behind_an_aperture(self, z):
        """The distances extend from a quarter of the radius to the Fresnel number 0.36."""
        result = optics.psf(
            optics.Pupil(20e-6),
            [WAVELENGTH],
            z,
            dx=0.25e-6,
            shape=(9, 9),
            tolerance=1e-6,
            dtype="float64",
        )
        exact = reference.circular_aperture_on_axis(20e-6, z, WAVELENGTH)
        # the tolerance refers to the window's norm; on a dark axis it is a share of the surroundings
        bright = float(np.sqrt(np.mean(result.psf**2))) * result.pupil.area
        assert result.psf[0, 4, 4] * result.pupil.area == pytest.approx(exact, abs=5e-6 * bright)

    @pytest.mark.parametrize("pitch", [1e-3, 0.03])
    @pytest.mark.parametrize("f_number", [1.4, 2, 2.8, 8])
    def test_nodes_suffice_where_hardly_a_wave_turns(self, f_number, pitch):
        """All paths to a focus are equal, so nodes are needed for the obliquity alone. Two nodes are enough for the
        phase, but have an error of 6e-4 at f/2, which a check with equally few nodes could not detect.
        """
        result = optics.psf(
            lens(f_number), [WAVELENGTH], 300e-6, dx=pitch * WAVELENGTH * f_number, shape=(9, 9), tolerance=1e-7,
            dtype="float64", method="rayleigh_sommerfeld",
        )  # fmt: skip
        assert reference.relative_l2(result.psf[0], exact_psf(result)) < result.plan.predicted_error <= 1e-7

    @pytest.mark.parametrize("f_number", [0.7, 1, 2, 8])
    def test_peak_of_a_converging_wave(self, f_number):
        """The Strehl ratio is 1 at any aperture, and the peak is that of the oracle. Airy's peak is 25 % too high at
        f/0.7.
        """
        result = optics.psf(
            lens(f_number),
            [WAVELENGTH],
            300e-6,
            dx=0.2e-6,
            shape=(9, 9),
            tolerance=1e-6,
            dtype="float64",
        )
        peak = abs(reference.converging_wave_at_focus(result.pupil.aperture_radius, 300e-6, WAVELENGTH)) ** 2
        assert result.psf[0, 4, 4] * result.pupil.area == pytest.approx(peak, rel=2e-6)
        assert optics.strehl_ratio(result)[0] == pytest.approx(1, abs=2e-6)

    def test_finite_source(self):
        """The sensor is in front of, in and behind the image of a point at 500 µm. The reference is the exact
        integral.
        """
        pupil = lens(4, 200e-6)
        image = reference.thin_lens_image_distance(200e-6, 500e-6)
        for z in (0.9 * image, image, 1.1 * image):
            result = optics.psf(
                pupil,
                [WAVELENGTH],
                z,
                source_distance=500e-6,
                dx=0.7e-6,
                shape=(1, 21),
                tolerance=1e-6,
                dtype="float64",
            )
            field = reference.ideal_lens_field(
                np.abs(result.x), WAVELENGTH, pupil.aperture_radius, 200e-6, z, source_distance=500e-6
            )
            assert reference.relative_l2(result.psf[0, 0], np.abs(field) ** 2 / pupil.area) < 1e-6


class TestParaxialLimits:
    """Closed forms of paraxial theory are limits, from which exact results deviate in proportion to the aperture
    squared.
    """

    APERTURES = (0.05, 0.1, 0.2)

    def departure(self, defocus_waves, closed_form, fresnel_number=20.0):
        """Return deviations from the closed form. Fresnel number and defocus are constant, so the paraxial pattern is
        the same.
        """
        errors = []
        for aperture in self.APERTURES:
            f = fresnel_number * WAVELENGTH / aperture**2
            radius, z = aperture * f, f / (1 + 2 * defocus_waves / fresnel_number)
            pupil = optics.Pupil(radius, thin_lens_focal_length=f)
            dx = WAVELENGTH / aperture / 8
            result = optics.psf(pupil, [WAVELENGTH], z, dx=dx, shape=(33, 33), tolerance=1e-5, dtype="float64")
            errors.append(reference.relative_l2(result.psf[0], closed_form(distances(result), radius, f, z)))
        return errors

    def test_airy(self):
        errors = self.departure(0, lambda r, radius, f, z: reference.airy_psf(r, WAVELENGTH, radius, f))
        assert errors[0] < 2.5e-3
        assert reference.order_of_convergence(self.APERTURES, errors) == pytest.approx(2, abs=0.1)

    @pytest.mark.fast_cases(1)
    @pytest.mark.parametrize("waves", [-0.5, 0.7])
    def test_lommel(self, waves):
        def paraxial(r, radius, f, z):
            return reference.defocused_psf(r, WAVELENGTH, radius, f, z)

        errors = self.departure(waves, paraxial)
        assert errors[0] < 1e-2
        assert reference.order_of_convergence(self.APERTURES, errors) == pytest.approx(2, abs=0.15)
        # Debye's form, symmetric about the focus, is not that limit: it lacks the scale z/f
        debye = self.departure(
            waves,
            lambda r, radius, f, z: (
                np.pi
                * radius**2
                / (WAVELENGTH * f) ** 2
                * reference.lommel_intensity(4 * np.pi * waves, 2 * np.pi * radius * r / (WAVELENGTH * f))
            ),
        )
        assert debye[0] > 5 * errors[0]


class TestQuality:
    SLOW = optics.Pupil(0.5e-3, thin_lens_focal_length=50e-3)  # f/50, Fresnel number 9, NA 0.01: Airy to 1e-4

    def window(self, rings, samples_per_ring=8):
        """Return the PSF on a window of ± `rings` λ f/D."""
        n = 2 * rings * samples_per_ring + 1
        return optics.psf(
            self.SLOW, [WAVELENGTH], 50e-3, dx=50 * WAVELENGTH / samples_per_ring, shape=(n, n), tolerance=1e-4
        )

    def test_mtf_is_that_of_a_disk_as_the_window_grows(self):
        """A window of W rings misses 2/(π² W) of the light. Relative to the light in the window, all contrasts would be
        too high by this factor. Relative to all light that arrives, only the effect of the window's sharp edge remains.
        The missing light is the predicted error.
        """
        f = np.linspace(0.1, 0.9, 9) / (50 * WAVELENGTH)
        expected = reference.circular_mtf(f, WAVELENGTH, 0.5e-3, 50e-3)
        rings, lifted, errors, predicted = (4, 8, 16), [], [], []
        for count in rings:
            result = self.window(count, 4)
            transfer = optics.mtf(result, tolerance=1)  # for the window as it is
            contrast = transfer.profile(f)[0]
            lifted.append(np.abs(contrast / result.power[0] - expected).mean())
            errors.append(np.abs(contrast - expected))
            predicted.append(transfer.predicted_error[0])
        assert reference.order_of_convergence(rings, lifted) == pytest.approx(-1, abs=0.25)
        assert reference.order_of_convergence(rings, predicted) == pytest.approx(-1, abs=0.25)
        # The order is high because frequencies are evaluated exactly; on straight lines between grid frequencies it was
        # -1.2.
        assert reference.order_of_convergence(rings, [error.mean() for error in errors]) < -2
        assert all(error.max() < bound < 0.05 for error, bound in zip(errors, predicted, strict=True))
        assert errors[-1].mean() < 1e-4
        wrong = reference.circular_mtf(1.05 * f, WAVELENGTH, 0.5e-3, 50e-3)
        assert np.abs(wrong - expected).mean() > 10 * errors[-1].mean()

    @pytest.mark.parametrize("rings", [8, 32])
    def test_mtf_meets_its_tolerance_whatever_the_window(self, rings):
        f = np.linspace(0.1, 0.9, 9) / (50 * WAVELENGTH)
        transfer = optics.mtf(self.window(rings, 4), tolerance=0.02)
        expected = reference.circular_mtf(f, WAVELENGTH, 0.5e-3, 50e-3)
        assert np.abs(transfer.profile(f)[0] - expected).max() < transfer.predicted_error[0] < 0.02

    def test_encircled_energy_is_airys(self):
        """The energy agrees at any pitch, except for Airy's own error of 2e-5. A sum over four cells per ring would
        have a larger error.
        """
        zeros = reference.AIRY_ZEROS[:4] / np.pi * 50 * WAVELENGTH
        expected = reference.airy_encircled_energy(zeros, WAVELENGTH, 0.5e-3, 50e-3)
        for count in (4, 8, 16):
            (energy,) = optics.encircled_energy(self.window(5, count), zeros)
            assert np.abs(energy - expected).max() < 5e-5
        coarse = self.window(5, 4)
        clipped = np.clip((zeros[:, None, None] - distances(coarse)) / coarse.dx + 0.5, 0, 1)
        assert np.abs((clipped * coarse.psf[0]).sum(axis=(1, 2)) * coarse.dx**2 - expected).max() > 2e-4
        assert expected[0] == pytest.approx(0.8378, abs=1e-4)
        assert abs(reference.airy_encircled_energy(zeros[0] / 2, WAVELENGTH, 0.5e-3, 50e-3) - expected[0]) > 0.2


class TestOrdersOfConvergence:
    """Errors of a hard edge on a grid of N samples fall like N^-1 to N^-1.5. Errors of the soft edge of `psf` stay
    below the tolerance.
    """

    RADIUS, Z = 20e-6, 60e-6

    def exact(self, r):
        return reference.ideal_lens_profile(float(r.max()), WAVELENGTH, self.RADIUS, distance=self.Z)(r)

    def test_sampled_edge(self):
        samples, errors = (64, 128, 256), []
        for n in samples:
            dx = 2 * self.RADIUS / n
            x = (np.arange(n + 9) - (n + 9) // 2) * dx
            disk = (np.hypot(x[None, :], x[:, None]) <= self.RADIUS).astype(float)
            out = optics.propagate(
                disk, dx=dx, wavelength=WAVELENGTH, distance=self.Z, out_dx=1e-6, out_shape=(25, 25), tolerance=1e-2,
                dtype="float64",
            )  # fmt: skip
            r = np.hypot(*np.meshgrid(*[np.arange(-12, 13) * 1e-6] * 2))
            errors.append(reference.relative_l2(np.abs(out.u) ** 2, np.abs(self.exact(r)) ** 2))
        assert -2.2 < reference.order_of_convergence(samples, errors) < -0.7
        assert errors[-1] > 1e-4

    @pytest.mark.parametrize("method", ["angular_spectrum", "rayleigh_sommerfeld", "auto"])
    def test_soft_edge(self, method):
        """Five additional digits need less than four times the number of samples across."""
        samples, errors = [], []
        for tolerance in (1e-3, 1e-5, 1e-8):
            result = optics.psf(
                optics.Pupil(self.RADIUS), [WAVELENGTH], self.Z, dx=1e-6, shape=(25, 25), tolerance=tolerance,
                method=method, dtype="float64",
            )  # fmt: skip
            exact = np.abs(self.exact(distances(result))) ** 2 / result.pupil.area
            errors.append(reference.relative_l2(result.psf[0], exact))
            samples.append(max(result.plan.samples))
            assert errors[-1] < tolerance
        assert samples[-1] < 4 * samples[0]
