"""The oracles themselves: each against mpmath or a quadrature of another kind, and each against the wrong method.

Bounds near 1e-12 are float64's rounding over sums of a few hundred terms of order one.
"""

import itertools
import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.special import j0

from validation import reference

WAVELENGTH = 550e-9
K = 2 * math.pi / WAVELENGTH


def gauss_legendre(n, low=0.0, high=1.0):
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return low + (high - low) * (nodes + 1) / 2, (high - low) * weights / 2


def disk_nodes(radial=48, angular=96):
    """ρ, θ and weights on the unit disk, exact for polynomials of degree below 90."""
    rho, weight = gauss_legendre(radial)
    theta = 2 * np.pi * np.arange(angular) / angular
    return rho[:, None], theta[None, :], np.broadcast_to((weight * rho)[:, None], (radial, angular))


def cartesian_rayleigh_sommerfeld(point, radius, focal_length, z, n=240):
    """The integral in other coordinates, chords of the disk: x = R sin α, |y| < R cos α."""
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
        """Goodman's other definition, the pupil's autocorrelation: the area common to two disks s diameters apart."""
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
        """Misses the phase kρ²/2D, so the intensity errs by the Fresnel number squared."""
        radius, errors = 2e-6, []
        for z in (1e-3, 4e-3, 16e-3):
            r = np.linspace(0, z, 21)
            exact = np.abs(reference.ideal_lens_field(r, WAVELENGTH, radius, distance=z)) ** 2
            far = reference.circular_aperture_fraunhofer(r, WAVELENGTH, radius, z)
            errors.append(reference.relative_l2(far, exact, r + r[1]))
        assert errors[-1] < 1e-6
        assert reference.order_of_convergence([1e-3, 4e-3, 16e-3], errors) == pytest.approx(-2, abs=0.1)

    def test_power_of_an_aperture_is_what_fraunhofers_pattern_carries(self):
        """Flux through the half sphere against the closed form: ∫ |πR²/λ 2J1(v)/v|² dΩ / cos θ = ∫ ... ds dt."""
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
        """Windows of ±10 λ f#, to the corner. Twice the nodes change nothing above 1e-12 of the peak."""
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
        """On the axis sinc², in the focal plane Airy, at the shadow's edge (1 - 2 J0 cos u + J0²)/u² (§8.8.1)."""
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
        """To what Airy's tail leaves out beyond v = 200: 2/(πv)."""
        r, weight = gauss_legendre(600, 0, 200 / (K * 0.03e-3 / 2e-3))
        psf = reference.defocused_psf(r, WAVELENGTH, 30e-6, 3e-3, 2e-3)
        assert np.sum(weight * 2 * np.pi * r * psf) == pytest.approx(1 - 2 / (200 * np.pi), abs=2e-4)

    def test_the_exact_defocused_lens_departs_from_it_like_the_angle_squared(self):
        """Fresnel number and defocus in waves held fixed: the same pattern in (u, v), paraxially."""
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


