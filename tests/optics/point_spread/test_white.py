"""White light: the weights of light and receptors, against integrals of closed forms at every nanometre."""

import drjit as dr
import numpy as np
import pytest
from drjit.auto.ad import Float64

import optics
from optics import AccuracyError, Pupil, Spectrum, Zernike
from validation import reference

R, F = 60e-6, 6e-3
LENS = Pupil(R, thin_lens_focal_length=F)
GREEN = Spectrum((420.0, 540.0, 680.0), (0.0, 1.0, 0.0))
SMALL = {"dx": 8e-6, "shape": (15, 15), "tolerance": 1e-3}


def caught(light, kind, nm):
    return light.at(nm * 1e-9) * nm * kind.at(nm * 1e-9)


def mean(values, weight):
    return (values * weight).sum() / weight.sum()


@pytest.mark.parametrize("lamp", ["D65", "A", "FL11"])
def test_peak_is_airys_weighed_by_photons(lamp):
    """π R² / (λ f)² of each wavelength."""
    white = optics.white_psf(LENS, lamp, (GREEN, 600), waves=61, **SMALL)
    low, high = optics.receptors_of((GREEN, 600)).limits_nm
    nm = np.arange(low, high + 1)
    for found, kind in zip(white.psf[:, 7, 7], optics.receptors_of((GREEN, 600)).types, strict=True):
        peaks, weight = np.pi * R**2 / (nm * 1e-9 * F) ** 2, caught(optics.illuminant(lamp), kind, nm)
        assert found == pytest.approx(mean(peaks, weight), rel=1e-3)
        assert abs(mean(peaks, weight / nm) / found - 1) > 2e-3  # energy in place of photons
        if lamp == "A":
            assert abs(mean(peaks, kind.at(nm * 1e-9) * nm) / found - 1) > 1e-2  # no lamp


def test_contrast_is_the_mean_of_disks():
    white = optics.white_psf(LENS, "D65", GREEN, waves=31, dx=10e-6, shape=(41, 41), tolerance=1e-3)
    transfer = white.mtf()
    nm = np.arange(420.0, 681)
    weight = caught(optics.illuminant("D65"), GREEN, nm)
    for f in (5e3, 1e4, 2e4):
        s = np.minimum(f * nm * 1e-9 * F / (2 * R), 1)
        disks = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
        assert transfer.profile([f])[0, 0] == pytest.approx(mean(disks, weight), abs=transfer.predicted_error[0])
    assert transfer.predicted_error[0] <= 0.02
    assert transfer.cutoff[0] >= 2 * R / (440e-9 * F)


def test_shifts_between_colours_blur():
    """A prism of dispersive glass: each colour is as sharp as before, white light is not."""
    x = np.linspace(-1, 1, 4) * 3 / 1 * R
    wedge = optics.BSplineRelief(np.outer(np.ones(4), 0.3 * x))
    glass = optics.RefractiveIndex.from_abbe(1.5, 20)
    prism = Pupil(R, wedge, n=glass, thin_lens_focal_length=F)
    where = {"dx": 8e-6, "shape": (41, 41), "centre": (0.15 * F, 0.0)}
    white = optics.white_psf(prism, "D65", GREEN, waves=41, **where)
    plain = optics.white_psf(LENS, "D65", GREEN, waves=41, dx=8e-6, shape=(41, 41))
    assert white.psf.max() < 0.9 * plain.psf.max()


def test_predicted_error_holds():
    pupil = Pupil(R, thin_lens_focal_length=F, wavefront=Zernike({(2, 0): 0.3, (3, 1): 0.2}))
    few, many = (
        optics.white_psf(pupil, "D65", "lms", waves=waves, **{**SMALL, "tolerance": 1e-2, "shape": (9, 9)})
        for waves in (31, 91)
    )
    for got, true, error in zip(few.psf, many.psf, few.predicted_error, strict=True):
        assert reference.relative_l2(got, true) < error < 0.02


def test_derivatives_flow():
    def bright(focus):
        white = optics.white_psf(
            Pupil(R, thin_lens_focal_length=focus), "D65", GREEN, 9, 1e-2, sensor_distance=F, dx=9e-6
        )
        return dr.sum(dr.square(dr.ravel(white.tensor)))

    asked = Float64(5.5e-3)
    dr.enable_grad(asked)
    dr.backward(bright(asked))
    step = 1e-6
    expected = (bright(5.5e-3 + step)[0] - bright(5.5e-3 - step)[0]) / (2 * step)
    assert dr.grad(asked)[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"light": "D66"}, "illuminant = 'D66': must be one of"),
        ({"light": 5}, "light = 5: must be an illuminant's name"),
        ({"light": lambda at: -at}, "light: must be finite and not negative"),
        ({"light": Spectrum((700.0, 701), (0.0, 1.0)), "receptors": (350,)}, "light: receptors of type 0 see nothing"),
        ({"waves": 30}, "waves = 30: must be odd"),
        ({"waves": 3}, r"waves = 3: must be a whole number in \[5, 401\]"),
        ({"wavelengths": [5e-7]}, "wavelengths: those of white light"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(ValueError, match=message):
        optics.white_psf(LENS, **{**SMALL, **arguments})


def test_too_few_wavelengths_are_refused():
    with pytest.raises(AccuracyError, match=r"5 wavelengths carry the spectrum to .*; ask for waves="):
        optics.white_psf(LENS, waves=5, **SMALL)


def test_results_are_printed_in_a_line():
    """Not with all that they hold, which is megabytes."""
    white = optics.white_psf(optics.Pupil(1e-3, thin_lens_focal_length=17e-3), dx=2e-6, shape=(9, 11))
    focus = optics.vector_focus(optics.Pupil(1e-3, thin_lens_focal_length=17e-3), dx=2e-6, shape=(9, 11))
    assert repr(white.waves).startswith("<PSFResult 31 wavelengths, 9 x 11 samples 2e-06 m apart, predicted error ")
    assert repr(white).startswith("<WhitePSF of 3 types from <PSFResult 31 wavelengths")
    assert repr(focus).startswith("<VectorFocus 9 x 11 samples 2e-06 m apart, scalar error ")
    assert max(map(len, map(repr, (white, focus)))) < 240
