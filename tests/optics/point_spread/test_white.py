"""White light: the weights of light and receptors, against integrals of closed forms at every nanometre."""

import drjit as dr
import numpy as np
import pytest

import optics
from optics import AccuracyError, Pupil, Spectrum, Zernike
from tests.optics.device_types import Float64
from validation import reference

R, F = 60e-6, 6e-3
LENS = Pupil(R, thin_lens_focal_length=F)
COMA = Pupil(R, thin_lens_focal_length=F, wavefront=Zernike({(2, 0): 1.0, (3, 1): 0.2}))
GREEN = Spectrum((420.0, 540.0, 680.0), (0.0, 1.0, 0.0))
SMALL = {"dx": 8e-6, "shape": (15, 15), "tolerance": 1e-3}


def caught(light, kind, nm):
    return light.at(nm * 1e-9) * nm * kind.at(nm * 1e-9)


def mean(values, weight):
    return (values * weight).sum() / weight.sum()


@pytest.mark.parametrize("lamp", ["D65", "A", "FL11"])
def test_peak_is_airys_weighed_by_photons(lamp):
    """The peak at each wavelength is π R² / (λ f)²."""
    white = optics.white_psf(LENS, lamp, (GREEN, 600), waves=61, **SMALL)
    low, high = optics.receptors_of((GREEN, 600)).limits_nm
    nm = np.arange(low, high + 1)
    for found, kind in zip(white.psf[:, 7, 7], optics.receptors_of((GREEN, 600)).types, strict=True):
        peaks, weight = np.pi * R**2 / (nm * 1e-9 * F) ** 2, caught(optics.illuminant(lamp), kind, nm)
        assert found == pytest.approx(mean(peaks, weight), rel=1e-3)
        assert abs(mean(peaks, weight / nm) / found - 1) > 2e-3  # energy in place of photons
        if lamp == "A":
            assert abs(mean(peaks, kind.at(nm * 1e-9) * nm) / found - 1) > 1e-2  # without the lamp


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
    """A prism of dispersive glass leaves each colour sharp, but not white light."""
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


@pytest.mark.slow
def test_as_few_wavelengths_as_the_tolerance_allows():
    """The reference is a mean over PSFs at every second nanometre, computed one by one, with weights written out
    here."""
    nm = np.arange(420.0, 681, 2)
    weight = caught(optics.illuminant("D65"), GREEN, nm)
    each = np.stack([optics.psf(COMA, [at * 1e-9], **{**SMALL, "tolerance": 1e-5}).psf[0] for at in nm])
    exact = np.tensordot(weight / weight.sum(), each, axes=1)
    counts = []
    for tolerance in (1e-1, 1e-2, 1e-3):
        white = optics.white_psf(COMA, "D65", GREEN, **{**SMALL, "tolerance": tolerance})
        counts.append(len(white.waves.wavelengths))
        assert white.predicted_error[0] <= tolerance
        assert reference.relative_l2(white.psf[0], exact) <= white.predicted_error[0]
        assert [request.beam.wavelength for request in white.waves.requests] == list(white.waves.wavelengths)
        assert np.all(np.diff(white.waves.wavelengths) > 0)
    assert counts == sorted(counts)
    assert counts[0] < counts[2]


@pytest.mark.slow
def test_the_spectrums_error_falls_with_the_fourth_power(monkeypatch):
    """This holds for splines; linear interpolation between wavelengths would give the second power."""
    monkeypatch.setattr("optics.point_spread.white.LEFT", 1e-9)  # accept any number of wavelengths
    ask = {"dx": 8e-6, "shape": (9, 9), "tolerance": 1e-4}
    *found, exact = (optics.white_psf(COMA, "A", GREEN, waves=waves, **ask).psf[0] for waves in (9, 17, 33, 65))
    errors = [reference.relative_l2(each, exact) for each in found]
    assert reference.order_of_convergence([1 / 8, 1 / 16, 1 / 32], errors) > 3.7


def test_all_wavelengths_are_planned_as_the_first():
    white = optics.white_psf(LENS, "D65", GREEN, waves=9, **{**SMALL, "tolerance": 1e-2})
    assert white.waves.plans[0].why.endswith("cheapest method that meets the tolerance")
    assert all("same method as at the previous wavelength" in plan.why for plan in white.waves.plans[1:])


def test_measures_take_white_light():
    """Each measure agrees with its definition: sums over wavelengths of monochromatic values."""
    white = optics.white_psf(LENS, "A", "lms", dx=4e-6, shape=(41, 41), centre=(0.0, 0.0))
    (strehl, error), peaks = optics.strehl_ratio(white, with_error=True), white.psf[:, 20, 20]
    ideal = white.weights @ (np.pi * R**2 / (white.waves.wavelengths * F) ** 2)
    assert np.all(np.abs(strehl - peaks / ideal) < error + 1e-3)
    assert strehl == pytest.approx(1, abs=2e-3)
    radii = np.array([2e-5, 5e-5])
    energy, error = optics.encircled_energy(white, radii, with_error=True)
    for cone in range(3):
        for index, radius in enumerate(radii):
            airy = [reference.airy_encircled_energy(radius, at, R, F) for at in white.waves.wavelengths]
            assert energy[cone, index] == pytest.approx(white.weights[cone] @ airy, abs=error[cone, index] + 2e-3)
    contrast = optics.mtf(white)
    assert contrast.mtf.shape == white.mtf().mtf.shape == (3, *contrast.mtf.shape[1:])
    assert optics.image_quality(white, 1e4).shape == (3,)
    with pytest.raises(ValueError, match="arriving: must be None for a mixture"):
        optics.mtf(white, arriving=0.9)


