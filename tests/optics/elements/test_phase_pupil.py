"""Phases that are the same at every wavelength, against reliefs made for one wavelength and closed forms."""

import math

import drjit as dr
import numpy as np
import pytest

import optics
from optics.elements.square_samples import square_samples
from tests.optics.device_types import Float64, TensorXf64

RADIUS, FOCUS = 25e-6, 240e-6
VIEW = {"dx": 1e-6, "shape": (33, 33), "tolerance": 1e-4, "dtype": "float64"}


@pytest.mark.parametrize("pixels", [False, True])
@pytest.mark.parametrize("medium", [{}, {"medium_n": 1.336, "object_n": 1.2}, {"medium_n": optics.medium("water")}])
def test_at_each_wavelength_it_is_the_relief_made_for_it(pixels, medium):
    """A height φ λ / (2π (n - object_n)) has the phase φ at the wavelength λ, and another phase at all others."""
    rng = np.random.default_rng((pixels, len(medium)))
    phase, waves = rng.uniform(-math.pi, math.pi, (6, 6)), rng.uniform(400e-9, 700e-9, 2)
    lens = {"thin_lens_focal_length": FOCUS, **medium}
    found = optics.psf(optics.phase_pupil(RADIUS, phase, pixels=pixels, **lens), waves, **VIEW)
    kind = optics.PixelRelief if pixels else optics.HeightMap
    for index, wavelength in enumerate(waves):
        bare = optics.Pupil(RADIUS, **lens)
        height = phase * wavelength / (2 * math.pi * (1.8 - bare.index_before(wavelength)))
        here, elsewhere = (
            optics.psf(optics.Pupil(RADIUS, kind(height), 1.8, **lens), [at], **VIEW).psf[0]
            for at in (wavelength, 0.8 * wavelength)
        )
        error = np.linalg.norm(found.psf[index] - here) / np.linalg.norm(here)
        assert error < 2 * VIEW["tolerance"]
        assert np.linalg.norm(found.psf[index] - elsewhere) / np.linalg.norm(here) > 0.02


def test_a_quadratic_phase_is_a_lens_of_a_focal_length_proportional_to_one_over_the_wavelength():
    """φ = -π r²/(λ₀ f₀) is the paraxial phase of a lens of the focal length f₀ λ₀/λ. At f/50, the paraxial formula has
    an error below 1e-3 waves. Cubic splines through 64 samples reproduce a parabola, except near the edges of the
    square."""
    radius, design, focal = 0.5e-3, 550e-9, 50e-3
    at = (np.arange(64) + 0.5) * 2 * radius / 64 - radius
    phase = -np.pi * np.add.outer(at**2, at**2) / (design * focal)
    metalens = optics.phase_pupil(radius, phase)
    for wavelength in (450e-9, 550e-9, 650e-9):
        here, glass = (
            optics.strehl_ratio(optics.psf(metalens, [wavelength], z, dx=4e-6, shape=(33, 33)))[0]
            for z in (focal * design / wavelength, focal)
        )
        assert here > 0.98
        assert (glass < 0.9) == (wavelength != design)


def test_stripes_of_half_a_wave_send_no_light_straight_on_at_any_wavelength():
    """The phase is reversed in half of the opening, so the amplitude in the middle of the image is 0. With a relief,
    this is the case at one wavelength only.
    """
    waves, middle = [450e-9, 550e-9, 650e-9], 16
    lens = {"thin_lens_focal_length": FOCUS, "aperture": optics.Slit(1.0, 1.0)}
    stripes = np.pad(np.tile([0.0, math.pi], (4, 2)), 2, mode="wrap")
    heights = stripes * waves[1] / (2 * math.pi * 0.5)
    open_, same, relief = (
        optics.psf(pupil, waves, **VIEW).psf[:, middle, middle]
        for pupil in (
            optics.Pupil(RADIUS, **lens),
            optics.phase_pupil(RADIUS, stripes, pixels=True, **lens),
            optics.Pupil(RADIUS, optics.PixelRelief(heights), 1.5, **lens),
        )
    )
    assert (same / open_).max() < 1e-3
    assert (relief / open_)[1] < 1e-3 < 1e-2 < min((relief / open_)[[0, 2]])


def test_phases_carry_derivatives():
    phase = np.random.default_rng(4).normal(size=(4, 4))
    tensor = TensorXf64(phase)
    dr.enable_grad(tensor)
    how = {"dx": 2e-6, "shape": (9, 9), "tolerance": 1e-4, "dtype": "float64"}
    weight = np.random.default_rng(5).random((1, 9, 9))

    def loss(given):
        pupil = optics.phase_pupil(RADIUS, given, thin_lens_focal_length=FOCUS)
        return optics.psf(pupil, [500e-9], **how)

    dr.backward(dr.sum(loss(tensor).tensor.array * Float64(weight.ravel())))
    step = np.zeros((4, 4))
    step[1, 2] = 1e-3
    difference = ((loss(phase + step).psf - loss(phase - step).psf) * weight).sum() / 2e-3
    # Differences of PSFs have an error of the tolerance divided by the relative change, which is 1e-3.
    assert tensor.grad.numpy()[1, 2] == pytest.approx(difference, rel=0.02)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"n": 1.5}, "n: must be left out, because a phase has no refractive index"),
        ({"height": np.zeros((4, 4))}, "height: must be left out, because a pupil has a phase or a relief"),
        ({"phase": np.zeros(4)}, r"must be \(rows, columns\)"),
        ({"phase": np.zeros((2, 3)), "pixels": True}, "must be square"),
        ({"phase": [[math.nan]]}, "NaN or infinity"),
        ({"phase": "x"}, "phase: must be real numbers"),
        ({"pixels": 2}, "pixels = 2: must be True or False"),
    ],
)
def test_bad_arguments_are_refused(given, says):
    with pytest.raises(ValueError, match=says):
        optics.phase_pupil(**{"aperture_radius": RADIUS, "phase": np.zeros((4, 4)), **given})


def test_samples_of_a_pupil_are_radians():
    pupil = optics.phase_pupil(RADIUS, np.full((3, 3), 2.0))
    for wavelength in (400e-9, 700e-9):
        waves = pupil.index_step(wavelength) * square_samples(pupil.height.samples) / wavelength
        np.testing.assert_allclose(2 * math.pi * waves, 2.0, rtol=1e-12)
