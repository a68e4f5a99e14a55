"""Measures account for their sampling: coarse or narrow windows give the same numbers, or none, and predicted errors
hold."""

import math
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import optics
from tests.optics.device_types import Float64
from validation import reference
from validation.optics.random_cases import draw_case

WAVELENGTH = 550e-9
LENS, FOCUS = optics.Pupil(1e-3, thin_lens_focal_length=4e-3), 4e-3
APART = WAVELENGTH * FOCUS / 2e-3  # λz/2R, 1.1 µm


def focus(dx, n, **options):
    return optics.psf(LENS, [WAVELENGTH], FOCUS, dx=dx, shape=(n, n), **options)


@pytest.fixture(scope="module")
def fine():
    return focus(0.2 * APART, 287)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("dx", [3e-6, 1.1e-6, 0.55e-6, 2.2e-6])
def test_coarse_samples_measure_what_fine_ones_do(dx, fine):
    """Samples 3 µm apart would add up to a power of 5.7, so the PSF is computed again with finer samples."""
    n = 2 * round(31.5e-6 / dx / 2 - 0.5) + 1
    result = focus(dx, n)
    side = n * dx / 2
    inside = (np.abs(fine.x)[None, :] <= side) & (np.abs(fine.y)[:, None] <= side)
    held = (fine.psf[0] * inside).sum() * fine.dx**2
    assert abs(result.power[0] - held) < result.power_error[0] + 2e-3
    if dx == 3e-6:
        assert result.window_sums[0] > 5
    (strehl,), (error,) = optics.strehl_ratio(result, with_error=True)
    assert abs(strehl - 1) < error < 1e-3
    radii = np.array([0.61, 2.0]) * APART * 2
    (energy,), (errors,) = optics.encircled_energy(result, radii, with_error=True)
    np.testing.assert_allclose(energy, optics.encircled_energy(fine, radii)[0], atol=errors.max())
    transfer = optics.mtf(result)
    f = np.array([0.15, 0.5, 0.8]) * transfer.cutoff[0]
    off = np.abs(transfer.profile(f)[0] - reference.circular_mtf(f, WAVELENGTH, 1e-3, FOCUS))
    # f/2 departs from the paraxial form by 6e-3 at low frequencies
    assert off.max() < transfer.predicted_error[0] + 0.03
    quality, (error,) = optics.image_quality(result, 1e5, with_error=True)
    assert abs(quality[0] - optics.image_quality(fine, 1e5)[0]) < error < 0.02


def test_a_picture_that_nobody_can_look_at_again_is_refused_with_what_would_do():
    lost = replace(focus(3e-6, 21), requests=())
    wanted = r"needs \d+ x \d+ samples [\d.e-]+ m apart, and this PSF has 21 x 21 samples 3e-06 m apart: set dx="
    for measure in (
        lambda: lost.power,
        lambda: optics.strehl_ratio(lost),
        lambda: optics.encircled_energy(lost, 1e-5),
        lambda: optics.mtf(lost),
        lambda: optics.image_quality(lost, 1e5),
    ):
        with pytest.raises(optics.AccuracyError, match=wanted):
            measure()
    assert lost.window_sums[0] > 5


def test_a_mean_over_wavelengths_is_not_mistaken_for_one_of_them():
    result = optics.psf(LENS, [WAVELENGTH, 600e-9], FOCUS, dx=3e-6, shape=(21, 21))
    white = replace(result, tensor=result.psf.mean(axis=0)[None], wavelengths=np.array([575e-9]))
    assert result.can_recompute
    assert not white.can_recompute


