"""Published human eyes: results that their authors computed from the same coefficients, and results of other
measurements."""

import math
from functools import cache

import numpy as np
import pytest

import optics
from optics import HumanEye, Zernike, mean_human_mtf
from optics.spectra.spectrum import cone_fundamentals

# Autrusseau, Thibos & Shevell (2011), figure 11, read off by the authors of ISETBio: contrast of vertical gratings to L
# and M cones in white light of equal energy, 6 mm. Their point at 1 cycle per degree suffers from a window of 1°.
CYCLES = np.array([5, 10, 20, 30, 40])
FIGURE_11 = np.array([[0.368, 0.228, 0.103, 0.0563, 0.0387], [0.320, 0.195, 0.0962, 0.0554, 0.0356]])
READING = 0.05  # relative error of points read off a figure; a wrong model differs by three times this value


@cache
def standard_contrasts():
    return contrasts(HumanEye(3e-3), axis=1)


def contrasts(eye, axis):
    """Return contrasts (cone, frequency). Wavelengths 20 nm apart are enough, because the spectra of cones are five
    times as wide.
    """
    nm, dx, side = np.arange(440, 681, 20), 1.2e-6, 193
    energy = np.array([cone.at(nm * 1e-9) * nm for cone in cone_fundamentals()[:2]])
    places = (np.arange(side) - side // 2) * dx
    wave = np.exp(-2j * np.pi * np.outer(eye.frequency(CYCLES), places))
    seen = optics.psf(eye.pupil, nm * 1e-9, eye.focal_length, dx=dx, shape=(side, side), tolerance=0.02).psf
    lines = np.einsum("cw,wx->cx", energy, seen.sum(axis=axis))
    return np.abs(lines @ wave.T) / lines.sum(axis=1)[:, None]


def changed(change):
    modes = {}
    for (n, m), value in optics.elements.human_eye.HUMAN_WAVEFRONTS["standard_observer"].modes.items():
        key, value = change(n, m, value)
        modes[key] = value
    return Zernike(modes, 3e-3)


def test_standard_observer_has_the_contrasts_of_its_authors():
    assert standard_contrasts() == pytest.approx(FIGURE_11, rel=READING)


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        lambda n, m, value: ((n, m), -value),  # the sign of incoming light
        lambda n, m, value: ((n, m), value / 1.3),  # another unit, or another pupil
        lambda n, m, value: ((n, -m), value),  # sines in place of cosines
    ],
    ids=["sign", "unit", "order"],
)
def test_and_no_other_reading_of_the_table_has(change):
    off = contrasts(HumanEye(3e-3, changed(change)), axis=1) / FIGURE_11 - 1
    assert np.abs(off).max() > 3 * READING


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("radius", [1e-3, 3e-3])
def test_without_aberrations_it_is_perfect_in_570_nm(radius):
    """A paraboloid alone would have 4 µm of spherical aberration over a pupil of 3 mm, and its PSF would have no
    peak.
    """
    eye = HumanEye(radius, None)
    seen = optics.psf(eye.pupil, [570e-9], eye.focal_length, dx=0.5e-6, shape=(33, 33), tolerance=1e-4)
    assert optics.strehl_ratio(seen)[0] == pytest.approx(1, abs=2e-4)
    assert eye.focal_length == pytest.approx(22.18e-3, abs=1e-5)


def test_chromatic_aberration_is_that_of_humans():
    """A defocus of D r²/4√3 [µm], with D from Thibos et al. (1992), compensates the chromatic aberration at 460 nm, so
    that the Strehl ratio is 1 again.
    """
    radius = 1e-3
    dioptres = -0.63346 * (1 / (0.460 - 0.2141) - 1 / (0.570 - 0.2141))
    um = dioptres * radius**2 / (4 * math.sqrt(3)) * 1e6
    ratios = []
    for wavefront in (None, Zernike({(2, 0): um})):
        eye = HumanEye(radius, wavefront)
        seen = optics.psf(eye.pupil, [460e-9], eye.focal_length, dx=0.5e-6, shape=(33, 33), tolerance=1e-3)
        ratios.append(optics.strehl_ratio(seen)[0])
    assert ratios[0] < 0.3
    assert ratios[1] > 0.99


def test_a_known_wavefront_serves_its_middle():
    small = HumanEye(1.2e-3).pupil
    assert small.wavefront.radius == 3e-3
    assert small.radius == 1.2e-3


