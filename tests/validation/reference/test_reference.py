"""The oracles of apertures and lenses, each against mpmath or a quadrature of another kind.

Bounds near 1e-12 are float64's rounding over sums of a few hundred terms of order one.
"""

import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from tests.validation.reference.quadrature import gauss_legendre
from validation import reference

WAVELENGTH = 550e-9
K = 2 * math.pi / WAVELENGTH


def cartesian_rayleigh_sommerfeld(point, radius, focal_length, z, n=240):
    """Return the integral in other coordinates: along chords of the disk at x = R sin α, with |y| < R cos α."""
    x, weight_x = gauss_legendre(n, -np.pi / 2, np.pi / 2)
    along, weight_x = radius * np.sin(x), weight_x * radius * np.cos(x)
    unit, weight_y = gauss_legendre(n, -1, 1)
    half = np.sqrt(radius**2 - along**2)
    across = half[:, None] * unit
    d = np.sqrt((along[:, None] - point) ** 2 + across**2 + z**2)
    rho2 = along[:, None] ** 2 + across**2
    lens = math.copysign(1, focal_length) * rho2 / (np.sqrt(rho2 + focal_length**2) + abs(focal_length))
    kernel = z / (2 * np.pi * d**2) * (1 / d - 1j * K) * np.exp(1j * K * (d - z - lens))
    return np.sum(kernel * (weight_x * half)[:, None] * weight_y)


class TestCircular:
    def test_airy_psf_and_zeros(self):
        for index, zero in enumerate(reference.AIRY_ZEROS, start=1):
            assert zero == pytest.approx(float(mpmath.besseljzero(1, index)), rel=1e-14)
        scale = 2 * np.pi * 30e-6 / (WAVELENGTH * 240e-6)
        r = np.array([0.0, 1e-6, 2.5e-6, 9e-6])
        peak = np.pi * 30e-6**2 / (WAVELENGTH * 240e-6) ** 2
        for at, value in zip(r, reference.airy_psf(r, WAVELENGTH, 30e-6, 240e-6), strict=True):
            v = mpmath.mpf(scale * at)
            amplitude = mpmath.quad(lambda t, v=v: mpmath.besselj(0, v * t) * 2 * t, [0, 1])
            assert value == pytest.approx(float(peak * amplitude**2), rel=1e-12)

    def test_encircled_energy_is_the_integral_of_the_psf(self):
        arguments = (WAVELENGTH, 30e-6, 240e-6)
        for edge in (1e-6, 2.7e-6, 8e-6):
            r, weight = gauss_legendre(80, 0, edge)
            total = np.sum(weight * 2 * np.pi * r * reference.airy_psf(r, *arguments))
            assert reference.airy_encircled_energy(edge, *arguments) == pytest.approx(total, rel=1e-12)

    def test_mtf_is_the_overlap_of_two_disks(self):
        """The MTF is also the autocorrelation of the pupil (Goodman): the common area of two disks whose centres are s
        diameters apart.
        """
        radius, focal_length = 30e-6, 240e-6
        cutoff = 2 * radius / (WAVELENGTH * focal_length)
        for s in (0.0, 0.1, 0.5, 0.9, 1.0, 1.2):
            overlap, _ = quad(lambda y, s=s: 2 * max(math.sqrt(1 - y * y) - s, 0.0), -1, 1, epsabs=1e-12, limit=400)
            value = reference.circular_mtf(np.array(s * cutoff), WAVELENGTH, radius, focal_length)
            assert value == pytest.approx(overlap / math.pi, abs=1e-9)

    def test_on_axis_forms_are_the_integral_in_thirty_digits(self):
        radius, z = 20e-6, 40e-6
        with mpmath.workdps(30):
            k = 2 * mpmath.pi / WAVELENGTH

            def field(focal_phase):
                def integrand(length):  # ρ dρ = L dL
                    return z / length * (1 / length - 1j * k) * mpmath.expj(k * (length - z) * focal_phase)

                edge = mpmath.sqrt(mpmath.mpf(z) ** 2 + mpmath.mpf(radius) ** 2)
                return mpmath.quad(integrand, mpmath.linspace(z, edge, 41))

            aperture, focus = field(1), field(0)
        assert reference.circular_aperture_on_axis(radius, z, WAVELENGTH) == pytest.approx(
            float(abs(aperture) ** 2), rel=1e-12
        )
        assert abs(reference.converging_wave_at_focus(radius, z, WAVELENGTH) - complex(focus)) < 1e-12 * abs(focus)

    def test_fraunhofer_at_any_angle_is_the_exact_integral_at_small_fresnel_number(self):
        """Fraunhofer's pattern lacks the phase kρ²/2D, so the error of the intensity is proportional to the Fresnel
        number squared.
        """
        radius, errors = 2e-6, []
        for z in (1e-3, 4e-3, 16e-3):
            r = np.linspace(0, z, 21)
            exact = np.abs(reference.ideal_lens_field(r, WAVELENGTH, radius, distance=z)) ** 2
            far = reference.circular_aperture_fraunhofer(r, WAVELENGTH, radius, z)
            errors.append(reference.relative_l2(far, exact, r + r[1]))
        assert errors[-1] < 1e-6
        assert reference.order_of_convergence([1e-3, 4e-3, 16e-3], errors) == pytest.approx(-2, abs=0.1)

    def test_power_of_an_aperture_is_what_fraunhofers_pattern_carries(self):
        """The integral of |πR²/λ 2J1(v)/v|² over the direction sines s and t of the half sphere agrees with the closed
        form (ds dt = cos θ dΩ).
        """
        radius = 0.7e-6
        sine, weight = gauss_legendre(200)
        pattern = reference.airy_psf(sine, WAVELENGTH, radius, 1.0)
        assert reference.circular_aperture_power(radius, WAVELENGTH) == pytest.approx(
            np.sum(weight * 2 * np.pi * sine * pattern), rel=1e-12
        )


