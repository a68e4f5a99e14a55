"""MTF, Strehl ratio, encircled energy and image quality against closed forms."""

import numpy as np
import pytest

import optics
from optics.point_spread.concentration import FINE, _around
from validation import reference

WAVELENGTH, FOCAL_LENGTH = 550e-9, 240e-6


def ideal(f_number: float, dx: float, n: int, defocus: float = 0.0, **options) -> optics.PSFResult:
    pupil = optics.Pupil(aperture_radius=FOCAL_LENGTH / (2 * f_number), thin_lens_focal_length=FOCAL_LENGTH + defocus)
    return optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH, dx=dx, shape=(n, n), **options)


def circular_mtf(f: np.ndarray, cutoff: float) -> np.ndarray:
    """Return 2/π (arccos s - s √(1 - s²)) with s = f / cutoff (Goodman, eq. 6-32)."""
    s = np.clip(f / cutoff, 0, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))


def test_mtf_of_an_ideal_lens_is_the_overlap_of_two_disks():
    """The window of 400 µm loses 1 % of the light at f/8, which raises the contrasts at low frequencies by 1 %."""
    result = ideal(8, 1.6e-6, 257)
    transfer = optics.mtf(result)
    f = np.linspace(0.1, 1, 10) * transfer.cutoff[0]
    expected = circular_mtf(f, transfer.cutoff[0])
    measured = transfer.profile(f)[0]
    np.testing.assert_allclose(measured, expected, atol=0.01)
    wrong_cutoff = circular_mtf(f, 1.1 * transfer.cutoff[0])
    assert np.abs(measured - wrong_cutoff).max() > 0.03


def test_mtf_is_one_at_zero_frequency_and_nothing_beyond_the_cutoff():
    result = ideal(4, 0.8e-6, 257)
    transfer = optics.mtf(result)
    assert transfer.mtf[0, 128, 128] == pytest.approx(1)
    assert transfer.fx[128] == transfer.fy[128] == 0
    beyond = np.hypot(transfer.fx[None, :], transfer.fy[:, None]) > 1.1 * transfer.cutoff[0]
    assert transfer.mtf[0][beyond].max() < 2e-3


def test_all_that_arrives_is_what_a_small_window_measures_contrast_by():
    """Two rings contain 0.91 of the light. The missing light is computed; otherwise, contrasts would be uncertain by
    0.09.
    """
    result = ideal(8, 1.6e-6, 13)
    transfer, as_it_is = optics.mtf(result), optics.mtf(result, tolerance=1)
    f = np.array([0.3, 0.5, 0.7]) * transfer.cutoff[0]
    expected = circular_mtf(f, transfer.cutoff[0])
    assert np.abs(transfer.profile(f)[0] - expected).max() < 6e-3 < transfer.predicted_error[0] <= 0.02
    assert 0.05 < as_it_is.predicted_error[0] < 0.12
    assert as_it_is.fx.size == 13 < transfer.fx.size
    assert np.abs(as_it_is.profile(f)[0] - expected).max() < 0.02  # relative to all the light that arrives
    assert optics.mtf(result, 1.0).mtf.max() == 1
    np.testing.assert_allclose(optics.mtf(result, 1.0).predicted_error, transfer.predicted_error, atol=5e-3)
    with pytest.raises(ValueError, match=r"arriving = 0\.5: must be in"):
        optics.mtf(result, 0.5)
    with pytest.raises(ValueError, match=r"arriving has shape \(2,\): must be a number, or one per wavelength \(1,\)"):
        optics.mtf(result, [1.0, 1.0])


def test_mtf_keeps_the_order_of_axes():
    """A PSF that is wide along x has low contrasts along fx."""
    result = ideal(8, 2e-6, 65)
    x, y = result.x[None, :], result.y[:, None]
    stretched = np.exp(-(x**2) / (2 * 8e-6**2) - y**2 / (2 * 4e-6**2))[None] / (2 * np.pi * 8e-6 * 4e-6)
    transfer = optics.mtf(
        optics.PSFResult(stretched, 2e-6, result.wavelengths, FOCAL_LENGTH, result.pupil, result.plans), tolerance=1
    )
    along_x = np.interp(2e4, transfer.fx, transfer.mtf[0, 32])
    along_y = np.interp(2e4, transfer.fy, transfer.mtf[0, :, 32])
    assert along_x == pytest.approx(np.exp(-2 * (np.pi * 8e-6 * 2e4) ** 2), abs=0.02)
    assert along_y == pytest.approx(np.exp(-2 * (np.pi * 4e-6 * 2e4) ** 2), abs=0.02)


@pytest.mark.parametrize("f_number", [2, 4, 16])
def test_strehl_ratio_of_an_ideal_lens_is_one_at_any_aperture(f_number):
    """The exact peak is [ln(1 + t)/t]² times Airy's peak πR²/(λf)², where t = (R/f)². At f/2, the factor is 0.94."""
    result = ideal(f_number, 0.5e-6, 33)
    assert optics.strehl_ratio(result)[0] == pytest.approx(1, abs=1e-4)
    airy = result.pupil.area / (WAVELENGTH * FOCAL_LENGTH) ** 2
    t = (result.pupil.radius / FOCAL_LENGTH) ** 2
    assert result.psf.max() / airy == pytest.approx((np.log1p(t) / t) ** 2, rel=1e-3)
    if f_number == 2:
        assert result.psf.max() / airy == pytest.approx(0.941, abs=1e-3)