class TestWaves:
    @pytest.mark.parametrize("fx", [0.0, 0.3, 0.99, 1.01, 1.5])
    def test_plane_waves_solve_helmholtzs_equation(self, fx):
        def field(x, z):
            axial = mpmath.sqrt(mpmath.mpc(1 - mpmath.mpf(fx) ** 2))
            return mpmath.exp(2j * mpmath.pi * (fx * x + axial * z))

        at = (mpmath.mpf("0.3"), mpmath.mpf("0.7"))
        with mpmath.workdps(30):
            laplacian = mpmath.diff(field, at, (2, 0)) + mpmath.diff(field, at, (0, 2))
            assert abs(laplacian + (2 * mpmath.pi) ** 2 * field(*at)) < 1e-9
        ours = reference.plane_wave(0.3 * WAVELENGTH, 0.7 * WAVELENGTH, WAVELENGTH, fx / WAVELENGTH)
        assert abs(ours * np.exp(2j * np.pi * 0.7) - complex(field(*at))) < 1e-12

    def test_gaussian_beam_is_fresnels_integral(self):
        waist, z = 4e-6, 70e-6
        for r in (0.0, 3e-6, 9e-6):
            rho, weight = gauss_legendre(400, 0, 6 * waist)
            phase = np.exp(1j * K * (rho**2 + r**2) / (2 * z) - rho**2 / waist**2)
            integral = -1j * K / z * np.sum(weight * rho * j0(K * r * rho / z) * phase)
            assert abs(reference.gaussian_beam(np.array(r), WAVELENGTH, waist, z) - integral) < 1e-12

    @pytest.mark.parametrize(("waist", "z"), [(0.2e-6, 0.3e-6), (0.5e-6, 4e-6), (3e-6, 30e-6)])
    def test_exact_gaussian_is_the_rayleigh_sommerfeld_integral(self, waist, z):
        """Two different integrals of the same field: over frequencies, and over the source plane."""
        r = np.array([0.0, waist, 3 * waist])
        rho, weight = gauss_legendre(700, 0, 6.5 * waist)
        angle = np.pi * (np.arange(300) + 0.5) / 300
        expected = []
        for at in r:
            d2 = rho[:, None] ** 2 + at**2 - 2 * rho[:, None] * at * np.cos(angle)
            d = np.sqrt(d2 + z**2)
            kernel = z / d**2 * (1 / d - 1j * K) * np.exp(1j * K * d2 / (d + z))
            expected.append((weight * rho * np.exp(-((rho / waist) ** 2))) @ kernel.mean(axis=1))
        np.testing.assert_allclose(reference.gaussian_field(r, WAVELENGTH, waist, z), expected, atol=1e-11)

    def test_exact_gaussian_tends_to_the_beam_like_the_fourth_power_of_the_angle(self):
        errors, waists = [], np.array([2e-6, 4e-6, 8e-6])
        for waist in waists:
            r = np.linspace(0, 3 * waist, 40)
            exact = reference.gaussian_field(r, WAVELENGTH, waist, 10e-6)
            errors.append(reference.relative_l2(reference.gaussian_beam(r, WAVELENGTH, waist, 10e-6), exact, r))
        assert reference.order_of_convergence(1 / waists, errors) == pytest.approx(4, abs=0.1)

    def test_gaussian_starts_as_itself(self):
        r = np.linspace(0, 1e-6, 9)
        start = reference.gaussian_field(r, WAVELENGTH, 0.25e-6, 0.0)
        np.testing.assert_allclose(start, np.exp(-((r / 0.25e-6) ** 2)), atol=1e-12)

    def test_evanescent_power_of_a_gaussian(self):
        waist = 0.2e-6
        f, weight = gauss_legendre(200, 1 / WAVELENGTH, 4 / waist)
        spectrum = (np.pi * waist**2 * np.exp(-((np.pi * waist * f) ** 2))) ** 2
        share = np.sum(weight * 2 * np.pi * f * spectrum) / (np.pi * waist**2 / 2)
        assert reference.gaussian_evanescent_power(WAVELENGTH, waist) == pytest.approx(share, rel=1e-12)

    def test_edge_and_slit_are_fresnels_integral(self):
        z = 100e-6
        scale = math.sqrt(2 / (WAVELENGTH * z))
        for x in (-6e-6, 0.0, 2e-6, 15e-6):
            with mpmath.workdps(20):
                value = (
                    (1 - 1j)
                    / 2
                    * ((1 + 1j) / 2 + mpmath.quad(lambda t: mpmath.expjpi(t * t / 2), mpmath.linspace(0, x * scale, 9)))
                )
            assert abs(reference.knife_edge_field(np.array(x), WAVELENGTH, z) - complex(value)) < 1e-12
            n = np.linspace(-10e-6, 10e-6, 41)
            middle, weight = gauss_legendre(64, -0.25e-6, 0.25e-6)
            source = ((n[:-1] + n[1:]) / 2)[:, None] + middle
            slit = np.sum(np.exp(1j * K * (source - x) ** 2 / (2 * z)) @ weight) / np.sqrt(1j * WAVELENGTH * z)
            assert abs(reference.slit_field(np.array(x), 10e-6, WAVELENGTH, z) - slit) < 1e-12

    def test_known_intensities_of_the_edge(self):
        """1/4 at the edge; the first maximum 1.370 at s = 1.217, the first minimum 0.778 at s = 1.873 (Born & Wolf)."""
        s = np.array([0.0, 1.2172, 1.8725])
        field = reference.knife_edge_field(s * math.sqrt(WAVELENGTH * 1e-4 / 2), WAVELENGTH, 1e-4)
        np.testing.assert_allclose(np.abs(field) ** 2, [0.25, 1.3704, 0.7782], atol=1e-4)


