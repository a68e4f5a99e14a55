"""Masks and cut openings behind a lens: closed forms, independent methods, and derivatives."""

import math

import drjit as dr
import numpy as np
import pytest

import optics
from optics import GaussianMask, MaskMap, Pupil, Rings
from tests.optics.device_types import Float64, TensorXf64
from validation.reference import relative_l2

R, F, WAVE = 60e-6, 1e-3, 550e-9
ASKED = {"wavelengths": [WAVE], "sensor_distance": F, "dx": 1.5e-6, "shape": (21, 21)}
TELESCOPE = optics.difference(optics.Annulus(0.3), optics.Spider(3, 0.06))


def lens(mask=None, **others):
    return Pupil(R, thin_lens_focal_length=F, mask=mask, **others)


def smooth(side=40):
    """Return smooth amplitudes without any symmetry."""
    at = (np.arange(side) + 0.5) * 2 / side - 1
    x, y = at[None, :], at[:, None]
    return 0.6 + 0.3 * np.sin(2.1 * x + 0.4) * np.cos(1.3 * y) - 0.1 * y


def test_a_gaussian_beam_stays_one():
    """A Gaussian beam of waist w, with the intensity exp(-2r²/w²), has the waist λf/πw in the focus if the pupil does
    not cut it off.
    """
    waist = R / 4
    result = optics.psf(lens(GaussianMask(waist)), **ASKED, tolerance=1e-5)
    focus = WAVE * F / (math.pi * waist)
    r2 = result.x[None, :] ** 2 + result.y[:, None] ** 2
    closed = 2 / (math.pi * focus**2) * np.exp(-2 * r2 / focus**2) * waist**2 / (2 * R**2)
    assert relative_l2(result.psf[0], closed) < 2e-3
    of_intensity = optics.psf(lens(GaussianMask(waist * math.sqrt(2))), **ASKED).psf[0]
    assert relative_l2(of_intensity, closed) > 0.5


def test_what_a_mask_lets_through():
    for waist in (R / 3, R, 3 * R):
        share = (1 - math.exp(-2 * R**2 / waist**2)) * waist**2 / (2 * R**2)
        assert lens(GaussianMask(waist)).transmission == pytest.approx(share, rel=1e-8)
    pupil = lens(GaussianMask(R / 2))
    wide = optics.psf(pupil, **{**ASKED, "shape": (61, 61)})
    assert wide.power[0] == pytest.approx(pupil.transmission, rel=2e-3)
    assert optics.strehl_ratio(wide)[0] == pytest.approx(1, abs=1e-3)
    eye = optics.Eye(pupil=optics.Pupil(R, mask=GaussianMask(R / 2)))
    assert eye.throughput == pytest.approx((2 * R / 200e-6) ** 2 * pupil.transmission)


@pytest.mark.parametrize("waveguide", [None, optics.Waveguide(2e-6)])
def test_signals_hold_a_masks_share_once(waveguide):
    """An even mask that halves the amplitude passes a quarter of the light, both in the reported white signal and in
    the rendered signals. The tolerance is a tenth of the kernels' tolerance. If the mask were counted twice, the
    signals would be a sixteenth.
    """
    plain, masked = (
        optics.Eye(optics.Pupil(30e-6, thin_lens_focal_length=240e-6, mask=mask), (3, 3), bands=1, waveguide=waveguide)
        for mask in (None, MaskMap(np.full((4, 4), 0.5), reach=40e-6))
    )
    scene = np.ones((1, 6, 6))
    np.testing.assert_allclose(masked.see(scene, 2), plain.see(scene, 2) / 4, rtol=1e-3)
    assert masked.white_signal == pytest.approx(plain.white_signal / 4, rel=1e-5)


def test_a_masks_share_has_its_derivative_each_time():
    """A graph of derivatives can be used for one backward pass only. If it were cached, the second pass would give no
    derivative.
    """
    waist, found = Float64(R / 2), []
    dr.enable_grad(waist)
    pupil = lens(GaussianMask(waist))
    for _ in range(2):
        dr.set_grad(waist, 0.0)
        dr.backward(pupil.transmission)
        found.append(waist.grad[0])
    assert found[0] > 0
    assert found[1] == found[0]