def test_strehl_ratio_under_defocus():
    """For W waves of defocus at the edge, the ratio is (sin(πW) / πW)² (Mahajan, Aberration Theory). The sensor of the
    f/8 lens is displaced by a twentieth of the focal length.
    """
    defocus = 0.05 * FOCAL_LENGTH
    result = ideal(8, 0.5e-6, 65, defocus)
    radius = result.pupil.aperture_radius
    waves = radius**2 / (2 * WAVELENGTH) * (1 / FOCAL_LENGTH - 1 / (FOCAL_LENGTH + defocus))
    on_axis = result.psf[0, 32, 32] / (result.psf.max() / optics.strehl_ratio(result)[0])
    assert on_axis == pytest.approx(np.sinc(waves) ** 2, rel=5e-3)


def test_encircled_energy_follows_airy_at_any_pitch():
    """The PSF at f/16 deviates from Airy's by 2e-3. Samples can be summed if they are at most 8.8 µm apart."""
    f_number = 16
    radius = FOCAL_LENGTH / (2 * f_number)
    radii = np.array([5e-6, 1.07e-5, 2e-5])
    expected = reference.airy_encircled_energy(radii, WAVELENGTH, radius, FOCAL_LENGTH)
    found = []
    for dx in (8e-6, 2e-6, 0.5e-6):
        n = 2 * int(30e-6 / dx) + 1
        value, error = optics.encircled_energy(ideal(f_number, dx, n), radii, with_error=True)
        found.append(value[0])
        assert error.max() < 3e-3
        assert np.abs(value[0] - expected).max() < 2e-3 + error.max()
    np.testing.assert_allclose(found[0], found[2], atol=3e-5)
    np.testing.assert_allclose(found[1], found[2], atol=3e-5)


def test_encircled_energy_follows_its_centre():
    result = ideal(4, 0.5e-6, 65)
    off = optics.encircled_energy(result, 2e-6, centre=(6e-6, 0))[0, 0]
    assert off < 0.1 * optics.encircled_energy(result, 2e-6)[0, 0]


def test_image_quality_trades_light_against_blur_and_noise():
    result = ideal(8, 2e-6, 129)
    clear = optics.image_quality(result, nyquist=2e4)[0]
    assert 0.8 < clear < 1
    assert optics.image_quality(result, nyquist=2e5)[0] < 0.7 * clear
    assert optics.image_quality(result, nyquist=2e4, throughput=0.5)[0] == pytest.approx(0.5 * clear)
    noisy = optics.image_quality(result, nyquist=2e4, throughput=0.5, noise_sigma=0.05)[0]
    assert noisy == pytest.approx(0.5 * (clear - 0.1), abs=1e-6)  # the floor is 0.05 / 0.5, below the MTF everywhere
    assert optics.image_quality(result, nyquist=2e4, throughput=0.0)[0] == 0


def test_bad_arguments_are_named():
    result = ideal(8, 2e-6, 33)
    with pytest.raises(ValueError, match=r"radii.*\[0, 3.2e-05\]"):
        optics.encircled_energy(result, 1e-3)
    with pytest.raises(ValueError, match="nyquist"):
        optics.image_quality(result, nyquist=0)
    with pytest.raises(ValueError, match="throughput"):
        optics.image_quality(result, nyquist=1e4, throughput=1.5)


@pytest.mark.parametrize("frequencies", [[], [np.nan], [1e5, np.inf], "1e5"])
def test_frequencies_that_are_none_are_named(frequencies):
    with pytest.raises(ValueError, match="frequencies"):
        optics.mtf(ideal(8, 2e-6, 33), tolerance=1).profile(frequencies)


def test_one_sample_has_no_profile():
    with pytest.raises(ValueError, match="must be at least 2 x 2"):
        optics.mtf(optics.Eye().psf()).profile([0.0])


def test_the_cutoff_is_the_mediums():
    """Wavelengths are shorter in water, so the same pupil resolves finer gratings: the cut-off frequency is higher by a
    third.
    """
    focus = 1.33 * FOCAL_LENGTH  # for a lens with this focal length in air
    pupil = optics.Pupil(15e-6, thin_lens_focal_length=focus, medium_n=1.33)
    result = optics.psf(pupil, [WAVELENGTH], focus, dx=1.3e-6, shape=(257, 257))
    transfer = optics.mtf(result)
    assert transfer.cutoff[0] == pytest.approx(2 * 15e-6 * 1.33 / WAVELENGTH / np.hypot(15e-6, focus))
    f = np.linspace(0.1, 1, 10) * transfer.cutoff[0]
    measured = transfer.profile(f)[0]
    np.testing.assert_allclose(measured, circular_mtf(f, transfer.cutoff[0]), atol=0.02)
    assert np.abs(measured - circular_mtf(f, transfer.cutoff[0] / 1.33)).max() > 0.1