def fourier_coefficient(phase, order, breaks, n=40):
    """∫₀¹ e^{iφ(x)} e^{-2πimx} dx, by Gauss-Legendre between the phase's jumps."""
    total = 0
    for low, high in itertools.pairwise(breaks):
        x, weight = gauss_legendre(n, low, high)
        total += np.sum(weight * np.exp(1j * phase(x) - 2j * np.pi * order * x))
    return total


class TestGratings:
    @pytest.mark.parametrize("order", range(-3, 6))
    def test_efficiencies_are_fourier_coefficients(self, order):
        def efficiency(phase, breaks):
            return abs(fourier_coefficient(phase, order, breaks)) ** 2

        for depth, duty in ((0.5, 0.5), (0.31, 0.5), (0.5, 0.2)):
            binary = efficiency(lambda x, d=depth, q=duty: 2 * np.pi * d * (x < q), [0, duty, 1])
            assert reference.binary_grating_efficiency(order, depth, duty) == pytest.approx(binary, abs=1e-13)
        for depth in (1.0, 0.8, -1.0, 2.0):
            blazed = efficiency(lambda x, d=depth: 2 * np.pi * d * x, [0, 1])
            assert reference.blazed_grating_efficiency(order, depth) == pytest.approx(blazed, abs=1e-13)
            for levels in (2, 3, 4, 8):
                stairs = efficiency(
                    lambda x, d=depth, n=levels: 2 * np.pi * d * np.floor(n * x) / n, np.linspace(0, 1, levels + 1)
                )
                assert reference.staircase_grating_efficiency(order, levels, depth) == pytest.approx(stairs, abs=1e-13)
        sine = efficiency(lambda x: np.pi * 0.7 * np.sin(2 * np.pi * x), [0, 0.5, 1])
        assert reference.sinusoidal_grating_efficiency(order, 0.7) == pytest.approx(sine, abs=1e-13)

    def test_orders_hold_all_light(self):
        orders = range(-4000, 4001)
        for law in (
            lambda m: reference.binary_grating_efficiency(m, 0.5),
            lambda m: reference.blazed_grating_efficiency(m, 0.6),
            lambda m: reference.staircase_grating_efficiency(m, 4, 0.6),
            lambda m: reference.sinusoidal_grating_efficiency(m, 0.6),
        ):
            # sinc²'s tail beyond M orders holds at most 2/(π²M), 5e-5 here
            assert sum(law(m) for m in orders) == pytest.approx(1, abs=2e-4)

    @pytest.mark.parametrize(("levels", "percent"), [(2, 40.5), (4, 81.1), (8, 95.0), (16, 98.7)])
    def test_published_efficiencies(self, levels, percent):
        assert 100 * reference.staircase_grating_efficiency(1, levels) == pytest.approx(percent, abs=0.06)

    def test_stairs_approach_the_sawtooth_with_the_square_of_the_levels(self):
        levels = [8, 16, 32, 64]
        lost = [1 - reference.staircase_grating_efficiency(1, n) for n in levels]
        assert reference.order_of_convergence(levels, lost) == pytest.approx(-2, abs=0.02)

    def test_grating_images_itself_at_talbots_distance_only(self):
        period, orders = 1.1e-6, {-1: 0.25, 0: 0.5, 1: 0.25}
        x = np.linspace(0, period, 50)
        z = reference.talbot_distance(period, WAVELENGTH)
        start = reference.grating_field(x, 0.0, WAVELENGTH, period, orders)
        image = reference.grating_field(x, z, WAVELENGTH, period, orders)
        assert np.abs(np.abs(image) ** 2 - np.abs(start) ** 2).max() < 1e-12
        half = reference.grating_field(x, z / 2, WAVELENGTH, period, orders)  # shifted by half a period
        assert np.abs(np.abs(half) ** 2 - np.abs(np.roll(start[:-1], 0)[0] - start) ** 2).max() < 1e-12
        paraxial = reference.paraxial_talbot_distance(period, WAVELENGTH)
        ratios = [
            reference.paraxial_talbot_distance(d, WAVELENGTH) / reference.talbot_distance(d, WAVELENGTH) - 1
            for d in (period, 2 * period, 4 * period)
        ]
        assert paraxial > 1.05 * z
        assert reference.order_of_convergence([1, 2, 4], ratios) == pytest.approx(-2, abs=0.1)