@pytest.mark.slow
def test_a_mean_over_wavelengths_is_looked_at_again():
    """For coarse samples, the PSFs of all wavelengths are computed again on finer samples, so the measures are those of
    fine samples.
    """
    share = np.array([0.3, 0.7])
    coarse, fine = (
        optics.psf(LENS, [450e-9, 600e-9], FOCUS + 2e-5, dx=dx, shape=(n, n)).mean(share)
        for dx, n in ((3e-6, 21), (0.2e-6, 315))
    )
    assert coarse.wavelengths == pytest.approx([555e-9])
    assert coarse.highest_cutoff == pytest.approx(coarse.cutoff[0] * 555 / 450)
    assert coarse.window_sums[0] > 1.05 > 1 > coarse.power[0] == pytest.approx(fine.power[0], abs=2e-3)
    assert optics.strehl_ratio(coarse)[0] == pytest.approx(optics.strehl_ratio(fine)[0], rel=2e-3)
    f = np.array([0.1, 0.3, 0.6]) * fine.cutoff[0]
    assert optics.mtf(coarse).profile(f)[0] == pytest.approx(optics.mtf(fine).profile(f)[0], abs=0.02)
    each = optics.psf(LENS, [450e-9, 600e-9], FOCUS, dx=0.2e-6, shape=(51, 51))
    assert optics.strehl_ratio(each.mean(share))[0] == pytest.approx(1, abs=2e-3)
    with pytest.raises(ValueError, match=r"shares = .* must be 2 numbers that sum to 1"):
        each.mean(np.array([0.3, 0.3]))


def test_a_window_without_the_peak_has_no_strehl_ratio():
    beside = focus(0.3e-6, 9, centre=(2e-6, 0.0))  # the first dark ring is at 1.3 µm
    with pytest.raises(optics.AccuracyError, match="needs a window that contains the peak"):
        optics.strehl_ratio(beside)


def test_the_higher_of_two_lobes_is_found_between_samples():
    """The lobe with the lower sample can have the higher peak."""
    result = focus(0.45e-6, 41, source_angle=(0.05e-3, 0.03e-3))
    sampled = result.psf.max() / (focus(0.05e-6, 11).psf.max())
    assert sampled < 0.97
    assert optics.strehl_ratio(result)[0] == pytest.approx(1, abs=2e-3)


def test_even_windows_are_split_about_their_own_cells():
    """The middle of 20 samples is half a sample away from sample 10. Whether their number is even or odd, finer samples
    must fill the same cells.
    """
    off, whole = focus(3e-6, 20), focus(0.25e-6, 239, centre=(-1.5e-6, -1.5e-6))
    for pitch, parts in ((0.3e-6, 10), (0.29e-6, 11)):
        rim = 1.5e-6 - 1.5e-6 / parts
        assert off.with_pitch(pitch, "it").x[[0, -1]] == pytest.approx([off.x[0] - rim, off.x[-1] + rim])
    assert off.power[0] == pytest.approx(whole.power[0], abs=3e-4)


def test_a_strehl_ratio_looks_again_at_one_wavelength_at_a_time(monkeypatch):
    """Finer samples are computed once per wavelength, as if each PSF were known alone."""
    waves = [0.45e-6, 0.55e-6, 0.65e-6]
    result = optics.psf(LENS, waves, FOCUS, dx=3e-6, shape=(9, 9))
    asked, own = [], optics.PSFResult.recompute_on

    def counted(self, window, what):
        asked.append(len(self.requests))
        return own(self, window, what)

    monkeypatch.setattr(optics.PSFResult, "recompute_on", counted)
    together = optics.strehl_ratio(result)
    assert set(asked) == {1}
    alone = [optics.strehl_ratio(result.of_wavelength(index))[0] for index in range(3)]
    assert together == pytest.approx(alone, rel=1e-12)
    with pytest.raises(ValueError, match="index = 3"):
        result.of_wavelength(3)


@pytest.mark.slow
def test_measures_carry_derivatives_through_what_they_look_at_again():
    """Derivatives of power, Strehl ratio and encircled energy by the sensor distance, against central differences."""

    def measured(z):
        result = optics.psf(LENS, [WAVELENGTH], z, dx=3e-6, shape=(9, 9), dtype="float64", tolerance=1e-8)
        return result.power, optics.strehl_ratio(result), optics.encircled_energy(result, 4e-6)

    at, step = FOCUS + 4e-6, 2e-8
    before, after = measured(at - step), measured(at + step)
    for index in range(3):
        z = Float64(at)
        dr.enable_grad(z)
        value = measured(z)[index]
        dr.backward(dr.sum(value.array))
        expected = (np.sum(after[index]) - np.sum(before[index])) / (2 * step)
        assert dr.grad(z)[0] == pytest.approx(expected, rel=2e-3), index