def test_contrasts_know_how_much_light_a_mask_leaves_at_the_rim():
    """The derivative of contrasts with respect to the mask's width agrees with differences. It includes the evanescent
    light, which is proportional to the light at the rim.
    """
    import drjit as dr

    from tests.optics.device_types import Float64

    def total(waist):
        pupil = optics.Pupil(15e-6, thin_lens_focal_length=110e-6, mask=optics.GaussianMask(waist))
        view = {"sensor_distance": 120e-6, "dx": 0.6e-6, "shape": (40, 41), "dtype": "float64", "tolerance": 1e-5}
        seen = optics.mtf(optics.psf(pupil, [500e-9], **view), tolerance=0.05)
        return seen.profile([5e4, 2e5])

    waist = Float64(10e-6)
    dr.enable_grad(waist)
    dr.backward(dr.sum(total(waist).array))
    step = 1e-4 * 10e-6
    across = (np.sum(np.asarray(total(10e-6 + step))) - np.sum(np.asarray(total(10e-6 - step)))) / (2 * step)
    assert waist.grad[0] == pytest.approx(across, rel=2e-3)


def test_white_contrasts_know_it_too():
    """Contrast is relative to the light that arrives, which changes with a mask's width."""
    import drjit as dr

    from tests.optics.device_types import Float64

    def contrast(waist):
        pupil = optics.Pupil(15e-6, thin_lens_focal_length=120e-6, mask=optics.GaussianMask(waist))
        view = {"sensor_distance": 120e-6, "dx": 0.6e-6, "shape": (41, 41), "dtype": "float64", "tolerance": 1e-3}
        return optics.white_psf(pupil, **view).mtf(tolerance=0.05).profile([1e5])

    waist = Float64(10e-6)
    dr.enable_grad(waist)
    dr.backward(dr.sum(contrast(waist).array))
    step = 1e-4 * 10e-6
    across = (np.sum(np.asarray(contrast(10e-6 + step))) - np.sum(np.asarray(contrast(10e-6 - step)))) / (2 * step)
    assert waist.grad[0] == pytest.approx(across, rel=1e-2)  # several times as large for a constant amount of light


@pytest.mark.parametrize("steepness", [2.3, 8.0])
def test_a_perfect_lens_is_perfect_however_wide(steepness):
    """The parameter is the ratio of radius and distance. Close to the pupil, the obliquity is not a polynomial, and
    more nodes are needed.
    """
    z = 100e-6
    pupil = optics.Pupil(steepness * z, thin_lens_focal_length=z)
    seen = optics.psf(pupil, [500e-9], sensor_distance=z, dx=0.05e-6, shape=(33, 33), tolerance=1e-4)
    ratio, error = optics.strehl_ratio(seen, with_error=True)
    assert abs(ratio[0] - 1) < error[0] < 1e-4


@pytest.mark.parametrize(
    "measure", [optics.mtf, optics.strehl_ratio, lambda seen: optics.encircled_energy(seen, 1e-6)], ids=["m", "s", "e"]
)
def test_a_batch_is_no_picture(measure):
    with pytest.raises(ValueError, match="result is a ndarray: must be a PSFResult, or a WhitePSF"):
        measure(np.ones((1, 9, 9)))
    batch = optics.psf_batch([optics.Pupil(1e-5, thin_lens_focal_length=1e-4)], shape=(33, 33))
    with pytest.raises(ValueError, match=r"is a PSFBatch: must be a PSFResult, as its `result\(eye\)` is, or a WhiteP"):
        measure(batch)


def test_a_mean_of_a_mean_is_the_mean():
    pupil = optics.Pupil(30e-6, thin_lens_focal_length=240e-6)
    seen = optics.psf(pupil, [450e-9, 550e-9], dx=0.5e-6, shape=(33, 33)).mean([0.3, 0.7])
    assert optics.strehl_ratio(seen.mean([1.0])) == optics.strehl_ratio(seen)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("dx", [0.5e-6, 3e-6])
def test_samples_extend_beyond_a_circle_by_the_reach_of_its_soft_edge(share, dx):
    """This holds on all four sides of the window, also for a circle that is not in the middle of the window."""
    result = ideal(4, dx, 9)
    middle = (0.3 * dx, -0.7 * dx)
    edge = float(result.x[-1]) - 0.7 * dx
    seen, kernel = _around(result, middle, share * edge, edge)
    needed = share * edge + kernel.reach / result.highest_cutoff
    sides = [middle[0] - seen.x[0], seen.x[-1] - middle[0], middle[1] - seen.y[0], seen.y[-1] - middle[1]]
    assert needed * (1 - 1e-9) <= min(sides)
    assert max(sides) <= needed + 1.001 * seen.dx
    assert seen.dx == pytest.approx(min(dx, FINE / result.highest_cutoff))
