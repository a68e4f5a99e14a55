"""Receptor types and mosaics: quantum catches, an eye's signals, and an unchanged default."""

from dataclasses import replace

import numpy as np
import pytest

from optics import Eye, PhotonBudget, Pigment, Pupil, Receptors, Spectrum, receptors_of
from optics.spectra.bands import SpectralBands, daylight, pigment_absorptance

BAYER = ((0, 1), (1, 2))


def test_the_default_is_three_rgb_like_channels_from_400_to_700_nm():
    """All digits agree with an independent sum: pigments of 600, 520 and 460 nm, steps of 1 nm, and values that are
    linear between the centres of bands.
    """
    bands = SpectralBands.uniform(4)
    nm = np.arange(400.0, 700.5)
    catch = np.stack(
        [pigment_absorptance(nm * 1e-9, p * 1e-9) * nm * daylight(nm * 1e-9) for p in (600.0, 520.0, 460.0)]
    )
    catch[:, [0, -1]] /= 2
    centres = np.array([437.5, 512.5, 587.5, 662.5])
    linear_weights = np.stack([np.interp(nm, centres, row) for row in np.eye(4)])
    expected = (catch @ linear_weights.T) / catch.sum(axis=1, keepdims=True) / daylight(centres * 1e-9)
    assert np.array_equal(bands.weights, expected)
    assert np.array_equal(bands.wavelengths, centres * 1e-9)
    assert np.array_equal(Eye().spectral_bands.weights, expected)
    assert Eye().receptors == receptors_of("rgb")
    assert Eye().channels == 3
    assert Eye().mosaic is None


@pytest.mark.parametrize(
    ("receptors", "peaks"),
    [
        ("lms", (610, 530, 441)),
        ("honeybee", (544, 436, 344)),
        ("goldfish", (623, 537, 447, 356)),
        ("blowfly", (490, 335, 460, 430, 530)),
        ("dragonfly", (620, 515, 410, 340)),
        ("mouse", (508, 360)),
        ("jumping_spider", (520, 360)),
        ((350, 440, 530, 600), (350, 440, 530, 600)),
        (500, (500,)),
    ],
)
def test_channels_see_most_where_their_types_peak(receptors, peaks):
    """A reflector of 20 nm changes the channel with that peak most, relative to white. (Human L and M cones are so
    close to each other that the reflector has to be further to the red.)"""
    bands = SpectralBands.uniform(64, receptors)
    assert bands.weights.shape == (len(peaks), 64)
    np.testing.assert_allclose(bands.weights @ daylight(bands.wavelengths), 1, rtol=1e-12)
    for channel, peak in enumerate(peaks):
        light = np.exp(-(((bands.wavelengths * 1e9 - peak) / 10) ** 2))
        assert np.argmax(bands.weights @ light) == channel


def test_the_range_leaves_out_less_than_a_thousandth_at_either_end():
    nm = np.arange(300.0, 780.5)
    for name in ("lms", "honeybee", "goldfish"):
        kinds = receptors_of(name)
        low, high = kinds.limits_nm
        catch = kinds.catch(nm)
        for outside in (nm < low, nm > high):
            assert (catch[:, outside].sum(axis=1) <= 1e-3 * catch.sum(axis=1)).all()
        assert low % 10 == high % 10 == 0
    assert receptors_of("honeybee").limits_nm[0] < 330
    assert receptors_of("lms").limits_nm[0] >= 380
    assert Receptors((500,), range_nm=(400, 650)).limits_nm == (400, 650)


def test_a_measured_sensitivity_is_as_good_as_the_pigment_it_samples():
    nm = np.arange(300.0, 781.0)
    measured = Spectrum(nm, pigment_absorptance(nm * 1e-9, 450e-9))
    ours, theirs = (SpectralBands.uniform(8, Receptors((kind,), range_nm=(320, 700))) for kind in (measured, 450))
    np.testing.assert_allclose(ours.weights, theirs.weights, rtol=1e-10)


def scene(eye, samples, seed=0):
    """Return a scene of random patches, each as wide as a receptor, with a margin for the kernel."""
    height, width = (n + 8 for n in eye.resolution)
    patches = np.random.default_rng(seed).uniform(0.1, 1.0, (eye.bands, height, width))
    return patches.repeat(samples, axis=1).repeat(samples, axis=2)


@pytest.mark.parametrize("pupil", [None, Pupil(40e-6, thin_lens_focal_length=240e-6)], ids=["perfect", "lens"])
def test_a_mosaic_reports_each_receptors_own_type(pupil):
    every = Eye(pupil, (5, 7), receptors="honeybee", sensor_width=200e-6)
    mosaic = replace(every, receptors=every.receptors.arranged(BAYER))
    light = scene(every, 4)
    all_types, own = every.see(light, 4), mosaic.see(light, 4)
    assert own.shape == (1, 5, 7)
    assert mosaic.channels == 1
    layout = np.tile(np.array(BAYER), (3, 4))[:5, :7]
    assert np.array_equal(mosaic.mosaic, layout)
    np.testing.assert_array_equal(own[0], np.take_along_axis(all_types, layout[None], axis=0)[0])
    assert np.ptp(own) > 0.01


