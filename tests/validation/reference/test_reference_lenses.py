"""The oracles of aberrations, focal lengths and pinholes, each against a quadrature of another kind.

Bounds near 1e-12 are float64's rounding over sums of a few hundred terms of order one.
"""

import math

import numpy as np
import pytest
from scipy.integrate import dblquad

from tests.validation.reference.quadrature import disk_nodes, gauss_legendre
from validation import reference

WAVELENGTH = 550e-9
K = 2 * math.pi / WAVELENGTH


class TestAberrations:
    def test_zernikes_are_orthonormal(self):
        rho, theta, weight = disk_nodes()
        basis = np.array([reference.zernike(j, rho, theta) * np.sqrt(weight) for j in range(1, 37)]).reshape(36, -1)
        gram = basis @ basis.T / weight.sum()
        np.testing.assert_allclose(gram, np.eye(36), atol=1e-12)

    def test_nolls_order_signs_and_norms(self):
        """The polynomials are those of Noll's table I, and R_n^m(1) = 1."""
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
        """Closed forms and one-dimensional integrals agree with quadrature in two dimensions."""
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
        """The third moment, which would give an error of σ³, vanishes for defocus, balanced astigmatism and coma."""
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
        # rays from glass through a sphere of curvature 1/R_c: f from the exact refraction of a ray near the axis
        n, curvature_radius, height = 1.52, 1e-3, 1e-7
        inside = math.asin(height / curvature_radius)
        bend = math.asin(n * math.sin(inside)) - inside
        f = reference.refractive_focal_length(curvature_radius, n)
        assert height / math.tan(bend) == pytest.approx(f, rel=1e-6)

    def test_kinoforms_axis_is_fresnels_integral(self):
        """The field on the axis is -i(π/λz) ∫ exp(iφ(t) + ikt/2z) dt over t = ρ², integrated zone by zone."""
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