class TestAberrations:
    def test_zernikes_are_orthonormal(self):
        rho, theta, weight = disk_nodes()
        basis = np.array([reference.zernike(j, rho, theta) * np.sqrt(weight) for j in range(1, 37)]).reshape(36, -1)
        gram = basis @ basis.T / weight.sum()
        np.testing.assert_allclose(gram, np.eye(36), atol=1e-12)

    def test_nolls_order_signs_and_norms(self):
        """Noll's table I, and R_n^m(1) = 1."""
        first = [(0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (3, -3), (3, 3), (4, 0), (4, 2)]
        assert [reference.noll_index(j) for j in range(1, 13)] == first
        rho, theta = np.array([0.3, 0.8]), np.array([0.2, 2.0])
        by_hand = {
            2: 2 * rho * np.cos(theta),
            3: 2 * rho * np.sin(theta),
            4: np.sqrt(3) * (2 * rho**2 - 1),
            5: np.sqrt(6) * rho**2 * np.sin(2 * theta),
            6: np.sqrt(6) * rho**2 * np.cos(2 * theta),
            8: np.sqrt(8) * (3 * rho**3 - 2 * rho) * np.cos(theta),
            11: np.sqrt(5) * (6 * rho**4 - 6 * rho**2 + 1),
        }
        for j, value in by_hand.items():
            np.testing.assert_allclose(reference.zernike(j, rho, theta), value, rtol=1e-13)
        for j in range(1, 40):
            n, m = reference.noll_index(j)
            norm = math.sqrt((n + 1) * (2 if m else 1))
            at = math.pi / (2 * abs(m)) if m < 0 else 0.0
            assert reference.zernike(j, np.array(1.0), np.array(at)) == pytest.approx(norm, rel=1e-11)
        with pytest.raises(ValueError, match="j = 0"):
            reference.noll_index(0)

    @pytest.mark.parametrize("w", [-1.3, -0.2, 0.1, 0.25, 0.6, 1.7])
    @pytest.mark.parametrize("balance", [0.0, 0.4, -1.0])
    def test_strehl_ratios_are_the_integral_over_the_disk(self, w, balance):
        """Spectral quadrature in two dimensions against closed forms and one-dimensional integrals."""
        rho, theta, weight = disk_nodes()
        cosine = rho * np.cos(theta)

        def strehl(wavefront):
            return reference.strehl_of_wavefront(wavefront, weight)

        assert reference.strehl_defocus(w) == pytest.approx(strehl(w * rho**2 + 0 * theta), abs=1e-12)
        wavefront = w * rho**4 + balance * w * rho**2 + 0 * theta
        assert reference.strehl_spherical(w, balance * w) == pytest.approx(strehl(wavefront), abs=1e-12)
        wavefront = w * rho**2 * cosine + balance * w * cosine
        assert reference.strehl_coma(w, balance * w) == pytest.approx(strehl(wavefront), abs=1e-11)
        wavefront = w * cosine**2 + balance * w * rho**2
        assert reference.strehl_astigmatism(w, balance * w) == pytest.approx(strehl(wavefront), abs=1e-11)

    def test_one_of_them_by_adaptive_quadrature(self):
        def part(wave):
            return dblquad(lambda y, t: y * wave(2 * np.pi * 0.3 * (y**3 - 2 * y / 3) * np.cos(t)), 0, 2 * np.pi, 0, 1)[
                0
            ]

        value = (part(np.cos) ** 2 + part(np.sin) ** 2) / np.pi**2
        assert reference.strehl_coma(0.3, -0.2) == pytest.approx(value, abs=1e-9)

    def test_rms_of_each_aberration(self):
        rho, theta, weight = disk_nodes()
        cosine = rho * np.cos(theta)
        wavefronts = {
            "defocus": rho**2 + 0 * theta,
            "spherical": rho**4 + 0 * theta,
            "balanced spherical": rho**4 - rho**2 + 0 * theta,
            "coma": rho**2 * cosine,
            "balanced coma": (rho**2 - 2 / 3) * cosine,
            "astigmatism": cosine**2,
            "balanced astigmatism": cosine**2 - rho**2 / 2,
        }
        assert wavefronts.keys() == reference.RMS_PER_WAVE.keys()
        for name, wavefront in wavefronts.items():
            mean = np.sum(weight * wavefront) / weight.sum()
            sigma = math.sqrt(np.sum(weight * (wavefront - mean) ** 2) / weight.sum())
            assert reference.RMS_PER_WAVE[name] == pytest.approx(sigma, rel=1e-12)

    def test_marechals_rule_errs_by_the_fourth_power_of_the_rms(self):
        """In full: defocus and astigmatism alone; the third moment that would give σ³ vanishes for them and coma."""
        for law, name, balance in (
            (reference.strehl_defocus, "defocus", None),
            (reference.strehl_coma, "balanced coma", -2 / 3),
            (reference.strehl_astigmatism, "balanced astigmatism", -0.5),
        ):
            waves = np.array([0.1, 0.2, 0.4]) * 0.2 / reference.RMS_PER_WAVE[name]
            errors = []
            for w in waves:
                exact = law(w) if balance is None else law(w, balance * w)
                errors.append(abs(exact - reference.marechal_strehl(w * reference.RMS_PER_WAVE[name])))
            assert reference.order_of_convergence(waves, errors) == pytest.approx(4, abs=0.2)


class TestLenses:
    def test_lens_equation_and_lensmaker(self):
        assert reference.thin_lens_image_distance(120e-6, 360e-6) == pytest.approx(180e-6)
        assert reference.thin_lens_image_distance(120e-6, math.inf) == pytest.approx(120e-6, rel=1e-15)
        assert reference.thin_lens_image_distance(120e-6, 60e-6) == pytest.approx(-120e-6)
        # rays through a sphere of curvature 1/R_c, from glass: f from the exact refraction of a ray near the axis
        n, curvature_radius, height = 1.52, 1e-3, 1e-7
        inside = math.asin(height / curvature_radius)
        bend = math.asin(n * math.sin(inside)) - inside
        f = reference.refractive_focal_length(curvature_radius, n)
        assert height / math.tan(bend) == pytest.approx(f, rel=1e-6)

    def test_kinoforms_axis_is_fresnels_integral(self):
        """Over t = ρ², the field is -i(π/λz) ∫ exp(iφ(t) + ikt/2z) dt, zone by zone."""
        design, f, wavelength, zones = 550e-9, 1e-3, 480e-9, 5
        step = 2 * design * f
        for order in (1, 2):
            z, psf = reference.kinoform_on_axis(wavelength, design, math.sqrt(zones * step), f, order)
            field = 0
            for zone in range(zones):
                t, weight = gauss_legendre(60, zone * step, (zone + 1) * step)
                relief = design * (1 - (t / step - zone))  # optical path, wrapped at the design wavelength
                field += np.sum(weight * np.exp(2j * np.pi / wavelength * (relief + t / (2 * z))))
            intensity = abs(np.pi / (wavelength * z) * field) ** 2
            assert psf == pytest.approx(intensity / (np.pi * zones * step), rel=1e-10)

    def test_pinhole_has_the_highest_peak_there_and_nowhere_else(self):
        z = 1e-3
        best = reference.pinhole_radius(WAVELENGTH, z)
        radius = best * np.linspace(0.5, 1.5, 20001)
        peak = reference.defocused_psf(0.0, WAVELENGTH, best, math.inf, z)
        scan = [float(reference.defocused_psf(0.0, WAVELENGTH, a, math.inf, z)) for a in radius[::200]]
        assert max(scan) <= peak
        axial = 4 * np.sin(np.pi * radius**2 / (2 * WAVELENGTH * z)) ** 2 / (np.pi * radius**2)
        assert radius[np.argmax(axial)] == pytest.approx(best, rel=1e-4)
        assert peak == pytest.approx(axial.max(), rel=1e-7)