@pytest.mark.parametrize("of", ["waist", "samples", "radius"])
def test_a_share_that_was_told_before_has_its_derivative_once_it_is_asked_for(of):
    """The first request returns a plain number, which must not be cached for the second one. The derivative ∂T/∂w is
    compared with that of the closed form T = w²/2R² (1 - e^{-2R²/w²}).
    """
    waist, radius = Float64(R / 2), Float64(R)
    samples = TensorXf64(np.full((4, 4), 0.5))
    mask = MaskMap(samples) if of == "samples" else GaussianMask(waist if of == "waist" else R / 2)
    pupil = Pupil(radius if of == "radius" else R, thin_lens_focal_length=F, mask=mask)
    known, asked = pupil.transmission, {"waist": waist, "samples": samples, "radius": radius}[of]
    assert type(known) is float
    dr.enable_grad(asked)
    dr.backward(pupil.transmission)
    by_waist = 2 / (R / 2) * (known - math.exp(-8))
    expected = {"waist": by_waist, "samples": 1.0, "radius": -by_waist / 2}[of]
    assert dr.grad(asked).numpy().sum() == pytest.approx(expected, rel=1e-6)


def test_contrast_behind_a_gaussian_is_gaussian():
    """The OTF is the autocorrelation of the amplitude, exp(-(λfF)²/2w²) at the frequency F. It is 1 at F = 0, however
    much light the mask transmits.
    """
    waist = R / 4
    found = optics.mtf(optics.psf(lens(GaussianMask(waist)), **{**ASKED, "shape": (61, 61)}))
    closed = np.exp(-((WAVE * F * found.fx) ** 2) / (2 * waist**2))
    assert found.predicted_error[0] <= 0.02
    np.testing.assert_allclose(found.mtf[0, found.fx.size // 2], closed, atol=2e-3)


def test_samples_of_a_gaussian_are_one():
    side = 48
    at = ((np.arange(side) + 0.5) * 2 / side - 1) * 1.1 * R
    samples = np.exp(-(at[None, :] ** 2 + at[:, None] ** 2) / (R / 2) ** 2)
    known, sampled = (
        optics.psf(lens(mask), **ASKED, tolerance=1e-5).psf
        for mask in (GaussianMask(R / 2), MaskMap(samples, reach=1.1 * R))
    )
    assert relative_l2(sampled, known) < 1e-4


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("aperture", [TELESCOPE, optics.Circle(), Rings([0.2, 0.5, 0.7, 1.0])], ids=repr)
@pytest.mark.parametrize("method", ["low_rank", "far_field", "angular_spectrum", "split_angular_spectrum"])
def test_methods_agree(aperture, method):
    """Methods that sample a softened edge agree with the sum over quadrature nodes, which uses other points of the
    pupil.
    """
    pupil = lens(MaskMap(smooth()), aperture=aperture)
    exact = optics.psf(pupil, **ASKED, method="rayleigh_sommerfeld", tolerance=1e-6, dtype="float64").psf
    assert relative_l2(optics.psf(pupil, **ASKED, method=method, tolerance=1e-4).psf, exact) < 1e-5
    assert relative_l2(optics.psf(lens(aperture=aperture), **ASKED).psf, exact) > 0.1


@pytest.mark.parametrize("mask", [None, GaussianMask(R)], ids=["open", "gaussian"])
def test_rings_by_transforms_of_radii(mask):
    pupil = lens(mask, aperture=Rings([0.0, 0.3, 0.5, 0.8, 0.9, 1.0]))
    exact = optics.psf(pupil, **ASKED, method="rayleigh_sommerfeld", tolerance=1e-7, dtype="float64").psf
    found = optics.psf(pupil, **ASKED, method="hankel", tolerance=1e-6, dtype="float64").psf
    assert relative_l2(found, exact) < 1e-6


def test_a_zone_plate_has_a_focus():
    """Each edge of a zone contributes ± z/L e^{ikL} to the field on the axis, where L is its distance from there (first
    Rayleigh-Sommerfeld integral). A tenth of the light (1/π²) is in the focus.
    """
    z, radius = 2e-3, 100e-6
    plate = Rings.zone_plate(radius, z, WAVE)
    path = np.hypot(plate.radii * radius, z)
    field = np.sum(np.where(np.arange(len(path)) % 2, -1, 1) * z / path * np.exp(2j * np.pi * path / WAVE))
    result = optics.psf(Pupil(radius, aperture=plate), [WAVE], z, dx=1e-6, shape=(41, 41), tolerance=1e-4)
    area = plate.area * radius**2
    assert result.psf[0, 20, 20] == pytest.approx(abs(field) ** 2 / area, rel=1e-4)
    # The share refers to the light on the whole disk, not only to that on the open half.
    focus = optics.encircled_energy(result, 8e-6)[0, 0] * plate.area / math.pi
    assert focus == pytest.approx(1 / math.pi**2, rel=0.1)
    assert abs(field) ** 2 == pytest.approx(len(path) ** 2, rel=0.05)


@pytest.mark.slow
def test_pixels_and_masks_go_together():
    steps = optics.PixelRelief(np.random.default_rng(0).random((5, 5)) * 0.5e-6)
    pupil = Pupil(R, steps, mask=MaskMap(smooth()), aperture=TELESCOPE)
    exact = optics.psf(pupil, **ASKED, method="rayleigh_sommerfeld", tolerance=1e-6, dtype="float64").psf
    assert relative_l2(optics.psf(pupil, **ASKED, method="low_rank", tolerance=1e-4).psf, exact) < 1e-5


def test_vector_theory_sees_masks_and_rings():
    """It agrees with scalar theory at an aperture of NA 0.1."""
    wide = {"aperture_radius": 0.2e-3, "thin_lens_focal_length": 2e-3}
    spot = optics.vector_focus(Pupil(**wide, mask=GaussianMask(0.1e-3)), shape=(9, 9), dx=1e-6)
    known = optics.psf(Pupil(**wide, mask=GaussianMask(0.1e-3)), dx=1e-6, shape=(9, 9)).psf[0]
    assert relative_l2(spot.psf, known) < 0.02
    rings = Pupil(**wide, aperture=Rings([0, 0.5, 0.7, 1.0]))
    spot = optics.vector_focus(rings, shape=(9, 9), dx=1e-6)
    assert relative_l2(spot.psf, optics.psf(rings, dx=1e-6, shape=(9, 9)).psf[0]) < 0.02
    assert relative_l2(spot.psf, optics.psf(Pupil(**wide), dx=1e-6, shape=(9, 9)).psf[0]) > 0.1


def slope(value_at, value, step):
    number = Float64(value)
    dr.enable_grad(number)
    dr.backward(dr.sum(value_at(number)))
    numeric = (value_at(value + step) - value_at(value - step)) / (2 * step)
    return float(dr.grad(number)[0]), float(np.sum(numeric))


@pytest.mark.parametrize("measure", ["psf", "strehl", "mtf", "throughput"])
def test_derivative_by_the_waist(measure):
    def value(waist):
        pupil = lens(GaussianMask(waist))
        if measure == "throughput":
            return optics.Eye(pupil=pupil).throughput * 1.0
        result = optics.psf(pupil, **{**ASKED, "sensor_distance": 1.3 * F}, tolerance=1e-6, dtype="float64")
        if measure == "psf":
            return result.tensor.array if isinstance(waist, Float64) else result.psf
        if measure == "strehl":
            found = optics.strehl_ratio(result)
        else:
            found = optics.mtf(result, tolerance=0.3).profile([2e4])
        return found.array if isinstance(waist, Float64) else found

    found, numeric = slope(value, R / 2, 1e-9)
    assert found == pytest.approx(numeric, rel=2e-3)
    assert abs(found) > 1


def test_derivative_by_samples():
    samples = TensorXf64(smooth(6))
    dr.enable_grad(samples)
    result = optics.psf(lens(MaskMap(samples)), **ASKED, tolerance=1e-6, dtype="float64")
    dr.backward(result.tensor[0, 10, 10])
    more, less = (smooth(6) + step * (np.arange(36).reshape(6, 6) == 15) for step in (1e-4, -1e-4))
    middle = [
        optics.psf(lens(MaskMap(each)), **ASKED, tolerance=1e-6, dtype="float64").psf[0, 10, 10]
        for each in (more, less)
    ]
    assert dr.grad(samples).numpy()[2, 3] == pytest.approx((middle[0] - middle[1]) / 2e-4, rel=1e-4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GaussianMask(0), "waist = 0"),
        (lambda: MaskMap(np.ones(4)), r"samples has shape \(4,\): must be \(rows, columns\)"),
        (lambda: MaskMap(2 * np.ones((4, 4))), "samples reach 2.0"),
        (lambda: MaskMap(np.repeat([[0.0], [1.0]], 8, axis=0) @ np.ones((1, 16))), "samples jump"),
        (lambda: MaskMap([[np.nan]]), "samples holds NaN"),
        (lambda: MaskMap(np.ones((4, 4)), reach=-1), "reach = -1"),
        (lambda: lens(MaskMap(np.ones((4, 4)), reach=R / 2)), "mask is known over a radius of 3e-05 m"),
        (lambda: lens(0.5), "mask = 0.5"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_rays_do_not_judge_a_mask():
    """A mask that is narrow relative to its pupil spreads light in a way that rays cannot predict. Approximations by
    rays are therefore not chosen.
    """
    asked = {"tolerance": 0.3, "dx": 20e-6, "shape": (9, 9)}
    approximate = ("fresnel", "fraunhofer", "geometric", "pinhole")
    assert optics.plan(lens(GaussianMask(1e-6)), WAVE, F, **asked).method not in approximate
    for method in approximate[:3]:
        assert optics.plan(lens(GaussianMask(1e-6)), WAVE, F, **asked, method=method).predicted_error >= 1