def test_shot_noise_of_a_mosaic_is_that_of_each_receptors_type():
    """Types catch different numbers of photons, so their noise differs."""
    budget = PhotonBudget(illuminance=1.0, integration_time=1e-4)
    kinds = Receptors((344.0, 544.0), mosaic=((0, 1),))
    eye = Eye(None, (60, 60), receptors=kinds, photon_budget=budget, noise_sigma=0.0)
    white = np.broadcast_to(daylight(eye.spectral_bands.wavelengths)[:, None, None], (eye.bands, 60, 60))
    noise = eye.see(white, 1, np.random.default_rng(0)) - eye.see(white, 1)
    for kind in (0, 1):
        here = noise[0][eye.mosaic == kind]
        # With 1800 receptors the variance is accurate to sqrt(2 / 1800) = 3.3 %.
        assert here.var() == pytest.approx(1 / eye.photons[kind], rel=0.12)
    assert eye.photons[1] > 2 * eye.photons[0]


def test_ultraviolet_light_is_seen_by_the_ultraviolet_type_alone():
    eye = Eye(None, (2, 2), receptors="honeybee", bands=16)
    light = np.exp(-(((eye.spectral_bands.wavelengths * 1e9 - 345) / 15) ** 2))
    green, blue, ultraviolet = eye.see(np.broadcast_to(light[:, None, None], (16, 2, 2)), 1)[:, 0, 0]
    assert ultraviolet > 0.2
    assert max(green, blue) < 0.35 * ultraviolet  # the β bands


def test_bands_are_chosen_for_the_receptors():
    eye = Eye(bands="auto", receptors="honeybee")
    assert eye.bands == len(eye.spectral_bands.wavelengths) > 1
    assert eye.spectral_bands.weights.shape[0] == 3


@pytest.mark.parametrize(
    ("receptors", "named"),
    [
        ("rbg", "receptors = 'rbg': must be one of 'rgb', 'lms', .*did you mean 'rgb'"),
        ("honey bee", "did you mean 'honeybee'"),
        ((), "no type is given"),
        (None, "receptors = None"),
        ((900,), r"receptors hold 900: must be wavelengths of peaks in \[330, 700\]"),
        (("red",), "receptors hold 'red'"),
        (Spectrum((400, 500), (0, 0)), "type 0 has no sensitivity"),
    ],
)
def test_bad_receptors_are_named(receptors, named):
    with pytest.raises(ValueError, match=named):
        Eye(receptors=receptors)


@pytest.mark.parametrize("mosaic", [((0, 3),), ((0,), (1, 2)), (), ((0.5, 1),), "ab", ((-1, 0),)])
def test_bad_mosaics_are_named(mosaic):
    with pytest.raises(ValueError, match="mosaic: must be rows"):
        Receptors((600, 520, 460), mosaic=mosaic)


@pytest.mark.parametrize("range_nm", [(700, 400), (200, 700), (400, 900), (400.5, 700), (400,), "ab"])
def test_bad_ranges_are_named(range_nm):
    with pytest.raises(ValueError, match=r"range_nm = .*: must be"):
        Receptors((500,), range_nm=range_nm)


def test_pigments_of_both_chromophores_differ():
    ours, theirs = (SpectralBands.uniform(8, (Pigment(600, kind),)).weights for kind in ("A1", "A2"))
    assert ours.shape == theirs.shape
    assert not np.allclose(ours, theirs, rtol=0.05)


def test_derivatives_flow_through_a_mosaic():
    """The derivatives of all signals with respect to the radius, in backward mode, agree with central differences
    (error O(step⁴)).
    """
    import drjit as dr

    from optics.numerics.precision import precision

    types, step = precision("float64"), 2e-3
    kinds = receptors_of("honeybee").arranged(BAYER)

    def seen(radius):
        pupil = Pupil(radius * 15e-6, thin_lens_focal_length=250e-6)
        eye = Eye(pupil, (3, 5), 45.0, bands=3, tolerance=1e-5, dtype="float64", receptors=kinds)
        rng = np.random.default_rng(8)
        signal = eye.see(rng.random((3, 12, 14)), 2)
        weights = rng.standard_normal((1, 3, 5))
        if isinstance(signal, np.ndarray):
            return float(np.sum(weights * signal))
        assert signal.shape == (1, 3, 5)
        return dr.sum(signal.array * types.Float64(weights.ravel()))

    at = [seen(1 + k * step) for k in (-2, -1, 1, 2)]
    expected = (8 * (at[2] - at[1]) - (at[3] - at[0])) / (12 * step)
    radius = types.Float64(1.0)
    dr.enable_grad(radius)
    dr.backward(seen(radius))
    assert dr.grad(radius)[0] == pytest.approx(expected, rel=1e-4)
    assert abs(expected) > 1e-2


def test_a_sensitivity_in_per_cent_is_the_same_sensitivity():
    kinds = [Receptors((Spectrum((400, 500, 600), (0, height, 0)),)) for height in (1.0, 100.0)]
    one, other = (Eye(resolution=(5, 5), receptors=kind, photon_budget=PhotonBudget()) for kind in kinds)
    assert one.photons == pytest.approx(other.photons)


def test_types_that_see_nothing_of_the_range_are_named():
    violet = Spectrum((300, 350, 351), (0, 1, 0))
    with pytest.raises(ValueError, match=r"range_nm = .*: type 0 has no sensitivity within it"):
        Receptors((violet, Pigment(550.0)), range_nm=(500, 700))


def test_descriptions_of_receptors_and_spectra_are_short():
    mosaic = receptors_of([500, 600]).arranged(((0, 1), (1, 0)))
    assert repr(mosaic) == "<Receptors with peaks at 500, 600 nm, mosaic of 2 x 2>"
    assert repr(receptors_of("lms")) == "<Receptors with peaks at 565, 540, 440 nm>"
    assert repr(Spectrum((400, 500, 600), (0, 2, 1))) == ("<Spectrum of 3 values from 400 to 600 nm, peak at 500 nm>")