class TestRayleighSommerfeld:
    @pytest.mark.parametrize(
        ("radius", "focal_length", "z", "r"),
        [
            (37.5e-6, 300e-6, 300e-6, 3e-6),
            (107e-6, 300e-6, 300e-6, 7e-6),  # f/1.4
            (30e-6, 240e-6, 200e-6, 12e-6),  # defocused
            (20e-6, math.inf, 60e-6, 25e-6),  # bare aperture, outside its shadow
        ],
    )
    def test_it_is_the_integral_in_other_coordinates(self, radius, focal_length, z, r):
        polar = reference.ideal_lens_field(np.array(r), WAVELENGTH, radius, focal_length, z)
        scale = abs(reference.ideal_lens_field(np.array(0.0), WAVELENGTH, radius, focal_length, z))
        assert abs(polar - cartesian_rayleigh_sommerfeld(r, radius, focal_length, z)) < 1e-10 * max(scale, 1)

    @pytest.mark.parametrize("f_number", [1.4, 2, 2.8, 4, 5.6, 8, 11, 16])
    def test_nodes_suffice_for_every_lens_of_the_chart(self, f_number):
        """Twice the number of nodes changes the field by less than 1e-12 of the peak, in windows of ±10 λ f/D including
        the corners.
        """
        radius, f = 300e-6 / (2 * f_number), 300e-6
        r = np.linspace(0, 14.2 * WAVELENGTH * f_number, 24)
        self.check(r, radius, f, f)

    @pytest.mark.parametrize(
        ("radius", "z", "r_max"), [(50e-6, 200e-6, 85e-6), (20e-6, 5e-6, 30e-6), (2e-6, 1e-3, 1e-4)]
    )
    def test_nodes_suffice_for_bare_apertures(self, radius, z, r_max):
        self.check(np.linspace(0, r_max, 16), radius, math.inf, z)

    def check(self, r, radius, focal_length, z):
        field = reference.ideal_lens_field(r, WAVELENGTH, radius, focal_length, z)
        doubled = reference.ideal_lens_field(r, WAVELENGTH, radius, focal_length, z, nodes=(480, 480))
        assert np.abs(field - doubled).max() < 1e-12 * np.abs(doubled).max()
        profile = reference.ideal_lens_profile(r.max(), WAVELENGTH, radius, focal_length, z)
        assert np.abs(profile(r) - doubled).max() < 1e-11 * np.abs(doubled).max()
        axis = (
            reference.circular_aperture_on_axis(radius, z, WAVELENGTH)
            if math.isinf(focal_length)
            else abs(reference.converging_wave_at_focus(radius, z, WAVELENGTH)) ** 2
        )
        assert abs(field[0]) ** 2 == pytest.approx(axis, rel=1e-11)

    def test_too_few_nodes_are_seen(self):
        r = np.array([40e-6])
        exact = reference.ideal_lens_field(r, WAVELENGTH, 50e-6, distance=200e-6)
        coarse = reference.ideal_lens_field(r, WAVELENGTH, 50e-6, distance=200e-6, nodes=(48, 48))
        assert abs(coarse - exact)[0] > 1e-2

    def test_point_source_is_a_lens_of_negative_focal_length(self):
        r = np.array([0.0, 4e-6])
        source = reference.ideal_lens_field(r, WAVELENGTH, 20e-6, distance=100e-6, source_distance=150e-6)
        diverging = [cartesian_rayleigh_sommerfeld(at, 20e-6, -150e-6, 100e-6) for at in r]
        np.testing.assert_allclose(source, diverging, atol=1e-10)


