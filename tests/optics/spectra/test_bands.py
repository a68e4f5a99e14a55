"""Bands, daylight, pigments: the frozen tables against colour-science, the weights against fine quadrature."""

from types import SimpleNamespace

import numpy as np
import pytest

from optics import Eye, illuminant, reflectance
from optics.eye.band_choice import _reflectance_error, choose_bands
from optics.spectra.bands import SpectralBands, cie_1931, daylight, pigment_absorptance
from optics.spectra.receptors import receptors_of


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_frozen_tables_are_those_of_colour_science():
    colour = pytest.importorskip("colour")
    nm = np.arange(360, 781, 5)
    shape = colour.SpectralShape(360, 780, 5)
    d65 = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    np.testing.assert_allclose(daylight(nm * 1e-9), d65.values / d65[560], rtol=2e-5)
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    np.testing.assert_allclose(cie_1931(nm * 1e-9), cmfs.values, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("peak_nm", [360.0, 440.0, 520.0, 600.0])
def test_pigment_peaks_where_it_says(peak_nm):
    nm = np.arange(330.0, 750.0, 0.1)
    sensitivity = pigment_absorptance(nm * 1e-9, peak_nm * 1e-9)
    alpha = nm > peak_nm - 30
    assert abs(nm[alpha][np.argmax(sensitivity[alpha])] - peak_nm) < 2
    assert sensitivity[alpha].max() == pytest.approx(1, abs=0.02)
    assert pigment_absorptance(1.25 * peak_nm * 1e-9, peak_nm * 1e-9) < 0.01  # no red tail


@pytest.mark.parametrize("bands", [1, 3, 4, 8, 16])
def test_white_in_daylight_gives_one(bands):
    spectral = SpectralBands.uniform(bands)
    assert spectral.wavelengths.shape == (bands,)
    assert spectral.weights.shape == (3, bands)
    assert (spectral.weights >= 0).all()
    np.testing.assert_allclose(spectral.weights @ daylight(spectral.wavelengths), 1, rtol=1e-12)


def test_bands_converge_in_second_order():
    """For a smooth reflectance, bands of half the width have a quarter of the error."""

    def catch(bands):
        spectral = SpectralBands.uniform(bands)
        reflectance = 0.5 + 0.4 * np.sin(spectral.wavelengths / 60e-9)
        return spectral.weights @ (reflectance * daylight(spectral.wavelengths))

    exact = catch(60)
    errors = [np.abs(catch(bands) - exact).max() for bands in (8, 16)]
    assert errors[0] < 0.05
    assert 1.6 < np.log2(errors[0] / errors[1]) < 3.2


def test_channels_tell_colours_apart():
    """Red, green and blue light each give the largest signal in the channel of this colour."""
    spectral = SpectralBands.uniform(15)
    strongest = [
        np.argmax(spectral.weights[:, np.argmin(np.abs(spectral.wavelengths - nm))]) for nm in (640e-9, 530e-9, 440e-9)
    ]
    assert strongest == [0, 1, 2]


@pytest.mark.parametrize("bands", [0, -1, 2.5, 65])
def test_bad_bands(bands):
    with pytest.raises(ValueError, match=r"bands = .*\[1, 64\]"):
        SpectralBands.uniform(bands)


def test_wavelength_outside_the_tables():
    with pytest.raises(ValueError, match="wavelengths"):
        daylight(np.array([900e-9]))


def scene_signal(bands, reflectance):
    return bands.weights @ (reflectance(bands.wavelengths) * daylight(bands.wavelengths))


@pytest.mark.parametrize("tolerance", [0.1, 0.02, 0.005, 0.002])
def test_bands_for_a_tolerance_against_64(tolerance):
    """The reflectances are sinusoids of one cycle over the visible range, with all phases. The chosen bands are
    accurate enough, and half as many are not.
    """
    chosen = choose_bands(tolerance)
    count, fine = len(chosen.wavelengths), SpectralBands.uniform(64)

    def worst(bands):
        phases = np.linspace(0, 2 * np.pi, 60)
        waves = [lambda at, p=phase: (1 + np.cos(2 * np.pi * at / 300e-9 + p)) / 2 for phase in phases]
        return max(np.abs(scene_signal(bands, wave) - scene_signal(fine, wave)).max() for wave in waves)

    assert worst(chosen) <= tolerance
    assert count == 1 or worst(SpectralBands.uniform(count // 2)) > tolerance


def test_more_bands_for_a_smaller_tolerance():
    counts = [len(choose_bands(tolerance).wavelengths) for tolerance in (0.3, 0.05, 0.01, 0.003)]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_coloured_blur_needs_more_bands():
    """The kernel moves from cell to cell with increasing wavelength. The bands must resolve this movement."""

    def hopping(wavelengths):
        kernels = np.zeros((len(wavelengths), 1, 41))
        place = (np.asarray(wavelengths) - 400e-9) / 300e-9 * 12 + 14
        cell = np.floor(place).astype(int)
        kernels[np.arange(len(place)), 0, cell] = 1 - (place - cell)
        kernels[np.arange(len(place)), 0, cell + 1] = place - cell
        return np.repeat(kernels, 41, axis=1) / 41

    plain, coloured = choose_bands(0.1), choose_bands(0.1, kernels=hopping)
    assert len(coloured.wavelengths) > len(plain.wavelengths)
    mine, fine = (b.white_light(hopping(b.wavelengths)) for b in (coloured, SpectralBands.uniform(64)))
    difference = mine - fine
    worst = max(np.maximum(sign * difference, 0).sum(axis=(1, 2)).max() for sign in (1, -1))
    assert worst <= 0.1


def test_tolerances_that_no_bands_meet():
    with pytest.raises(ValueError, match="32 bands leave a predicted error of"):
        choose_bands(1e-6)
    with pytest.raises(ValueError, match="tolerance = 0"):
        choose_bands(0)


class TestLightInBands:
    """Lamps with spectral lines: quantum catches against quadrature at 1 nm, for any number of bands."""

    @staticmethod
    def caught(receptors, light):
        kinds = receptors_of(receptors)
        nm = np.arange(kinds.limits_nm[0], kinds.limits_nm[1] + 0.5)
        per_nm = kinds.catch(nm)
        return np.trapezoid(per_nm * light(nm * 1e-9) / daylight(nm * 1e-9)) / np.trapezoid(per_nm)

    @pytest.mark.parametrize("lamp", ["FL2", "FL11", "LED-B3", "A"])
    @pytest.mark.parametrize(("receptors", "bands"), [("rgb", 4), ("lms", 8), ("honeybee", 16)])
    def test_catches_are_exact(self, lamp, receptors, bands):
        eye = Eye(resolution=(1, 1), bands=bands, receptors=receptors)
        leaf, light = reflectance("foliage"), illuminant(lamp)
        for radiance, expected in (
            (light, self.caught(receptors, light.at)),
            (lambda at: leaf.at(at) * light.at(at), self.caught(receptors, lambda at: leaf.at(at) * light.at(at))),
        ):
            seen = eye.see(eye.in_bands(radiance)[:, None, None], 1)[:, 0, 0]
            np.testing.assert_allclose(seen, expected, rtol=1e-5)

    def test_samples_at_the_centres_miss_lines(self):
        """The wrong method has an error of up to a factor of two, so the test above is meaningful."""
        eye, light = Eye(resolution=(1, 1), bands=4), illuminant("FL2")
        seen = eye.see(light.at(eye.spectral_bands.wavelengths)[:, None, None], 1)[:, 0, 0]
        assert np.abs(seen / self.caught("rgb", light.at) - 1).max() > 0.5

    @pytest.mark.parametrize(("receptors", "bands"), [("rgb", 4), ("honeybee", 16), ("rgb", 64)])
    def test_daylight_stays_what_it_is_and_half_of_it_is_half(self, receptors, bands):
        spectral = SpectralBands.uniform(bands, receptors)
        for share in (1.0, 0.5):
            found = spectral.band_values(lambda at, share=share: share * daylight(at), receptors)
            np.testing.assert_allclose(found, share * daylight(spectral.wavelengths), rtol=1e-9)

    def test_no_band_is_below_0_where_none_may_be(self):
        bands, light = SpectralBands.uniform(8, "honeybee"), illuminant("FL11")
        free, bound = (bands.band_values(light, "honeybee", nonnegative=only) for only in (False, True))
        assert free.min() < -0.01
        assert bound.min() >= 0
        np.testing.assert_allclose(bands.weights @ bound, self.caught("honeybee", light.at), rtol=1e-4)

    def test_fewer_bands_than_types_meet_them_halfway(self):
        bands, light = SpectralBands.uniform(1), illuminant("FL2")
        caught, seen = self.caught("rgb", light.at), bands.weights @ bands.band_values(light, "rgb")
        assert np.ptp(seen) < 1e-9, "one band: white in FL2 appears grey"
        assert caught.min() < seen[0] < caught.max()


def test_an_error_of_reflectances_is_the_worst_channels():
    """The error of one of two channels is reported, although the other channel has none."""
    wavelengths = np.linspace(410e-9, 690e-9, 8)
    weights = np.vstack([np.full(8, 0.1), np.linspace(0.0, 0.2, 8)])
    exact = SimpleNamespace(wavelengths=wavelengths, weights=weights)
    wrong = SimpleNamespace(wavelengths=wavelengths, weights=weights * np.array([[1.0], [1.5]]))
    found = _reflectance_error(wrong, exact, (400.0, 700.0))
    phase = np.exp(2j * np.pi * wavelengths / 300e-9)
    assert found == pytest.approx(0.25 * abs(weights[1] @ (daylight(wavelengths) * phase)))
    assert found > 0.01


def test_light_that_is_no_spectrum_is_refused():
    with pytest.raises(ValueError, match="radiance = 'D65': must be a Spectrum"):
        SpectralBands.uniform(4).band_values("D65", "rgb")
    with pytest.raises(ValueError, match="radiance: must be finite at every wavelength"):
        SpectralBands.uniform(4).band_values(lambda wavelengths: wavelengths * np.nan, "rgb")
    with pytest.raises(ValueError, match=r"radiance: must be a number for each of \d+ wavelengths, not \[1, 2\]"):
        SpectralBands.uniform(4).band_values(lambda wavelengths: [1, 2], "rgb")
