"""Weights, errors and numbers of wavelengths of white light, from given samples, against formulas written out here."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics import AccuracyError, Pupil, Spectrum
from optics.numerics.precision import precision
from optics.point_spread import white
from optics.point_spread.modulation_transfer import MTF
from optics.point_spread.window_loss import ErrorCauses
from validation import reference

LENS = Pupil(60e-6, thin_lens_focal_length=6e-3)
GREEN = Spectrum((420.0, 540.0, 680.0), (0.0, 1.0, 0.0))


def test_the_quantum_catch_is_a_trapezoidal_mean_of_photons():
    kinds = SimpleNamespace(limits_nm=(500.0, 504.0), types=(GREEN, Spectrum((500.0, 504), (1.0, 0.0))))
    nm = np.arange(500.0, 505)
    for light in (Spectrum((500.0, 504), (1.0, 3.0)), lambda at: 1 + (at * 1e9 - 500) / 2):
        caught = white._quantum_catch(light, kinds)
        for row, kind in zip(caught, kinds.types, strict=True):
            expected = kind.at(nm * 1e-9) * nm * (1 + (nm - 500) / 2) * [0.5, 1, 1, 1, 0.5]
            np.testing.assert_allclose(row, expected / expected.sum())
    blind = SimpleNamespace(limits_nm=(500.0, 504.0), types=(GREEN, Spectrum((400.0, 401), (1.0, 0.0))))
    with pytest.raises(ValueError, match="light: receptors of type 1 absorb none of it"):
        white._quantum_catch("D65", blind)


def test_weights_are_integrals_of_splines_and_their_error_a_quarter_of_the_change():
    """A cubic polynomial of the wavelength is integrated exactly, with all wavelengths and with every second one."""
    ends, nodes = (500.0, 540.0), np.linspace(500, 540, 9)
    nm = np.arange(500.0, 541)
    caught = np.stack([np.full(41, 1 / 41), np.linspace(0, 2, 41) / 41])
    images = np.random.default_rng(0).random((9, 2, 3))
    found = white._weighed(SimpleNamespace(wavelengths=nodes * 1e-9, psf=images), caught, ends)
    for weights, cubic in ((found.weights, nodes), (found.coarse, nodes)):
        np.testing.assert_allclose(weights @ (cubic - 510) ** 3, caught @ (nm - 510) ** 3)
        np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert (found.coarse[:, 1::2] == 0).all()
    fine, coarse = (np.tensordot(weights, images, axes=1) for weights in (found.weights, found.coarse))
    for error, one, other in zip(found.spectral_error, fine, coarse, strict=True):
        assert error == pytest.approx(0.25 * reference.relative_l2(other, one))


def test_wavelengths_are_braided():
    """The second result has the wavelengths between those of the first."""
    first, between = (
        optics.psf(LENS, waves, dx=8e-6, shape=(3, 5), tolerance=1e-2)
        for waves in ([4e-7, 5e-7, 6e-7], [4.5e-7, 5.5e-7])
    )
    both = white._with_middles(first, between)
    assert both.wavelengths == pytest.approx([4e-7, 4.5e-7, 5e-7, 5.5e-7, 6e-7])
    np.testing.assert_array_equal(both.psf[::2], first.psf)
    np.testing.assert_array_equal(both.psf[1::2], between.psf)
    assert [request.beam.wavelength for request in both.requests] == list(both.wavelengths)
    assert (both.plans[::2], both.plans[1::2]) == (first.plans, between.plans)
    assert both.can_recompute
    for one, other in ((False, False), (True, False), (False, True)):
        both = white._with_middles(replace(first, for_window=one), replace(between, for_window=other))
        assert both.for_window is (one or other)


@pytest.fixture
def weighed():
    """White PSFs of two types from three wavelengths, with samples in place of computed PSFs."""
    images = np.random.default_rng(0).random((3, 4, 5))
    weights, coarse = np.array([[0.2, 0.3, 0.5], [0.7, -0.1, 0.4]]), np.array([[0.5, 0, 0.5], [0.6, 0, 0.4]])
    waves = SimpleNamespace(tensor=images, plan=SimpleNamespace(predicted_error=1e-3), mean=lambda row: row)
    return white.WhitePSF(waves, weights, coarse, np.array([0.01, 0.02]))


def test_errors_of_measures_include_the_spectrum(weighed, monkeypatch):
    np.testing.assert_allclose(weighed.psf, np.tensordot(weighed.weights, weighed.waves.tensor, axes=1))
    np.testing.assert_allclose(weighed.predicted_error, [0.01 + 1e-3 * 1.0, 0.02 + 1e-3 * 1.2])
    monkeypatch.setattr(white, "strehl_ratio", lambda row, with_error: (row[:1], row[1:2] / 100))
    ratio, error = weighed.strehl_ratio(with_error=True)
    np.testing.assert_array_equal(ratio, weighed.weights[:, 0])
    np.testing.assert_array_equal(weighed.strehl_ratio(), ratio)
    around = [np.linalg.norm(image) / image.max() for image in weighed.psf]
    np.testing.assert_allclose(error, weighed.weights[:, 1] / 100 + [0.01, 0.02] * np.array(around) * ratio)
    asked, energies, errors = [], np.arange(6.0).reshape(3, 2), np.arange(6.0).reshape(3, 2) / 100

    def energy(waves, radii, centre, with_error):
        asked.append((waves, radii, centre))
        return energies, errors

    monkeypatch.setattr(white, "encircled_energy", energy)
    value, error = weighed.encircled_energy([1, 2], (3.0, 4.0), with_error=True)
    assert asked == [(weighed.waves, [1, 2], (3.0, 4.0))]
    np.testing.assert_allclose(value, weighed.weights @ energies)
    np.testing.assert_array_equal(weighed.encircled_energy([1, 2]), value)
    change = np.abs(weighed.coarse @ energies - value)
    np.testing.assert_allclose(error, np.abs(weighed.weights) @ errors + change / 4)
    for measure in (weighed.strehl_ratio, lambda with_error: weighed.encircled_energy(1.0, None, with_error)):
        with pytest.raises(ValueError, match="with_error = 2"):
            measure(with_error=2)


@pytest.mark.parametrize("count", [1, 2])
def test_strehl_ratios_with_derivatives_are_joined(weighed, monkeypatch, count):
    """Ratios are tensors with one entry for each type."""
    tensor = precision("float64").Tensor
    one = replace(weighed, weights=weighed.weights[:count], spectral_error=weighed.spectral_error[:count])
    monkeypatch.setattr(white, "strehl_ratio", lambda row, with_error: (tensor(row[:1]), row[1:2] / 100))
    ratio = one.strehl_ratio()
    assert isinstance(ratio, tensor)
    np.testing.assert_array_equal(ratio.numpy(), weighed.weights[:count, 0])


def test_errors_of_contrasts_include_the_spectrum(weighed, monkeypatch):
    """The spectral error is a quarter of the largest change of any contrast."""
    contrasts = np.random.default_rng(1).random((4, 3, 3))
    causes = ErrorCauses(*(np.full(4, value) for value in (0.1, 0.2, 0.3)))
    tensor = precision("float64").Tensor(contrasts)
    f = np.array([-1.0, 0.0, 1.0])
    given = MTF(tensor, f, f, np.ones(4), causes.total, tensor, causes=causes)
    asked = []

    def combined(waves, weights, tolerance):
        asked.append((weights, tolerance))
        return given

    monkeypatch.setattr(white, "combined_mtf", combined)
    found = weighed.mtf(0.05)
    assert asked[0][1] == 0.05
    np.testing.assert_array_equal(asked[0][0], [*weighed.weights, *weighed.coarse])
    spectral = np.abs(contrasts[:2] - contrasts[2:]).max(axis=(1, 2)) / 4
    np.testing.assert_array_equal(found.mtf, contrasts[:2])
    np.testing.assert_allclose(found.predicted_error, 0.4 + spectral)
    np.testing.assert_allclose(found.causes.rest, 0.3 + spectral)
    np.testing.assert_allclose(found.causes.total, found.predicted_error)


@pytest.fixture
def planned(monkeypatch):
    """`white_psf` without PSFs: the fixture is called with the spectral errors of 9, 17 ... wavelengths."""
    asked = []

    def errors(*values):
        left = list(values)
        asked.clear()
        monkeypatch.setattr(white, "psf", lambda pupil, waves, tolerance: asked.append((waves, tolerance)) or waves)
        monkeypatch.setattr(white, "_with_middles", lambda first, between: np.sort([*first, *between]))
        monkeypatch.setattr(
            white, "_weighed", lambda waves, *_: SimpleNamespace(waves=waves, spectral_error=np.array([0, left.pop(0)]))
        )
        return asked

    return errors


def test_wavelengths_are_doubled_until_the_spectrum_is_resolved(planned):
    """Half of the tolerance is for the PSFs, and the rest for the spectrum."""
    asked = planned(0.0501, 0.0501, 0.05)
    found = optics.white_psf(LENS, receptors=GREEN, tolerance=0.1)
    np.testing.assert_allclose(found.waves, np.linspace(420e-9, 680e-9, 33))
    assert [(len(waves), tolerance) for waves, tolerance in asked] == [(9, 0.05), (8, 0.05), (16, 0.05)]
    asked = planned(0.05)
    optics.white_psf(LENS, receptors=GREEN, tolerance=0.1, waves=5)
    assert [len(waves) for waves, _ in asked] == [5]


@pytest.mark.parametrize(("waves", "worst"), [(5, 0.06), (21, 0.8), (257, 0.051)])
def test_advice_on_wavelengths_assumes_the_fourth_power(planned, waves, worst):
    planned(worst)
    more = waves * (1.2 * worst / 0.05) ** 0.25
    more = 2 * math.ceil(more / 2) + 1
    with pytest.raises(
        AccuracyError, match=rf"{waves} wavelengths resolve the spectrum to {worst:.2g}; use waves={more} "
    ):
        optics.white_psf(LENS, receptors=GREEN, tolerance=0.1, waves=waves)


def test_the_most_wavelengths_are_513(planned):
    asked = planned(*[1.0] * 6, 0.01)
    assert len(optics.white_psf(LENS, receptors=GREEN, tolerance=0.1).waves) == 513
    asked = planned(*[1.0] * 7)
    with pytest.raises(AccuracyError, match="513 wavelengths resolve the spectrum to 1; use a light or receptors"):
        optics.white_psf(LENS, receptors=GREEN, tolerance=0.1)
    assert len(asked) == 7


@pytest.mark.parametrize("waves", [513, "auto"])
@pytest.mark.parametrize(("tolerance", "worst", "enough"), [(0.1, 0.0701, 0.2), (1e-3, 6e-4, 0.002)])
def test_if_more_than_513_wavelengths_are_needed_the_advice_is_a_tolerance(planned, waves, tolerance, worst, enough):
    planned(*[worst] * 7)
    with pytest.raises(AccuracyError, match=rf"resolve the spectrum to {worst:.2g}; use tolerance={enough}$"):
        optics.white_psf(LENS, receptors=GREEN, tolerance=tolerance, waves=waves)
    planned(*[worst] * 7)
    optics.white_psf(LENS, receptors=GREEN, tolerance=enough, waves=waves)
