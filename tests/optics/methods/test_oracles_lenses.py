"""Positions of foci: over wavelength, source distance, and the radius of a pinhole."""

import math

import numpy as np
import pytest

import optics
from validation import reference

DESIGN = 550e-9


def peak(pupil, wavelength, z, **options):
    """Return the PSF on the axis [1/m²]."""
    settings = {"dx": 1e-6, "shape": (1, 1), "tolerance": 1e-4, "dtype": "float64"} | options
    return float(optics.psf(pupil, [wavelength], z, **settings).psf[0, 0, 0])


class TestChromaticFocus:
    RADIUS, FOCAL_LENGTH = 60e-6, 2e-3  # f/17: paraxial up to NA², 1e-3

    @pytest.mark.parametrize("wavelength", [420e-9, 550e-9, 680e-9])
    def test_refractive_relief(self, wavelength):
        """For dispersive glass, 1/f is proportional to n(λ) - 1. With this f(λ), the PSF on the axis through focus is
        Fresnel's closed form.
        """
        glass = optics.RefractiveIndex.from_abbe(1.62, 20.0)
        curvature_radius = self.FOCAL_LENGTH * 0.62
        relief = optics.BSplineRelief.paraboloid(2e-6, 1 / curvature_radius, self.RADIUS)
        pupil = optics.Pupil(self.RADIUS, relief, n=glass)
        index = 1.62 + glass.b * (1 / wavelength**2 - 1 / 587.562e-9**2)  # Cauchy's term, written out
        f = reference.refractive_focal_length(curvature_radius, index)
        distances = f * np.array([0.8, 0.95, 1.0, 1.15, 1.4])
        got = np.array([peak(pupil, wavelength, z) for z in distances])

        def expected(focal_length):
            return np.array(
                [float(reference.defocused_psf(0.0, wavelength, self.RADIUS, focal_length, z)) for z in distances]
            )

        np.testing.assert_allclose(got, expected(f), atol=3e-3 * got.max())
        undispersed = reference.refractive_focal_length(curvature_radius, 1.62)
        diffractive = reference.diffractive_focal_length(undispersed, 587.562e-9, wavelength)
        if wavelength != DESIGN:
            assert np.abs(expected(undispersed) - got).max() > 0.02 * got.max()
        assert np.abs(expected(diffractive) - got).max() > 0.05 * got.max()

    @pytest.mark.parametrize("wavelength", [440e-9, 550e-9, 660e-9])
    def test_diffractive_lens(self, wavelength):
        """A lens of five zones, each one wave high, has its focus at f0 λ0/λ with the efficiency sinc²(λ0/λ - 1).
        Sampling of the edges of zones causes an error of 2 % here, of order 1 to 2 in the pitch.
        """
        f0, zones = 1e-3, 5
        radius = math.sqrt(2 * zones * DESIGN * f0)
        focus, psf = reference.kinoform_on_axis(wavelength, DESIGN, radius, f0)
        errors, pitches = [], (radius / 40, radius / 80, radius / 160)
        for dx in pitches:
            on_axis = self.diffractive_axis(wavelength, radius, f0, dx, focus)
            errors.append(abs(on_axis / psf - 1))
        assert errors[-1] < 0.02
        if wavelength != DESIGN:
            at_design_focus = self.diffractive_axis(wavelength, radius, f0, dx, f0)
            assert at_design_focus < 0.8 * psf

    def diffractive_axis(self, wavelength, radius, f0, dx, z):
        n = 2 * int(radius / dx) + 9
        x = (np.arange(n) - n // 2) * dx
        r2 = x[None, :] ** 2 + x[:, None] ** 2
        path = DESIGN * np.mod(-r2 / (2 * DESIGN * f0), 1)  # optical path of the glass, less than a wave
        inside = np.clip((radius - np.sqrt(r2)) / dx + 0.5, 0, 1)
        u = inside * np.exp(2j * np.pi / wavelength * path)
        out = optics.propagate(
            u, dx=dx, wavelength=wavelength, distance=z, out_dx=1e-6, out_shape=(9, 9), tolerance=1e-3
        )
        return float(np.abs(out.u[4, 4]) ** 2 / (np.pi * radius**2))

    def test_the_two_shift_in_opposite_directions(self):
        """Blue light focuses nearer behind glass, and farther behind zones. The focus is where the PSF is highest."""
        glass = optics.RefractiveIndex.from_abbe(1.62, 20.0)
        assert glass.at(440e-9) > glass.at(660e-9)
        refractive = [reference.refractive_focal_length(1.24e-3, glass.at(w)) for w in (440e-9, 660e-9)]
        diffractive = [reference.diffractive_focal_length(2e-3, DESIGN, w) for w in (440e-9, 660e-9)]
        assert refractive[0] < refractive[1]
        assert diffractive[0] > diffractive[1]
        relief = optics.BSplineRelief.paraboloid(2e-6, 1 / 1.24e-3, 150e-6)  # Fresnel number 20: a sharp focus
        pupil = optics.Pupil(150e-6, relief, n=glass)
        for wavelength, f in zip((440e-9, 660e-9), refractive, strict=True):
            near, at, far = (peak(pupil, wavelength, z * f) for z in (0.97, 0.999, 1.03))
            assert at > 1.05 * max(near, far)


class TestThinLens:
    @pytest.mark.parametrize("conjugate", [1.5, 2.0, 4.0])
    def test_image_of_a_finite_source_is_airys(self, conjugate):
        """The PSF on the image plane of a lens of f/17 is Airy's pattern for the image distance, except for errors of
        order NA².
        """
        f, radius = 2e-3, 60e-6
        pupil = optics.Pupil(radius, thin_lens_focal_length=f)
        source = conjugate * f
        image = reference.thin_lens_image_distance(f, source)
        settings = {"source_distance": source, "dx": 0.15 * DESIGN * image / radius, "shape": (33, 33)}
        result = optics.psf(pupil, [DESIGN], image, **settings, tolerance=1e-4)
        r = np.hypot(result.x[None, :], result.y[:, None])
        assert reference.relative_l2(result.psf[0], reference.airy_psf(r, DESIGN, radius, image)) < 3e-3
        unfocused = optics.psf(pupil, [DESIGN], image, **(settings | {"source_distance": math.inf}), tolerance=1e-4)
        assert reference.relative_l2(unfocused.psf[0], reference.airy_psf(r, DESIGN, radius, image)) > 0.2

    def test_magnification(self):
        """A source in direction θ has its image at z tan θ, on the ray through the centre, upside down."""
        f, angle = 2e-3, 0.05
        image = reference.thin_lens_image_distance(f, 3 * f)
        pupil = optics.Pupil(60e-6, thin_lens_focal_length=f)
        place = image * math.tan(angle)
        dx = place / 10
        result = optics.psf(
            pupil, [DESIGN], image, source_distance=3 * f, source_angle=(angle, 0.0), dx=dx, shape=(1, 41)
        )
        assert result.x[np.argmax(result.psf[0, 0])] == pytest.approx(place, rel=1e-6)

    def test_through_focus_is_lommels(self):
        """For a source at the distance s, the PSF on the axis over the distance has 1/f - 1/s in place of 1/f."""
        f, s, radius = 2e-3, 5e-3, 80e-6
        image = reference.thin_lens_image_distance(f, s)
        pupil = optics.Pupil(radius, thin_lens_focal_length=f)
        distances = image * np.linspace(0.6, 1.6, 11)
        got = np.array([peak(pupil, DESIGN, z, source_distance=s) for z in distances])
        expected = np.array([float(reference.defocused_psf(0.0, DESIGN, radius, image, z)) for z in distances])
        np.testing.assert_allclose(got, expected, atol=3e-3 * expected.max())  # NA² = 1.6e-3
        for wrong in (f, s, f * s / (f + s)):
            other = np.array([float(reference.defocused_psf(0.0, DESIGN, radius, wrong, z)) for z in distances])
            assert np.abs(other - got).max() > 0.2 * expected.max()


class TestPinhole:
    def test_sharpest_radius(self):
        """The peak of the PSF is highest for the radius √(0.742 λz). The maximum is found by a parabola through
        computed peaks. At the NA of 0.02, paraxial theory has an error of 4e-4.
        """
        z = 1e-3
        best = reference.pinhole_radius(DESIGN, z)
        ratios = np.array([0.9, 0.95, 1.0, 1.05, 1.1])
        peaks = [peak(optics.Pupil(best * ratio), DESIGN, z) for ratio in ratios]
        fit = np.polyfit(ratios, peaks, 2)
        assert -fit[1] / (2 * fit[0]) == pytest.approx(1, abs=0.01)  # the parabola's cubic remainder
        expected = float(reference.defocused_psf(0.0, DESIGN, best, math.inf, z))
        assert peaks[2] == pytest.approx(expected, rel=2e-3)
        # neither the geometric balance nor the brightest axis
        for other in (math.sqrt(0.61 / 0.742), math.sqrt(1 / 0.742)):
            assert peak(optics.Pupil(best * other), DESIGN, z) < 0.99 * peaks[2]

    def test_brightest_axis_is_four_times_the_incident_light(self):
        radius = math.sqrt(DESIGN * 1e-3)
        pupil = optics.Pupil(radius)
        assert peak(pupil, DESIGN, 1e-3) * pupil.area == pytest.approx(4, rel=2e-3)
        assert peak(optics.Pupil(radius * math.sqrt(2)), DESIGN, 1e-3) * pupil.area < 2e-3  # Fresnel number 2: dark
