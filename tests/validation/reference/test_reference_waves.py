"""The oracles of beams, plane waves, edges and gratings, each against mpmath or a quadrature of another kind.

Bounds near 1e-12 are float64's rounding over sums of a few hundred terms of order one.
"""

import itertools
import math

import mpmath
import numpy as np
import pytest
from scipy.special import j0

from tests.validation.reference.quadrature import gauss_legendre
from validation import reference

WAVELENGTH = 550e-9
K = 2 * math.pi / WAVELENGTH


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
        """Two integrals of the same field agree: one over frequencies, and one over the plane of the source."""
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
        """The intensity is 1/4 at the edge. The first maximum is 1.370 at s = 1.217, and the first minimum 0.778 at s =
        1.873 (Born & Wolf).
        """
        s = np.array([0.0, 1.2172, 1.8725])
        field = reference.knife_edge_field(s * math.sqrt(WAVELENGTH * 1e-4 / 2), WAVELENGTH, 1e-4)
        np.testing.assert_allclose(np.abs(field) ** 2, [0.25, 1.3704, 0.7782], atol=1e-4)


def fourier_coefficient(phase, order, breaks, n=40):
    """Return ∫₀¹ e^{iφ(x)} e^{-2πimx} dx, by Gauss-Legendre quadrature between the jumps of the phase."""
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