def test_a_strehl_ratio_of_colours_side_by_side():
    """For dispersive glass, the peaks of different wavelengths are side by side. The result is the peak of the mean
    PSF, not the mean of the peaks.
    """
    x = np.linspace(-1, 1, 4) * 3 * R
    glass = optics.RefractiveIndex.from_abbe(1.5, 20)
    prism = Pupil(R, optics.BSplineRelief(np.outer(np.ones(4), 0.3 * x)), n=glass, thin_lens_focal_length=F)
    white = optics.white_psf(prism, "D65", GREEN, dx=8e-6, shape=(61, 61), centre=(0.15 * F, 0.0))
    ratio, error = optics.strehl_ratio(white, with_error=True)
    ideal = white.weights @ (np.pi * R**2 / (white.waves.wavelengths * F) ** 2)
    assert ratio == pytest.approx(white.psf.max(axis=(1, 2)) / ideal, rel=0.03)
    assert ratio[0] < 0.9 * (white.weights @ optics.strehl_ratio(white.waves))[0]
    assert 0 < error[0] < 0.05


@pytest.mark.slow
def test_measures_carry_derivatives():
    def measured(focus):
        white = optics.white_psf(
            Pupil(R, thin_lens_focal_length=focus), "D65", GREEN, 9, 1e-2, sensor_distance=F, dx=9e-6
        )
        return optics.strehl_ratio(white), optics.encircled_energy(white, 5e-5)

    step = 1e-6
    before, after = measured(5.5e-3 - step), measured(5.5e-3 + step)
    for index in range(2):
        asked = Float64(5.5e-3)
        dr.enable_grad(asked)
        dr.backward(dr.sum(measured(asked)[index].array))
        assert dr.grad(asked)[0] == pytest.approx(np.sum(after[index] - before[index]) / (2 * step), rel=5e-3)


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
        ({"light": lambda at: at - 500e-9}, "light: must be finite and not negative"),
        ({"light": lambda at: np.where(at > 500e-9, np.inf, 1)}, "light: must be finite and not negative"),
        ({"light": Spectrum((700.0, 701), (0.0, 1.0)), "receptors": (350,)}, "light: receptors of type 0 absorb none"),
        ({"waves": 30}, "waves = 30: must be odd"),
        ({"waves": 3}, r"waves = 3: must be a whole number in \[5, 513\]"),
        ({"wavelengths": [5e-7]}, "wavelengths: must not be given"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(ValueError, match=message):
        optics.white_psf(LENS, **{**SMALL, **arguments})


def test_too_few_wavelengths_are_refused():
    with pytest.raises(AccuracyError, match=r"5 wavelengths resolve the spectrum to .*; use waves="):
        optics.white_psf(LENS, waves=5, **SMALL)


def test_results_are_printed_in_a_line():
    """A result is printed as one line, without the contents of its arrays."""
    white = optics.white_psf(optics.Pupil(1e-3, thin_lens_focal_length=17e-3), dx=2e-6, shape=(9, 11))
    focus = optics.vector_focus(optics.Pupil(1e-3, thin_lens_focal_length=17e-3), dx=2e-6, shape=(9, 11))
    waves = f"<PSFResult {len(white.waves.wavelengths)} wavelengths, 9 x 11 samples 2e-06 m apart, predicted error "
    assert repr(white.waves).startswith(waves)
    assert repr(white).startswith(f"<WhitePSF of 3 types from {waves}")
    assert repr(focus).startswith("<VectorFocus 9 x 11 samples 2e-06 m apart, predicted error ")
    assert repr(white.mtf(tolerance=0.3)).startswith("<MTF of 3 wavelengths or types, to ")
    batch = optics.psf_batch([optics.Pupil(1e-5, thin_lens_focal_length=1e-4)], shape=(33, 31))
    field = optics.propagate(np.ones((9, 11)), dx=1e-6, wavelength=550e-9, distance=1e-5, tolerance=0.4)
    assert repr(batch).startswith("<PSFBatch of 1 x 1 x 1 x 33 x 31 samples 2.5e-07 m apart, predicted error ")
    assert repr(field).startswith("<PropagationResult of 9 x 11 samples 1e-06 m apart, angular_spectrum, predicted ")
    for result in (white, batch, field):
        picture = field.u if result is field else result.psf
        assert (result.y.size, result.x.size) == picture.shape[-2:]
        assert result.x[result.x.size // 2] == 0
    assert max(map(len, map(repr, (white, focus, batch, field)))) < 240
