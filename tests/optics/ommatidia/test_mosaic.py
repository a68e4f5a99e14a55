"""Mosaics of ommatidia: their viewing directions, and their response to a grating."""

import math

import numpy as np
import pytest

import optics
from optics import AppositionEye, FacetLens, Ommatidium, Pupil, Waveguide, hexagonal_directions

LENS = Pupil(12.5e-6, thin_lens_focal_length=67e-6, medium_n=1.34, object_n=1.0)
FLY = AppositionEye(Ommatidium(LENS, Waveguide(1.4e-6)), 3, 1.5)


def test_directions_are_a_hexagonal_lattice():
    at = hexagonal_directions(4, 2.0)
    assert len(at) == 1 + 3 * 4 * 5
    apart = np.degrees(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)))
    np.testing.assert_allclose(np.sort(apart, axis=1)[:, 1], 2.0)
    middle = np.argmin(np.hypot(*at.T))
    np.testing.assert_allclose(np.sort(apart[middle])[:7], [0, 2, 2, 2, 2, 2, 2], atol=1e-12)


def test_a_grating_comes_with_its_contrast():
    """The bright and dark stripes are in the right places, too."""
    frequency = 0.25
    seen = FLY.see(lambda x, y: 1 + np.cos(2 * np.pi * frequency * np.degrees(x) + 0 * y))
    expected = 1 + FLY.contrast(frequency) * np.cos(2 * np.pi * frequency * np.degrees(FLY.directions[:, 0]))
    np.testing.assert_allclose(seen, expected, atol=1e-6)
    assert FLY.contrast(0.0) == pytest.approx(1)


def test_contrast_falls_as_a_gaussian_of_the_acceptance_angle():
    """The contrast is approximately exp(-(π Δρ ν)²/(4 ln 2)) (Götz 1964), and 0 for frequencies ν above D/λ."""
    rho = math.degrees(FLY.ommatidium.acceptance_angle())
    for frequency in (0.1, 0.3):
        gauss = math.exp(-((math.pi * rho * frequency) ** 2) / (4 * math.log(2)))
        assert FLY.contrast(frequency) == pytest.approx(gauss, abs=0.05)
    beyond = 1.05 * math.radians(1) * 25e-6 / 500e-9
    assert FLY.contrast(beyond) < 5e-3
    assert FLY.contrast(0.5 * beyond) > 0.02


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("place", [(0.024, 0.0), (-0.024, 0.0), (0.0, 0.02), (0.0, -0.02), (0.02, 0.02)])
def test_a_lopsided_facet_looks_where_an_eye_of_it_does(place):
    """A prism and coma in front of a rhabdom: its signal for a small light equals that of the receptor of an `Eye` with
    the same pupil and waveguide, up to tails of white outside the mosaic's window. Cells of the scene ascend to the
    right and down, the axes x and y to the left and up. On the other side of the axis the signal is dark."""
    bent = optics.Zernike({(1, 1): 0.12, (3, -1): 0.05})
    lens = Pupil(12.5e-6, thin_lens_focal_length=67e-6, medium_n=1.34, object_n=1.0, wavefront=bent)
    guide, focal, side = Waveguide(1.4e-6), 50e-6, 61
    fov = 2 * math.degrees(math.atan(1.5e-6 / focal))
    eye = optics.Eye(lens, (1, 1), fov, 3e-6, 1, waveguide=guide, tolerance=5e-3, full_aperture=1e-4)
    wavelength = float(eye.spectral_bands.wavelengths[0])

    def light(x, y):
        return np.exp(-((np.tan(x) - place[0]) ** 2 + (np.tan(y) - place[1]) ** 2) / 0.01**2)

    at = np.arctan((np.arange(side) - side // 2) * 3e-6 / 9 / focal)
    scenes = np.array([light(-at[None, :], -at[:, None]), np.ones((side, side))])
    seen, white = (float(eye.see(scene[None], 9)[0, 0, 0]) for scene in scenes)
    facet = AppositionEye(Ommatidium(lens, guide, eye.retina_distance), 0, 1.0)
    assert facet.see(light, wavelength)[0] == pytest.approx(seen / white, rel=0.03, abs=1e-3)
    assert (seen / white > 0.15) == (place[0] < 0), "the receptor looks to the left"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hexagonal_directions(-1, 1.0), "rings = -1"),
        (lambda: hexagonal_directions(1, 0.0), "interommatidial_deg = 0"),
        (lambda: AppositionEye(LENS, 1, 1.0), "ommatidium = "),
        (lambda: AppositionEye(FLY.ommatidium, 1, 90.0), "interommatidial_deg = 90"),
        (lambda: FLY.see(lambda x, y: 1.0), "radiance gives shape"),
        (lambda: FLY.see(lambda x, y: np.nan * x * y), "must be finite"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def eye_and_finest_grating():
    """An eye and its finest grating [cycles per degree]."""
    eye = AppositionEye(Ommatidium(FacetLens(25e-6, 14e-6), Waveguide(2e-6)), 1, 1.5)
    return eye, math.radians(2 * eye.ommatidium.pupil.radius / 500e-9)


@pytest.mark.slow
def test_little_is_left_of_the_finest_gratings():
    eye, finest = eye_and_finest_grating()
    assert eye.contrast(0.99 * finest) < 1e-2


def test_nothing_is_left_of_gratings_finer_than_a_facet_passes():
    eye, finest = eye_and_finest_grating()
    assert [eye.contrast(factor * finest) for factor in (1.01, 3.7, 4.0)] == [0.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="cycles_per_degree = nan"):
        eye.contrast(math.nan)


@pytest.mark.slow
def test_in_water_a_facet_passes_finer_gratings():
    """Wavelengths are shorter in front of the facet. The contrast ends at 2R n/λ. Up to there, it equals the transform
    of the sensitivity, except for the part outside the window. Without the index n, there would be no contrast at the
    second frequency.
    """
    lens = Pupil(12.5e-6, thin_lens_focal_length=67e-6, medium_n=1.34, object_n=1.34)
    eye = AppositionEye(Ommatidium(lens, Waveguide(1e-6)), 1, 1.5)
    in_air = 2 * lens.radius / 500e-9
    steps = np.linspace(-0.25, 0.25, 101)
    x, y = (axis.ravel() for axis in np.meshgrid(steps, steps))
    weights = eye.ommatidium.sensitivity(x, y)
    for factor in (0.9, 1.1):
        exact = (weights * np.cos(2 * np.pi * factor * in_air * x)).sum() / weights.sum()
        assert eye.contrast(math.radians(factor * in_air)) == pytest.approx(exact, abs=6e-4)
    assert exact > 5e-3
    assert eye.contrast(math.radians(1.35 * in_air)) == 0.0
