"""Efficiencies of gratings, sampled as a field or given as a relief."""

import numpy as np
import pytest

import optics
from validation import reference

WAVELENGTH = 500e-9


class TestFieldOrders:
    """A Gaussian beam on a grating with a period of 5 µm. At 1 mm, the orders are 100 µm apart and 22 µm wide."""

    PERIOD, WAIST, Z = 5e-6, 20e-6, 1e-3

    def efficiencies(self, phase, samples_per_period, orders):
        """Return the share of the power within 50 µm of each order; phase: function of x / period in [0, 1) [waves]."""
        dx = self.PERIOD / samples_per_period
        n = 25 * samples_per_period
        x = (np.arange(n) - n // 2 + 0.5) * dx  # cells, not edges, on the period
        y = (np.arange(45) - 22) * self.PERIOD / 2
        beam = np.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / self.WAIST**2)
        rows = np.exp(2j * np.pi * phase(np.mod(x / self.PERIOD, 1)))
        u = np.zeros((45, n), complex) + rows
        u = np.repeat(u * beam, samples_per_period // 2, axis=0)[: len(u) * (samples_per_period // 2)]
        out = optics.propagate(
            u, dx=dx, wavelength=WAVELENGTH, distance=self.Z, out_dx=2.5e-6, out_shape=(64, 240), tolerance=1e-2
        )
        along = (np.arange(240) - 120) * 2.5e-6
        power = np.sum(np.abs(out.u) ** 2, axis=0) / (np.sum(np.abs(u) ** 2) * dx**2) * 2.5e-6**2
        centres = {m: self.Z * np.tan(np.arcsin(m * WAVELENGTH / self.PERIOD)) for m in orders}
        return np.array([power[np.abs(along - centre) < 50e-6].sum() for centre in centres.values()])

    CASES = {  # noqa: RUF012
        "binary": (lambda t: 0.5 * (t < 0.5), lambda m: reference.binary_grating_efficiency(m, 0.5)),
        "shallow binary": (lambda t: 0.2 * (t < 0.5), lambda m: reference.binary_grating_efficiency(m, 0.2)),
        "narrow binary": (lambda t: 0.5 * (t < 0.25), lambda m: reference.binary_grating_efficiency(m, 0.5, 0.25)),
        "blazed": (lambda t: t, lambda m: reference.blazed_grating_efficiency(m, 1.0)),
        "blazed for another wavelength": (lambda t: 0.8 * t, lambda m: reference.blazed_grating_efficiency(m, 0.8)),
        "4 levels": (lambda t: np.floor(4 * t) / 4, lambda m: reference.staircase_grating_efficiency(m, 4)),
        "8 levels": (lambda t: np.floor(8 * t) / 8, lambda m: reference.staircase_grating_efficiency(m, 8)),
        "sinusoidal": (
            lambda t: 0.4 * np.sin(2 * np.pi * t),
            lambda m: reference.sinusoidal_grating_efficiency(m, 0.8),
        ),
    }

    @pytest.mark.fast_cases(4)
    @pytest.mark.parametrize("name", CASES)
    def test_every_order_has_its_share(self, name):
        """Order m of a step with 16 samples per period has an error of 1 - sinc²(m/16), which is 5 % for m = 2."""
        phase, law = self.CASES[name]
        orders = (-2, -1, 0, 1, 2)
        got = self.efficiencies(phase, 16, orders)
        expected = np.array([law(m) for m in orders])
        np.testing.assert_allclose(got, expected, rtol=0.06, atol=3e-3)
        if name not in ("binary", "shallow binary", "narrow binary", "sinusoidal"):
            assert np.abs(got - expected[::-1]).max() > 0.5  # a falling sawtooth sends its light to the other side


class TestReliefs:
    """The same laws hold for a grating of glass in a pupil, for peaks of its orders relative to the peak without a
    grating.
    """

    RADIUS, PERIODS, N, Z = 100e-6, 16.2473, 1.5, 4e-3  # π x periods is a zero of J1: order 0 is dark at order 1

    def peak(self, height, order, n=1.5, wavelength=WAVELENGTH):
        """Return the PSF at the place of an order. Behind the ideal lens, orders are 16 Airy radii apart."""
        pupil = optics.Pupil(self.RADIUS, height, n=n, thin_lens_focal_length=self.Z)
        place = self.Z * np.tan(np.arcsin(order * wavelength * self.PERIODS / (2 * self.RADIUS)))
        dx = abs(place) if order else 1e-6
        shape = (1, 3)
        result = optics.psf(pupil, [wavelength], self.Z, dx=dx, shape=shape, tolerance=1e-2, dtype="float64")
        return result.psf[0, 0, 1 + int(np.sign(order))]

    @pytest.mark.fast_cases(1)
    @pytest.mark.parametrize("depth", [0.3, 0.766])
    def test_sinusoidal_relief(self, depth):
        """The spline represents a smooth relief accurately. Order 0 vanishes at a depth of 0.766 waves, where J0 is
        zero.
        """
        x = (np.arange(256) - 127.5) / 128
        height = depth / 2 * WAVELENGTH / 0.5 * np.sin(np.pi * self.PERIODS * x)
        height = np.broadcast_to(height, (256, 256))
        flat = self.peak(None, 0)
        for order in (-1, 0, 1):
            law = reference.sinusoidal_grating_efficiency(order, depth)
            # neighbours' rings and the lens's coma at 4°: one per cent of the brightest order
            assert self.peak(height, order) / flat == pytest.approx(law, abs=0.01)
        assert self.peak(height, 0, n=1.0) == pytest.approx(flat, rel=1e-6)

    @pytest.mark.slow
    def test_binary_relief_starves_order_zero(self):
        """Steps of half a wave, over half of each period, send no light to order 0 and 40.5 % to order 1. The spline
        rounds the steps, with an error that decreases with the number of samples.
        """
        errors, samples = [], (128, 256)
        flat = self.peak(None, 0)
        for count in samples:
            x = (np.arange(count) + 0.5 - count / 2) * 2 / count
            steps = np.mod(x * self.PERIODS / 2, 1) < 0.5
            height = np.broadcast_to(WAVELENGTH * steps, (count, count))  # (n - 1) h = λ/2
            got = [self.peak(height, order) / flat for order in (0, 1)]
            law = [reference.binary_grating_efficiency(order, 0.5) for order in (0, 1)]
            errors.append(np.abs(np.subtract(got, law)).max())
        assert errors[-1] < 0.05
        assert errors[-1] < 0.7 * errors[0]
