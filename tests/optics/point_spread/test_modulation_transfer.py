"""Contrasts between the grid's frequencies, over all orientations, against the sums themselves."""

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import optics
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread import modulation_transfer
from optics.point_spread.contrast import combined_mtf
from optics.point_spread.modulation_transfer import MTF
from optics.point_spread.window_loss import ErrorCauses
from tests.optics.device_types import Float64

LENS, FOCUS, WAVELENGTH = optics.Pupil(1e-3, thin_lens_focal_length=4e-3), 4e-3, 550e-9


def radial_means(shares, dx, frequencies, orientations):
    """Return the mean of |Σ shares e^{-2πi f·x}| over orientations."""
    y, x = ((np.arange(n) - n // 2) * dx for n in shares.shape)
    angle = 2 * np.pi * (np.arange(orientations) + 0.5) / orientations
    found = []
    for f in frequencies:
        rows = np.exp(-2j * np.pi * np.outer(f * np.sin(angle), y))
        columns = np.exp(-2j * np.pi * np.outer(f * np.cos(angle), x))
        found.append(np.abs(np.sum(rows @ shares * columns, axis=1)).mean())
    return np.array(found)


def test_contrasts_between_the_grids_frequencies_are_the_pictures_own():
    """Contrasts change sign within one step of the frequency grid if light fills the window. Linear interpolation would
    have an error of 0.04 there.
    """
    result = optics.psf(LENS, [WAVELENGTH], FOCUS + 1.6e-4, dx=0.5e-6, shape=(145, 145), tolerance=1e-4)
    transfer = optics.mtf(result, tolerance=1)
    assert transfer.fx.size == 145  # the samples are fine enough
    middle = transfer.fx.size // 2
    grid = transfer.fx[middle + 1 : middle + 4]  # the first few
    f = np.linspace(0.3, 1.7, 8) * grid[0]
    exact = radial_means(transfer.shares.numpy()[0], result.dx, f, 128)
    off = np.abs(transfer.profile(f)[0] - exact).max()
    assert off < 1e-5 + 0.1 * transfer.predicted_error[0]
    lines = np.interp(f, np.append(0, grid), radial_means(transfer.shares.numpy()[0], result.dx, [0, *grid], 128))
    assert np.abs(lines - exact).max() > 0.02 > 10 * off


def sure_to(error):
    """Return the causes of contrasts with this error."""
    return ErrorCauses(np.array([error]), np.zeros(1), np.zeros(1))


def test_as_many_orientations_as_the_picture_needs():
    """The image of two points at the distance d has the contrast |cos(π f d cos θ)|, with 2 f d zeros (up to 60) within
    180°.
    """
    d, dx = 60, 1e-6
    shares = np.zeros((1, 81, 81))
    shares[0, 40, [40 - d // 2, 40 + d // 2]] = 0.5
    tensor = precision("float64").Tensor(shares)
    f = np.linspace(0.3, 0.5, 11) / dx
    fine, few = (radial_means(shares[0], dx, f, n) for n in (4096, 64))
    assert np.abs(few - fine).max() > 0.03
    found = MTF.from_shares(tensor, Grid((81, 81), dx), np.array([1e6]), sure_to(2e-3)).profile(f)[0]
    assert np.abs(found - fine).max() < 1e-3
    with pytest.raises(optics.AccuracyError, match="a mean over 1024 orientations has"):
        MTF.from_shares(tensor, Grid((81, 81), dx), np.array([1e6]), sure_to(1e-6)).profile(f)


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


def test_quality_says_what_its_steps_may_miss(monkeypatch):
    """The contrast of light that fills a wide window has a peak that is narrower than a step of the integral over
    frequency.
    """
    pupil = optics.Pupil(0.1e-3, thin_lens_focal_length=2e-3)
    result = optics.psf(pupil, [WAVELENGTH], 4e-3, dx=3e-6, shape=(101, 101))
    f, profile = np.linspace(0, 1.6e5, 8193), MTF.profile
    exact = np.trapezoid(optics.mtf(result, tolerance=0.05).profile(f)[0], f) / 1.6e5

    def without_errors(self, frequencies, with_error=False):
        found = profile(self, frequencies)
        return (found, np.zeros((1, len(frequencies)))) if with_error else found

    error_of_all = optics.image_quality(result, 1.6e5, with_error=True, tolerance=0.05)[1][0]
    monkeypatch.setattr(MTF, "profile", without_errors)
    (value,), (of_steps,) = optics.image_quality(result, 1.6e5, with_error=True, tolerance=0.05)
    assert 1e-5 < abs(value - exact) < of_steps
    assert error_of_all > of_steps


def turned(first, second):
    """Return the largest angle between phases [rad]."""
    return np.abs(np.angle(np.exp(1j * (first - second)))).max()


@pytest.mark.parametrize("shape", [(24, 31), (41, 40)])
def test_the_phase_is_that_of_the_fourier_sum_over_positions_on_the_sensor(shape):
    """The window lies off the axis, and coma makes the PSF lopsided. The opposite sign is wrong by radians."""
    rng = np.random.default_rng(shape)
    centre = tuple(rng.uniform(-3e-6, 3e-6, 2).tolist())
    lens = optics.Pupil(1e-3, thin_lens_focal_length=4e-3, wavefront=optics.Zernike({(3, 1): 0.08, (3, -1): 0.05}))
    result = optics.psf(lens, [500e-9, WAVELENGTH], dx=0.5e-6, shape=shape, centre=centre, tolerance=1e-4)
    transfer = optics.mtf(result, tolerance=1)
    assert transfer.phase.shape == transfer.mtf.shape
    rows, columns = (
        np.exp(-2j * np.pi * np.outer(f, at)) for f, at in ((transfer.fy, result.y), (transfer.fx, result.x))
    )
    otf = rows @ result.psf.astype(float) @ columns.T
    bright = transfer.mtf > 0.01  # elsewhere, rounding of the float32 PSF turns the phase by more than 1e-4
    assert bright.mean() > 0.2
    assert turned(transfer.phase[bright], np.angle(otf)[bright]) < 1e-4
    assert turned(transfer.phase[bright], np.angle(otf.conj())[bright]) > 1


def test_finer_and_wider_samples_leave_the_phase():
    """`mtf` recomputes coarse or narrow windows, whose sample n//2 then lies elsewhere."""
    how = {"wavelengths": [WAVELENGTH], "centre": (2e-6, -1e-6), "tolerance": 1e-4}
    lens = optics.Pupil(1e-3, thin_lens_focal_length=4e-3, wavefront=optics.Zernike({(3, 1): 0.05}))
    coarse = optics.mtf(optics.psf(lens, dx=2e-6, shape=(30, 30), **how), tolerance=0.02)
    fine = optics.mtf(optics.psf(lens, dx=0.5e-6, shape=(240, 240), **how), tolerance=0.02)
    at = slice(coarse.fx.size // 2, coarse.fx.size // 2 + 8)
    f = coarse.fx[at]
    near = np.array([np.abs(fine.fx - each).argmin() for each in f])
    slope = -2 * np.pi * 2e-6  # of an image at the centre of the window; coma turns the phase by less
    assert np.abs(fine.fx[near] - f).max() * abs(slope) < 0.2
    difference = coarse.phase[0, coarse.fy.size // 2, at] - fine.phase[0, fine.fy.size // 2, near]
    assert turned(difference, slope * (f - fine.fx[near])) < 0.1


def test_a_shift_turns_the_phase_and_defocus_reverses_contrast():
    """The source's direction moves the image to z tan θ (a paraxial estimate). Far out of focus, geometric optics gives
    the OTF 2 J1(a)/a with a = 2π f R dz/z, which is negative between its zeros at a = 3.83 and 7.02 (Goodman,
    Introduction to Fourier Optics, §6.4.4)."""
    slow = optics.Pupil(1e-3, thin_lens_focal_length=40e-3)
    angle = 1.5e-4
    aside = optics.mtf(
        optics.psf(slow, [WAVELENGTH], source_angle=(angle, 0), dx=4e-6, shape=(65, 65), tolerance=1e-4), tolerance=0.1
    )
    half, some = aside.fx.size // 2, aside.fx.size // 8
    right = -2 * np.pi * aside.fx[half : half + some] * 40e-3 * np.tan(angle)
    assert turned(aside.phase[0, half, half : half + some], right) < 0.02
    blurred = optics.mtf(
        optics.psf(slow, [WAVELENGTH], 44e-3, dx=5e-6, shape=(181, 181), tolerance=1e-3), tolerance=0.1
    )
    a = 2 * np.pi * np.abs(blurred.fx) * 1e-3 * 4e-3 / 40e-3
    phase = np.abs(blurred.phase[0, blurred.fy.size // 2])
    positive, negative = a < 3.4, (a > 4.4) & (a < 6.6)
    assert positive.sum() > 3
    assert negative.sum() > 3
    assert phase[positive].max() < 0.1
    assert phase[negative].min() > np.pi - 0.1


def test_the_phase_in_white_light_and_of_one_sample():
    lens = optics.Pupil(1e-3, thin_lens_focal_length=4e-3, wavefront=optics.Zernike({(3, 1): 0.05}))
    white = optics.white_psf(lens, waves=17, dx=0.5e-6, shape=(41, 41), tolerance=0.05)
    transfer = white.mtf(0.2)
    rows, columns = (
        np.exp(-2j * np.pi * np.outer(f, at)) for f, at in ((transfer.fy, white.y), (transfer.fx, white.x))
    )
    if transfer.fx.size == 41:
        otf, bright = rows @ white.psf.astype(float) @ columns.T, transfer.mtf > 0.05
        assert turned(transfer.phase[bright], np.angle(otf)[bright]) < 1e-3
    assert transfer.phase.shape == transfer.mtf.shape
    single = optics.mtf(optics.Eye(None, resolution=(3, 3)).psf(), tolerance=1)
    assert single.phase.shape == single.mtf.shape == (4, 1, 1)
    assert not single.phase.any()


def test_a_mixture_is_refused_if_the_contrasts_of_any_of_its_sums_are_uncertain():
    """A difference of two wavelengths with almost the same light has a far larger relative error than their sum."""
    lens = optics.Pupil(60e-6, thin_lens_focal_length=240e-6)
    seen = optics.psf(lens, [520e-9, 560e-9], dx=0.5e-6, shape=(65, 65), tolerance=1e-3)
    good, bad = np.array([1.0, 1.0]), np.array([1.0, -0.99])
    assert combined_mtf(seen, np.stack([good, good]), 0.02).mtf.shape[0] == 2
    for weights in ([bad], [good, bad], [bad, good]):
        with pytest.raises(optics.AccuracyError, match=r"tolerance = 0\.02: contrasts have errors of up to"):
            combined_mtf(seen, np.stack(weights), 0.02)


@pytest.mark.parametrize("again", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_window_that_is_too_wide_names_a_tolerance_that_works(again):
    pupil = optics.Pupil(1e-3, thin_lens_focal_length=5e-3, wavefront=optics.Zernike({(4, 0): 0.2}))
    seen = optics.psf(pupil, [550e-9], dx=0.7e-6, shape=(65, 65))
    seen = seen if again else replace(seen, requests=())
    with pytest.raises(optics.AccuracyError, match=r"; tolerance=0\.0\d+ needs fewer samples$") as refused:
        optics.mtf(seen, tolerance=1e-3)
    works = float(str(refused.value).rpartition("tolerance=")[2].split()[0])
    assert works <= (0.02 if again else 0.09)
    assert optics.mtf(seen, tolerance=works).predicted_error.max() <= works


def test_transfer_at_any_frequency_is_that_of_the_grid():
    pupil = optics.Pupil(30e-6, thin_lens_focal_length=2e-4, wavefront=optics.Zernike({(3, 1): 0.1}))
    view = {"dx": 0.5e-6, "shape": (33, 41), "centre": (2e-6, -1e-6)}
    found = optics.mtf(optics.psf(pupil, [500e-9, 600e-9], **view), tolerance=0.1)
    rows, columns = np.array([10, 20, 25]), np.array([12, 22, 20])
    otf = found.otf(found.fx[columns], found.fy[rows])
    assert np.abs(otf) == pytest.approx(found.mtf[:, rows, columns], abs=1e-6)
    assert np.angle(otf / np.exp(1j * found.phase[:, rows, columns])) == pytest.approx(0, abs=1e-5)
    with pytest.raises(ValueError, match="fx, fy: must be finite and at most"):
        found.otf(1e9, 0.0)
