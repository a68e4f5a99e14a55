"""The table of an eye's limits, against closed forms for an ideal lens."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from optics import AccuracyError, Eye, PhotonBudget, Pupil, ReceptorDynamics
from optics.eye import summary

F = Eye().sensor_distance


def lens(radius=25e-6, **options):
    return Eye(Pupil(radius, thin_lens_focal_length=F), bands=1, **options)


def circular_mtf(s):
    """Return 2/π (arccos s - s √(1 - s²)), where s is the frequency divided by the cut-off (Goodman, eq. 6-32)."""
    return 2 / math.pi * (math.acos(s) - s * math.sqrt(1 - s * s))


def test_angles_and_light():
    found = lens().describe()
    assert found.f_number == pytest.approx(F / 50e-6)
    assert found.relative_aperture == pytest.approx(0.25)
    assert found.throughput == pytest.approx(0.0625)
    assert found.strehl_ratio == pytest.approx(1, abs=0.02)
    assert found.interommatidial_angle_deg == pytest.approx(math.degrees(200e-6 / 15 / F))
    assert found.wavelength == pytest.approx(550e-9)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("before", "behind"), [(1.0, 1.336), (1.336, 1.336), (1.33, 1.5)])
def test_f_number_between_media_says_how_bright_the_image_is(before, behind):
    """The f-number is 1/(2 (n/n₀) sin θ) in the paraxial limit, because the irradiance of the image is π (n/n₀)² sin² θ
    times the radiance of the scene (Born & Wolf, §4.8).
    """
    pupil = Pupil(10e-6, thin_lens_focal_length=F * behind / before, medium_n=behind, object_n=before)
    eye = Eye(pupil, bands=1)
    sine = math.sin(math.atan(10e-6 / eye.retina_distance))
    assert eye.describe().f_number == pytest.approx(before / (2 * behind * sine), rel=2e-3)


@pytest.mark.parametrize(("order", "windows"), [(1, 2), (2, 4)])
def test_receptors_with_dynamics_count_photons_over_the_window_of_their_filter(order, windows):
    """White noise filtered by exp(-t/τ)/τ or t exp(-t/τ)/τ² has the variance of white noise averaged over a window of 2
    τ or 4 τ.
    """
    dynamics = ReceptorDynamics(30.0, order)
    slow = Eye(photon_budget=PhotonBudget(1.0, 0.02), dynamics=dynamics).describe()
    window = Eye(photon_budget=PhotonBudget(1.0, windows * 0.03)).describe()
    assert slow.photons == pytest.approx(window.photons)
    assert slow.noise == pytest.approx(window.noise)


def test_diffraction_limit_is_the_apertures_width_in_wavelengths():
    """The limit is D/λ cycles per radian for small angles, and exactly 2 sin θ f/λ on a flat retina."""
    found = lens(5e-6).describe()
    assert found.diffraction_cpd == pytest.approx(10e-6 / 550e-9 * math.pi / 180, rel=1e-3)


def test_sampling_limit_is_half_a_cycle_per_receptor():
    found = lens().describe()
    assert found.sampling_cpd == pytest.approx(1 / (2 * found.interommatidial_angle_deg))
    twice = lens(resolution=(30, 30)).describe()
    assert twice.sampling_cpd == pytest.approx(2 * found.sampling_cpd)


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.1, 0.4])
def test_noise_limit_inverts_the_circular_mtf(sigma):
    """The MTF at the limit is σ / a². The lens is slow, so that the window of its PSF contains many fringes, and the
    MTF is finely sampled.
    """
    eye = lens(50e-6, noise_sigma=sigma * 0.25, tolerance=1e-3)
    found = eye.describe()
    expected = brentq(lambda s: circular_mtf(s) - sigma, 1e-6, 1)
    assert found.noise == pytest.approx(sigma * 0.25)
    assert found.noise_cpd / found.diffraction_cpd == pytest.approx(expected, rel=0.02)


def test_each_limit_can_bind():
    assert lens().describe().binding == "sampling"
    assert lens(0.5e-6, noise_sigma=0.0).describe().binding == "diffraction"
    loud = lens(noise_sigma=0.06).describe()
    assert loud.binding == "noise"
    assert loud.acuity_cpd == loud.noise_cpd
    assert lens(noise_sigma=0.1).describe().acuity_cpd == 0  # 0.1 > a² = 0.0625: the signal is below the noise


def test_photons_set_the_noise():
    """The noise is √(σ² + T/N) for N photons at a signal of 1. White gives T N photons per receptor."""
    eye = lens(noise_sigma=0.0, photon_budget=PhotonBudget(illuminance=0.1))
    found = eye.describe()
    assert found.photons == pytest.approx(found.throughput * eye.photons.mean())
    assert found.noise == pytest.approx(found.throughput / math.sqrt(found.photons))
    assert replace(eye, noise_sigma=0.02).describe().noise == pytest.approx(math.hypot(found.noise, 0.02))


def test_quality_is_the_area_between_mtf_and_noise():
    """The reference is the integral T/f_N ∫ max(MTF - σ/T, 0) df of the closed form, by quadrature."""
    eye = lens(12e-6, resolution=(90, 90), noise_sigma=1.8e-3, tolerance=2e-3)
    found = eye.describe()
    light, s = 0.0144, np.linspace(0, 1, 20001)
    reach = found.sampling_cpd / found.diffraction_cpd
    contrast = np.array([circular_mtf(min(at * reach, 1.0)) for at in s])
    expected = light * np.maximum(contrast - 1.8e-3 / light, 0).mean()
    assert found.image_quality == pytest.approx(expected, rel=0.01)


def test_acceptance_angle_of_a_sharp_eye_is_its_receptors():
    found = lens(50e-6).describe()
    assert found.acceptance_angle_deg == pytest.approx(found.interommatidial_angle_deg, rel=0.02)
    assert Eye().describe().acceptance_angle_deg == pytest.approx(Eye().describe().interommatidial_angle_deg)


def test_acceptance_angle_is_that_of_the_kernel_cut_finely():
    """The reference is the PSF, convolved with the receptor, along the middle row at 15 places per receptor. With 4
    places, the angle would be 2 % wider.
    """
    eye, cells = lens(resolution=(63, 63)), 15
    field = eye.kernel(cells)[0].astype(np.float64)
    for _ in range(2):
        field = np.stack([np.convolve(row, np.ones(cells)) for row in field]).T
    row = field[np.unravel_index(field.argmax(), field.shape)[0]]
    above = row - row.max() / 2
    first, last = np.flatnonzero(above >= 0)[[0, -1]]
    width = (
        last - first + above[first] / (above[first] - above[first - 1]) + above[last] / (above[last] - above[last + 1])
    )
    expected = math.degrees(width * eye.receptor_pitch / cells / eye.sensor_distance)
    assert eye.describe().acceptance_angle_deg == pytest.approx(expected, rel=3e-3)


def test_acceptance_angle_of_a_small_pupil_is_the_airy_disks():
    """The Airy disk is 1.029 λ/D wide. A receptor of 0.3 λ/D widens it, and the variances add up (Snyder 1977)."""
    eye = lens(4e-6, resolution=(100, 100))
    airy, receptor = 1.029 * 550e-9 / 8e-6, 2e-6 / F
    found = math.radians(eye.describe().acceptance_angle_deg)
    assert airy < found < math.hypot(airy, receptor) * 1.02


def test_perfect_lens():
    found = Eye(noise_sigma=0.05).describe()
    assert found.diffraction_cpd == math.inf
    assert (found.strehl_ratio, found.image_quality) == (1.0, pytest.approx(0.95))
    assert found.binding == "sampling"
    assert found.noise_cpd == math.inf
    loud = Eye(noise_sigma=1.0).describe()
    assert (loud.noise_cpd, loud.image_quality) == (0.0, 0.0)


def test_the_table_names_every_limit():
    table = str(lens(photon_budget=PhotonBudget()).describe())
    for word in (
        "f/4.83",
        "Strehl",
        "diffraction",
        "sampling",
        "noise",
        "binding",
        "photons",
        "apart",
        "PSF",
        "predicted",
    ):
        assert word in table
    assert max(map(len, table.splitlines())) < 120


def test_what_the_light_cannot_tell_is_one_named_line(monkeypatch):
    """A value that cannot be computed is named in one line, and the rest of the table remains."""

    def refused(*_, **__):
        raise AccuracyError("tolerance = 0.02: contrasts have an error of up to 0.5")

    monkeypatch.setattr(summary, "image_quality", refused)
    monkeypatch.setattr(summary, "mtf", refused)
    described = lens().describe()
    assert math.isnan(described.image_quality)
    assert described.binding in ("diffraction", "sampling")
    assert math.isnan(described.acuity_cpd), "the unknown limit may be the lowest one"
    assert "at most 0.158 cycles/degree, sampling binds" in str(described)
    assert [line.split(":")[0] for line in described.unknown] == ["image quality", "limit by noise"]
    assert "not known (1)       image quality: tolerance = 0.02" in str(described)
    monkeypatch.undo()
    assert lens().describe().unknown == ()


def test_advice_is_for_who_can_follow_it(monkeypatch):
    """The table does not recommend changing dx, because an eye has no such argument."""

    def refused(*_, **__):
        raise AccuracyError("it needs 9 x 9 samples", "set dx=1e-07, shape=(9, 9)")

    monkeypatch.setattr(summary, "strehl_ratio", refused)
    [line] = lens().describe().unknown
    assert line == "Strehl ratio: it needs 9 x 9 samples; of optics.psf(eye.pupil), set dx=1e-07, shape=(9, 9)"