def test_mean_mtf():
    """The published value at 10 cycles per degree and 4 mm agrees, and the contrast is 0 beyond the cut-off of a
    perfect lens.
    """
    u1 = 21.95 - 5.512 * 4 + 0.3922 * 16
    perfect = 2 / math.pi * (math.acos(s := 10 * 180 * 555e-9 / (math.pi * 4e-3)) - s * math.sqrt(1 - s * s))
    expected = math.sqrt(perfect) / (1 + (10 / u1) ** 2) ** 0.62
    assert mean_human_mtf([[0, 10, 1e4]], 4e-3) == pytest.approx(np.array([[1, expected, 0]]), abs=1e-12)
    assert expected == pytest.approx(0.427, abs=5e-4)


@pytest.mark.slow
def test_standard_observer_is_near_the_mean_of_two_hundred():
    """White light and a pupil of 6 mm are the case with the strongest aberrations. The error is below 0.05; that of a
    perfect lens would be above 0.7.
    """
    seen = standard_contrasts().mean(axis=0)
    mean = mean_human_mtf(CYCLES, 6e-3)
    assert np.abs(seen[1:] - mean[1:]).max() < 0.05
    assert mean[1] < 0.25


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HumanEye(wavefront="thibos"), "wavefront = 'thibos'"),
        (lambda: HumanEye(0.0), "aperture_radius = 0"),
        (lambda: HumanEye(wavefront=[0.1]), "wavefront"),
        (lambda: HumanEye(4e-3), r"aperture_radius = 0\.004: must be at most 0\.003 m, where the wavefront is known"),
        (lambda: mean_human_mtf([math.nan], 4e-3), "cycles_per_degree holds nan: must be 0 or more"),
        (lambda: HumanEye().frequency(-1.0), "cycles_per_degree holds -1"),
        (lambda: mean_human_mtf([-1.0], 4e-3), "cycles_per_degree holds -1"),
        (lambda: mean_human_mtf([1.0], 4.0), "pupil_diameter = 4"),
        (lambda: HumanEye().frequency(["a"]), "cycles_per_degree"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_derivatives_are_refused():
    import drjit as dr

    from tests.optics.device_types import Float64

    value = Float64(0.1)
    dr.enable_grad(value)
    with pytest.raises(ValueError, match="wavefront requires a derivative"):
        HumanEye(wavefront=Zernike({(2, 0): value}))


def test_an_eye_of_its_retina_is_as_long_as_it_is():
    """The eye's field of view is correct, too: the image of a point at 0.4° is f tan(0.4°)/n away from the axis."""
    human = HumanEye(1e-3, wavefront=None)
    width = human.sensor_width(1.0)
    eye = optics.Eye(pupil=human.pupil, full_aperture=8e-3, fov_deg=1.0, sensor_width=width, resolution=(15, 15))
    # the two eyes take the index at different wavelengths
    assert eye.retina_distance == pytest.approx(human.focal_length, rel=1e-3)
    angle = math.radians(0.4)
    seen = optics.psf(human.pupil, [570e-9], human.focal_length, source_angle=(angle, 0.0), dx=1e-6, shape=(257, 257))
    brightest = float(seen.x[seen.psf[0].max(axis=0).argmax()])
    assert brightest / width == pytest.approx(math.tan(angle) / (2 * math.tan(math.radians(0.5))), abs=seen.dx / width)


def test_centered_moves_the_centroid_of_the_image_to_the_axis():
    """Over 3 mm, the coma of the standard observer is cropped, which shifts the image by (1.2', -0.7')."""
    places = []
    for centered in (False, True):
        eye = HumanEye(1.5e-3, centered=centered)
        seen = optics.psf(eye.pupil, [570e-9], eye.focal_length, dx=2e-6, shape=(129, 129), tolerance=1e-3)
        image = seen.psf[0] / seen.psf[0].sum()
        places.append(np.array([image.sum(axis=0) @ seen.x, image.sum(axis=1) @ seen.y]) / eye.sensor_width(1 / 60))
    assert places[0] == pytest.approx([1.24, -0.67], abs=0.03)
    assert places[1] == pytest.approx([0, 0], abs=0.03)


def test_a_wavefront_over_the_pupil_itself_is_centered_too():
    """The mean slope of c Z_3^1 = √8 c (3ρ³ - 2ρ) cos φ over its circle of radius a is √8 c / a."""
    eye = HumanEye(1e-3, Zernike({(3, 1): 0.2, (4, 0): 0.1}), centered=True)
    assert eye.pupil.wavefront.modes[1, 1] == pytest.approx(-math.sqrt(8) * 0.2 / 2)
    assert eye.pupil.wavefront.modes[1, -1] == pytest.approx(0, abs=1e-12)
