"""Contrasts between the grid's frequencies, over all orientations, against the sums themselves."""

import drjit as dr
import numpy as np
import pytest

import optics
from optics.numerics.precision import precision
from optics.point_spread import modulation_transfer
from optics.point_spread.modulation_transfer import MTF
from tests.optics.device_types import Float64

LENS, FOCUS, WAVELENGTH = optics.Pupil(1e-3, thin_lens_focal_length=4e-3), 4e-3, 550e-9


def radial_means(shares, dx, frequencies, orientations):
    """|Σ shares e^{-2πi f·x}|, the mean over orientations."""
    y, x = ((np.arange(n) - n // 2) * dx for n in shares.shape)
    angle = 2 * np.pi * (np.arange(orientations) + 0.5) / orientations
    found = []
    for f in frequencies:
        rows = np.exp(-2j * np.pi * np.outer(f * np.sin(angle), y))
        columns = np.exp(-2j * np.pi * np.outer(f * np.cos(angle), x))
        found.append(np.abs(np.sum(rows @ shares * columns, axis=1)).mean())
    return np.array(found)


def test_contrasts_between_the_grids_frequencies_are_the_pictures_own():
    """Contrasts reverse within one step of the grid if light fills its window: straight lines have an error of 0.04
    there."""
    result = optics.psf(LENS, [WAVELENGTH], FOCUS + 1.6e-4, dx=0.8e-6, shape=(91, 91), tolerance=1e-4)
    transfer = optics.mtf(result, tolerance=1)
    grid = transfer.fx[46:49]  # the first few
    f = np.linspace(0.3, 1.7, 8) * grid[0]
    exact = radial_means(transfer.shares.numpy()[0], result.dx, f, 128)
    off = np.abs(transfer.profile(f)[0] - exact).max()
    assert off < 1e-5 + 0.1 * transfer.predicted_error[0]
    lines = np.interp(f, np.append(0, grid), radial_means(transfer.shares.numpy()[0], result.dx, [0, *grid], 128))
    assert np.abs(lines - exact).max() > 0.02 > 10 * off


def test_as_many_orientations_as_the_picture_needs():
    """Two points d apart: |cos(π f d cos θ)|, which has 2 f d zeros in half a turn, up to 60."""
    d, dx = 60, 1e-6
    shares = np.zeros((1, 81, 81))
    shares[0, 40, [40 - d // 2, 40 + d // 2]] = 0.5
    tensor = precision("float64").Tensor(shares)
    f = np.linspace(0.3, 0.5, 11) / dx
    fine, few = (radial_means(shares[0], dx, f, n) for n in (4096, 64))
    assert np.abs(few - fine).max() > 0.03
    found = MTF.from_shares(tensor, dx, np.array([1e6]), np.array([2e-3])).profile(f)[0]
    assert np.abs(found - fine).max() < 1e-3
    with pytest.raises(optics.AccuracyError, match="a mean over 1024 orientations has"):
        MTF.from_shares(tensor, dx, np.array([1e6]), np.array([1e-6])).profile(f)


def test_many_frequencies_are_summed_some_at_a_time(monkeypatch):
    result = optics.psf(LENS, [WAVELENGTH, 600e-9], FOCUS + 4e-5, dx=0.5e-6, shape=(30, 71), tolerance=1e-4)
    transfer, f = optics.mtf(result, tolerance=1), np.linspace(0, 4e5, 7)
    at_once = transfer.profile(f)
    monkeypatch.setattr(modulation_transfer, "AT_A_TIME", 20)
    np.testing.assert_allclose(transfer.profile(f), at_once, atol=1e-7)


def test_windows_need_not_be_square():
    result = optics.psf(LENS, [WAVELENGTH, 600e-9], FOCUS + 4e-5, dx=0.5e-6, shape=(30, 71), tolerance=1e-4)
    transfer, f = optics.mtf(result, tolerance=1), np.array([1.23e4, 5.67e4, 1.1e5])
    for index in range(2):
        exact = radial_means(transfer.shares.numpy()[index], result.dx, f, 512)
        assert np.abs(transfer.profile(f)[index] - exact).max() < 0.1 * transfer.predicted_error[index]


def test_contrast_is_one_at_rest_and_none_beyond_half_a_cycle_for_each_sample():
    result = optics.psf(LENS, [WAVELENGTH], FOCUS, dx=0.5e-6, shape=(31, 31))
    assert optics.mtf(result).profile([0.0, 1.5e6])[0] == pytest.approx([1.0, 0.0])


def test_contrasts_carry_derivatives_by_the_focus():
    def contrast(z):
        result = optics.psf(LENS, [WAVELENGTH], z, dx=0.5e-6, shape=(41, 41), dtype="float64", tolerance=1e-8)
        return optics.mtf(result, tolerance=1).profile([7.7e4])

    z, step = Float64(FOCUS + 3e-5), 1e-8
    dr.enable_grad(z)
    value = contrast(z)
    dr.backward(dr.sum(value.array))
    expected = (contrast(FOCUS + 3e-5 + step)[0, 0] - contrast(FOCUS + 3e-5 - step)[0, 0]) / (2 * step)
    assert z.grad[0] == pytest.approx(expected, rel=1e-4)


def test_quality_says_what_its_steps_may_miss():
    """Light over a wide window has a peak of contrast narrower than a step of the integral over frequency."""
    pupil = optics.Pupil(0.1e-3, thin_lens_focal_length=2e-3)
    result = optics.psf(pupil, [WAVELENGTH], 4e-3, dx=3e-6, shape=(101, 101))
    (value,), (error,) = optics.image_quality(result, 1.6e5, with_error=True, tolerance=0.05)
    f = np.linspace(0, 1.6e5, 8193)
    exact = np.trapezoid(optics.mtf(result, tolerance=0.05).profile(f)[0], f) / 1.6e5
    missed = abs(value - exact)
    assert missed > 1e-5
    assert missed < error - optics.mtf(result, tolerance=0.05).predicted_error[0]
