"""Measures in white daylight against numbers that were calculated by hand."""

from dataclasses import replace

import numpy as np
import pytest

import optics
from evolve.analysis.white_light import WhiteLight, eye_image_quality, white_strehl
from evolve.config.run_config import EyeConfig
from optics.eye.summary import daylight_psf
from tests.evolve.analysis.animals import phenotype

LENS = (0.2, 0.5, 0.5, 0.2, 0.5, 0.8, 0.8, 0.5, 0.5, 0.8, 0.8, 0.5, 0.2, 0.5, 0.5, 0.2)


def test_image_quality_of_the_perfect_lens_is_what_noise_leaves():
    perfect = phenotype(relative_aperture=None, relief=None, refractive_index=None)
    assert eye_image_quality(perfect, EyeConfig(optics=False, noise_sigma=0.05)) == pytest.approx(0.95)


def test_image_quality_knows_focus_light_and_noise():
    """A lens in focus is better than the same pupil without relief. If noise exceeds the light, the quality is 0."""
    focused = phenotype(relative_aperture=0.3, relief=LENS, resolution=(15, 15))
    flat = phenotype(relative_aperture=0.3, relief=(0.5,) * 16, resolution=(15, 15))
    calm, loud = EyeConfig(noise_sigma=0.0), EyeConfig(noise_sigma=0.1)
    quality = eye_image_quality(focused, calm)
    assert 0.7 * 0.09 < quality < 0.09  # the throughput a² = 0.09 times a contrast that the aperture keeps near 1
    assert eye_image_quality(flat, calm) < 0.7 * quality
    assert eye_image_quality(focused, loud) == 0.0  # the noise floor, 0.1 / 0.09, exceeds all contrast


def test_bands_are_weighted_by_daylight_and_receptors():
    eye = phenotype(relative_aperture=0.3, relief=LENS).eyes(EyeConfig(bands=2)).eye()
    psf = eye.psf()
    white = daylight_psf(eye, psf)
    assert white.psf.shape == (1, *psf.psf.shape[1:])
    blue, red = (float(band.sum()) for band in psf.psf)
    # Channels see white with weights of sum 1, shared by the bands: the mean weight is the share of the first band.
    share = float(np.mean(eye.spectral_bands.weights[:, 0])) * DAYLIGHT_475
    assert white.psf.sum() == pytest.approx(share * blue + (1 - share) * red, rel=1e-5)


@pytest.mark.parametrize("bands", [1, 4])
def test_lens_in_focus_has_strehl_1_in_white_light(bands):
    """The peak of a PSF is proportional to 1/λ². Over four bands of 400 to 700 nm, the peak at the mean wavelength is 5
    % lower than the mean of the peaks.
    """
    plain = optics.Eye(bands=bands)
    eye = optics.Eye(optics.Pupil(30e-6, thin_lens_focal_length=plain.sensor_distance), bands=bands)
    psf = eye.psf()
    assert white_strehl(eye, psf) == pytest.approx(1.0, abs=0.01), "beyond the eye's tolerance"
    assert optics.strehl_ratio(daylight_psf(eye, psf))[0] == white_strehl(eye, psf)
    white = daylight_psf(eye, psf)
    # an eye of a single wavelength
    unmixed = replace(white, shares=None, requests=white.requests if bands == 1 else ())
    by_mean_wavelength = float(optics.strehl_ratio(unmixed)[0])
    assert by_mean_wavelength == pytest.approx(1.0 if bands == 1 else 1.05, abs=0.02)


DAYLIGHT_475 = 1.15392  # CIE D65 at 475 nm over that at 560 nm: 115.392 / 100


def test_photons_count_in_image_quality():
    """Photon noise lowers the quality as much as in the eye's own table of limits."""
    animal, dusk = phenotype(relative_aperture=0.3, relief=LENS), EyeConfig(bands=2, illuminance=0.05)
    dim, bright = (eye_image_quality(animal, config) for config in (dusk, EyeConfig(bands=2)))
    assert dim < 0.9 * bright
    assert dim == pytest.approx(animal.eyes(dusk).eye().describe().image_quality, rel=1e-3)


def test_measures_share_one_mtf(monkeypatch):
    """Quality and contrast come from one MTF, whose PSF may have to be computed again on finer samples."""
    eye = phenotype(relative_aperture=0.3, relief=LENS).eyes(EyeConfig(bands=2)).eye()
    light = WhiteLight.from_eye(eye)
    own, computed = optics.mtf, []
    monkeypatch.setattr(optics, "mtf", lambda result: computed.append(result) or own(result))
    assert light.image_quality == pytest.approx(eye_image_quality_from_psf(light), rel=1e-6)
    assert light.contrast == own(light.white).profile(np.array([light.nyquist / 2]))[0, 0]
    assert len(computed) == 1


def eye_image_quality_from_psf(light):
    white = light.eye.white_signal
    return float(optics.image_quality(light.white, light.nyquist, white, light.eye.noise_sigma)[0])