class TestDefocus:
    @pytest.mark.parametrize(
        ("u", "v"),
        [
            *[(0, 0), (0, 3.8), (1e-9, 0), (0.3, 0), (0.3, 0.1), (0.9, 1.9), (0.9, 2.1), (0.5, 30)],
            *[(4, 4), (12, 3), (12, 40), (60, 0.0), (60, 59.9), (60, 60.1), (-7, 5), (250, 30)],
        ],
    )
    def test_lommels_functions_are_the_integral(self, u, v):
        cells = max(2, int((abs(u) + v) / 6))
        value = mpmath.quad(
            lambda t: mpmath.besselj(0, v * t) * mpmath.expj(-u * t * t / 2) * 2 * t, mpmath.linspace(0, 1, cells + 1)
        )
        assert reference.lommel_intensity(u, v) == pytest.approx(float(abs(value) ** 2), rel=1e-9, abs=1e-13)

    def test_the_edges_of_the_formula(self):
        """The limits are sinc² on the axis, Airy's pattern in the focal plane, and (1 - 2 J0 cos u + J0²)/u² at the
        edge of the shadow (Born & Wolf, §8.8.1).
        """
        u = np.linspace(0.01, 50, 200)
        np.testing.assert_allclose(reference.lommel_intensity(u, 0), np.sinc(u / (4 * np.pi)) ** 2, atol=1e-12)
        edge = [float((1 - 2 * mpmath.besselj(0, x) * mpmath.cos(x) + mpmath.besselj(0, x) ** 2) / x**2) for x in u]
        np.testing.assert_allclose(reference.lommel_intensity(u, u), edge, rtol=1e-8, atol=1e-13)
        r = np.linspace(0, 20e-6, 50)
        np.testing.assert_allclose(
            reference.defocused_psf(r, WAVELENGTH, 30e-6, 240e-6, 240e-6),
            reference.airy_psf(r, WAVELENGTH, 30e-6, 240e-6),
            rtol=1e-9,
            atol=1.0,  # 1e-9 of the peak
        )

    def test_it_carries_all_the_power(self):
        """The pattern contains all power except for the part 2/(πv) beyond v = 200."""
        r, weight = gauss_legendre(600, 0, 200 / (K * 0.03e-3 / 2e-3))
        psf = reference.defocused_psf(r, WAVELENGTH, 30e-6, 3e-3, 2e-3)
        assert np.sum(weight * 2 * np.pi * r * psf) == pytest.approx(1 - 2 / (200 * np.pi), abs=2e-4)

    def test_the_exact_defocused_lens_departs_from_it_like_the_angle_squared(self):
        """For a fixed Fresnel number and a fixed defocus in waves, the paraxial pattern in (u, v) is the same."""
        fresnel_number, apertures, errors = 20.0, (0.02, 0.04, 0.08), []
        for aperture in apertures:
            f = fresnel_number * WAVELENGTH / aperture**2
            radius, z = aperture * f, f * (1 + 1 / (2 * fresnel_number))
            r = np.linspace(0, 8 * WAVELENGTH / (2 * aperture), 60)
            exact = np.abs(reference.ideal_lens_field(r, WAVELENGTH, radius, f, z)) ** 2 / (np.pi * radius**2)
            paraxial = reference.defocused_psf(r, WAVELENGTH, radius, f, z)
            errors.append(reference.relative_l2(paraxial, exact, r))
        assert errors[0] < 2e-3
        assert reference.order_of_convergence(apertures, errors) == pytest.approx(2, abs=0.1)