@pytest.mark.parametrize("seed", range(4))
def test_predicted_errors_hold_on_random_pupils(seed):
    """Apertures and reliefs are random. The reference is a sum over ten samples per cycle, at a tolerance of 1e-5."""
    rng = np.random.default_rng(seed)
    while True:
        case = draw_case(rng)
        if 0.1 < case.fresnel_number < 10 and case.aperture < 0.4 and case.relief < 3e-6:
            break
    cutoff = 2 * case.aperture / WAVELENGTH
    n, pitch = 2 * int(rng.integers(5, 15)) + 1, rng.uniform(0.3, 1.6) * 0.5 / cutoff
    where = ([WAVELENGTH], case.distance)
    try:
        result = optics.psf(case.pupil, *where, dx=pitch, shape=(n, n), tolerance=10 ** rng.uniform(-3.5, -2))
    except optics.AccuracyError:
        return
    parts = 2 * math.ceil(pitch * cutoff / 0.2) + 1
    exact = {"dx": pitch / parts, "shape": (n * parts, n * parts), "tolerance": 1e-5, "dtype": "float64"}
    whole = optics.psf(case.pupil, *where, **exact)
    assert abs(result.power[0] - whole.psf.sum() * whole.dx**2) <= result.power_error[0]
    radius = 0.9 * n // 2 * pitch
    inside = np.clip((radius - np.hypot(whole.x, whole.y[:, None])) / whole.dx + 0.5, 0, 1)
    (energy,), (error,) = optics.encircled_energy(result, radius, with_error=True)
    assert abs(energy[0] - (whole.psf[0] * inside).sum() * whole.dx**2) <= error[0] + 2e-4


@pytest.mark.parametrize(
    ("pupil", "angle", "window"),
    [
        (optics.Pupil(30e-6, thin_lens_focal_length=240e-6), 0.1, {}),
        (
            optics.Pupil(1e-4, thin_lens_focal_length=2e-3, wavefront=optics.Zernike({(1, 1): 3.0})),
            0.0,
            {"dx": 2e-6, "shape": (41, 41)},
        ),
    ],
)
def test_a_side_lobe_does_not_pass_for_an_image_beside_the_window(pupil, angle, window):
    """Without the comparison with the points at which rays hit the sensor, the Strehl ratio would be 0.0015 with a
    predicted error of 1e-6.
    """
    seen = optics.psf(pupil, source_angle=(angle, 0.0), **window)
    with pytest.raises(
        optics.AccuracyError, match=r"rays land around .* outside the window, where the PSF is brighter"
    ):
        optics.strehl_ratio(seen)
    rays = seen.requests[0].problem.rays
    centre = float(np.median(rays.to_x)), float(np.median(rays.to_y))
    moved = optics.psf(pupil, source_angle=(angle, 0.0), centre=centre, **window)
    assert optics.strehl_ratio(moved)[0] > 0.95


def test_of_two_images_the_brighter_may_be_beside_the_window():
    """Behind a rounded ridge rays land on either side, and the axis, where their median lies, has little light."""
    ridge = np.linspace(-1, 1, 129)
    heights = 6e-6 * np.sqrt(ridge[None, :] ** 2 + 0.05**2) * np.ones((129, 1))
    pupil = optics.Pupil(25e-6, optics.HeightMap(heights), thin_lens_focal_length=240e-6)
    wide = optics.psf(pupil, sensor_distance=240e-6, dx=0.4e-6, shape=(151, 151), tolerance=1e-2)
    assert optics.strehl_ratio(wide)[0] > 0.15
    narrow = optics.psf(pupil, sensor_distance=240e-6, dx=0.2e-6, shape=(65, 65), tolerance=1e-2)
    with pytest.raises(optics.AccuracyError, match=r"outside the window, where the PSF is brighter"):
        optics.strehl_ratio(narrow)


def test_rays_that_land_in_one_point_land_there():
    """The result is the point itself, not half a cell of an empty range next to it."""
    seen = optics.psf(optics.Pupil(30e-6, thin_lens_focal_length=240e-6))
    rays = seen.requests[0].problem.rays
    together = replace(rays, to_x=np.full(len(rays), 2e-6), to_y=np.full(len(rays), -1e-6))
    np.testing.assert_allclose(together.densest(), [(2e-6, -1e-6)] * 2, rtol=1e-12)
