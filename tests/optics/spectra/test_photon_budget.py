"""Photons per receptor: a hand-computed example, published conversions, and the noise statistics of an eye."""

import math
from dataclasses import replace

import numpy as np
import pytest

from optics import Eye, PhotonBudget, Pupil
from optics.spectra.bands import SpectralBands, daylight, pigment_absorptance

BRIGHT = PhotonBudget(illuminance=1e4, integration_time=0.02, quantum_efficiency=0.5)


def white(eye, samples, size):
    return np.broadcast_to(daylight(eye.spectral_bands.wavelengths)[:, None, None] * samples, (eye.bands, *size))


def test_daylight_carries_the_published_number_of_photons():
    """Sunlight of 54 lx has 1 µmol/m²/s of photons between 400 and 700 nm (Thimijan & Heins 1983, HortScience
    18:818).
    """
    wavelengths = np.arange(400, 701) * 1e-9
    energy = 6.62607015e-34 * 299792458.0 / wavelengths
    flux = float(np.sum(BRIGHT.spectral_irradiance * daylight(wavelengths) / energy)) * 1e-9
    assert flux / 6.02214e23 * 1e6 == pytest.approx(1e4 / 54, rel=0.03)


def test_a_hand_computed_example():
    """D = 200 µm, f = 241.4 µm, receptors of 13.3 µm: the sums step by step, at 10 nm.

    G = π/4 (200e-6)² (13.33e-6 / 241.4e-6)² = 3.1416e-8 x 3.0503e-3 = 9.583e-11 m² sr. Green receptors catch
    N = η Δt G/π Σ E λ/(hc) S 10 nm.
    """
    eye = Eye(photon_budget=BRIGHT)
    etendue = math.pi / 4 * 200e-6**2 * (200e-6 / 15 / (200e-6 / (2 * math.tan(math.pi / 8)))) ** 2
    assert etendue == pytest.approx(9.583e-11, rel=1e-3)
    nm = np.arange(400, 701, 10)
    flux = BRIGHT.spectral_irradiance * daylight(nm * 1e-9) * nm * 1e-9 / (6.626e-34 * 2.998e8)
    step = np.full(nm.size, 10e-9)
    step[[0, -1]] /= 2
    green = 0.5 * 0.02 * etendue / math.pi * np.sum(flux * pigment_absorptance(nm * 1e-9, 520e-9) * step)
    assert eye.photons[1] == pytest.approx(green, rel=2e-3)
    assert 1e7 < green < 2e7


@pytest.mark.parametrize("field", ["illuminance", "integration_time", "quantum_efficiency"])
def test_photons_are_proportional_to(field):
    twice = replace(BRIGHT, **{field: 2 * getattr(BRIGHT, field)})
    bands = SpectralBands.uniform(4)
    np.testing.assert_allclose(twice.photons(bands, 1e-10), 2 * BRIGHT.photons(bands, 1e-10))


def test_photons_grow_with_the_receptor_and_fall_with_the_focal_length():
    """The number of photons is proportional to (D d / f)² (Land). The number of bands has no effect."""
    eye = Eye(photon_budget=BRIGHT)
    np.testing.assert_allclose(replace(eye, bands=16).photons, eye.photons)
    np.testing.assert_allclose(replace(eye, resolution=(30, 30)).photons, eye.photons / 4)
    far = replace(eye, fov_deg=2 * math.degrees(math.atan(math.tan(math.radians(22.5)) / 2)))
    np.testing.assert_allclose(far.photons, eye.photons / 4)
    assert Eye().photons is None


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("radius", [50e-6, 25e-6])
@pytest.mark.parametrize("time", [1e-5, 4e-5])
def test_variance_is_the_mean_over_the_photons(radius, time):
    """The variance of a signal is its mean divided by N (Poisson distribution). The relative noise is therefore
    proportional to 1/a and to 1/√Δt. A Gaussian of fixed width would have the same variance in all four cases.
    """
    budget = PhotonBudget(illuminance=1e3, integration_time=time)
    lens = Pupil(radius, thin_lens_focal_length=Eye().sensor_distance)
    eye = Eye(lens, (40, 40), noise_sigma=0.0, photon_budget=budget)
    scene = white(eye, 1.0, (220, 220))
    clean, noisy = eye.see(scene, 4), eye.see(scene, 4, np.random.default_rng(0))
    middle = np.s_[:, 5:35, 5:35]
    for channel in range(3):
        residue = (noisy - clean)[middle][channel]
        mean = clean[middle][channel].mean()
        assert mean == pytest.approx((radius / 100e-6) ** 2, rel=0.02)
        assert residue.var() / mean == pytest.approx(1 / eye.photons[channel], rel=0.17)  # 900 draws: 3.5 sigma
        assert residue.mean() == pytest.approx(0, abs=4 * math.sqrt(mean / eye.photons[channel] / 900))


def test_dark_receptors_count_nothing_and_gaussian_noise_adds():
    dark = np.zeros((4, 120, 120))
    eye = Eye(resolution=(30, 30), noise_sigma=0.0, photon_budget=BRIGHT)
    assert not eye.see(dark, 4, np.random.default_rng(0)).any()
    loud = replace(eye, noise_sigma=0.1).see(dark, 4, np.random.default_rng(0))
    assert loud.std() == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize("field", ["illuminance", "integration_time", "quantum_efficiency"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "bright"])
def test_bad_budgets(field, value):
    with pytest.raises(ValueError, match=rf"{field} = .*: must"):
        PhotonBudget(**{field: value})


def test_bad_etendue():
    with pytest.raises(ValueError, match="etendue"):
        BRIGHT.photons(SpectralBands.uniform(1), 0.0)
