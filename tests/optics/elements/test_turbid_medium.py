"""Water and fog: published coefficients, light in few bands against integrals over the spectrum, and bad input."""

import numpy as np
import pytest

import optics
from optics.elements.turbid_medium import MEDIA_OF_WORLDS
from optics.spectra.spectrum import Spectrum, daylight, water_absorption


def test_pure_water_absorbs_as_published():
    # Pope & Fry (1997), table 3, and Smith & Baker (1981), table 1
    published = {310: 0.105, 370: 0.0300, 440: 0.00635, 510: 0.0325, 550: 0.0565, 600: 0.2224, 700: 0.624, 750: 2.47}
    found = water_absorption().at(np.array(list(published)) * 1e-9)
    assert found == pytest.approx(list(published.values()), rel=1e-6)


@pytest.mark.parametrize(("name", "published"), [("clear_ocean", 0.151), ("coastal_water", 0.398)])
def test_the_waters_attenuate_as_petzold_measured(name, published):
    # Petzold (1972), beam attenuation at 514 nm, as listed by Mobley (1994), table 3.10
    found = optics.turbid_medium(name).attenuation.at(np.array([514e-9]))[0]
    assert found == pytest.approx(published, rel=0.02)


def test_fog_leaves_two_percent_contrast_at_its_visibility():
    seen = optics.fog(80.0).in_bands(optics.SpectralBands.uniform(4, "rgb"), "rgb")
    black, horizon = (seen.through(np.zeros(4), np.array(d)) for d in (80.0, 1e9))
    assert (horizon - black) / horizon == pytest.approx(0.02)


def of_green_receptor(c, d):
    """Return the signal of a green receptor from a white surface, by Gauss-Legendre quadrature over intervals of 5
    nm.
    """
    receptors, (x, w) = optics.receptors_of("rgb"), np.polynomial.legendre.leggauss(4)
    starts = np.arange(*receptors.limits_nm, 5.0)
    nm, weights = (starts[:, None] + 2.5 * (x + 1)).ravel(), np.tile(w, len(starts))
    caught = receptors.catch(nm)[1] * weights
    return caught @ np.exp(-c.at(nm * 1e-9) * d) / caught.sum()


@pytest.mark.parametrize("bands", [1, 4, 16])
def test_the_error_of_few_bands_bounds_the_error_of_the_integral_over_the_spectrum(bands):
    water = optics.turbid_medium("clear_ocean")
    absorbing = optics.TurbidMedium(water.attenuation, Spectrum((500,), (0.0,)))
    few = optics.SpectralBands.uniform(bands, "rgb")
    medium, errors = absorbing.in_bands(few, "rgb"), []
    for d in (0.5, 5.0, 20.0):
        signal = few.weights @ medium.through(daylight(few.wavelengths), np.array(d))
        errors.append(abs(signal[1] - of_green_receptor(water.attenuation, d)))
    assert max(errors) <= absorbing.band_error(bands, "rgb") * 1.02 + 1e-4
    if bands == 1:
        assert max(errors) > 0.01  # attenuation within a broad band is not exponential


def test_at_short_distances_few_bands_are_exact():
    water = optics.sea_water(1.0)
    signals = []
    for bands in (4, 64):
        few = optics.SpectralBands.uniform(bands, "honeybee")
        white = daylight(few.wavelengths)
        medium = optics.TurbidMedium(water.attenuation, Spectrum((500,), (0.0,))).in_bands(few, "honeybee")
        signals.append(few.weights @ (white - medium.through(white, np.array(1e-4))) / 1e-4)
    assert signals[0] == pytest.approx(signals[1], rel=1e-3)


def test_grey_media_need_one_band():
    assert optics.fog(10.0).band_error(1, "lms") < 1e-6


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: optics.sea_water(-1), r"chlorophyll = -1.*must lie in \[0, 30"),
        (lambda: optics.fog(0.1), r"visibility = 0\.1.*must lie in \[1, "),
        (lambda: optics.turbid_medium("milk"), "medium = 'milk': must be one of 'air', 'clear_ocean'"),
        (lambda: optics.TurbidMedium(0.1, 0.2), "TurbidMedium: attenuation"),
        (lambda: optics.TurbidMedium(Spectrum((500,), (0.1,)), Spectrum((500,), (1.0,)), 1.33), "refractive_index"),
    ],
)
def test_bad_input_is_one_line(call, message):
    with pytest.raises(ValueError, match=message) as raised:
        call()
    assert "\n" not in str(raised.value)


def test_every_name_has_a_medium():
    assert [optics.turbid_medium(name) is None for name in MEDIA_OF_WORLDS] == [True, False, False, False]


# --- eyes in water

CORNEA = optics.Pupil(1e-3, medium_n=1.336, object_n=1.0, thin_lens_focal_length=22e-3)
WATER = optics.sea_water(1.0)


def test_an_eye_under_water_has_water_in_front_of_its_cornea_and_keeps_its_retina():
    eye = optics.Eye(CORNEA, (3, 3), fov_deg=40.0, sensor_width=4e-3)
    wet = optics.immersed(eye, WATER)
    assert wet.pupil.index_before(550e-9) == pytest.approx(1.3350, abs=1e-3)
    assert wet.retina_distance == pytest.approx(eye.retina_distance)
    # A point of the retina at the distance z behind the pupil has x = z n₀/n tan θ: tan θ is proportional to 1/n₀.
    edge = np.tan(np.radians(20.0)) / wet.pupil.index_before(550e-9)
    assert np.tan(np.radians(wet.fov_deg) / 2) == pytest.approx(edge)


def test_water_fills_eyes_without_another_medium():
    lens = optics.Pupil(20e-6, thin_lens_focal_length=optics.Eye().sensor_distance)
    eye = optics.Eye(lens, (15, 15))
    wet = optics.immersed(eye, WATER)
    assert wet.pupil.index_behind(550e-9) == pytest.approx(1.335, abs=1e-3)
    assert wet.fov_deg == eye.fov_deg
    # Waves are shorter in water, and the peak of a focused PSF is proportional to n² (Airy).
    peaks = [
        np.max(optics.psf(pupil, sensor_distance=eye.retina_distance, shape=(9, 9)).psf)
        for pupil in (eye.pupil, wet.pupil)
    ]
    assert peaks[1] / peaks[0] == pytest.approx(wet.pupil.index_behind(550e-9) ** 2, rel=0.02)


def test_air_and_perfect_lenses_do_not_change():
    eye, perfect = optics.Eye(CORNEA, (3, 3), sensor_width=4e-3), optics.Eye(resolution=(3, 3))
    assert optics.immersed(eye, None) is eye
    assert optics.immersed(eye, optics.fog(20)) is eye
    assert optics.immersed(perfect, WATER) is perfect
