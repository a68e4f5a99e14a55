"""Tables of acceptance functions, compared with the angular sensitivity of an ommatidium."""

import math

import numpy as np
import pytest

from optics import FacetLens, Ommatidium, Pupil, WavefrontMap, Waveguide, acceptance_function

WAVELENGTHS = np.array([450e-9, 550e-9])
EYE = Ommatidium(FacetLens(16e-6, 12e-6), Waveguide(1.9e-6))


@pytest.fixture(scope="module")
def table():
    return acceptance_function(EYE, WAVELENGTHS)


def angles(sine_x, sine_y):
    """Return the angles along x and y of a direction with these sines."""
    cosine = np.sqrt(1 - sine_x**2 - sine_y**2)
    return np.arctan(sine_x / cosine), np.arctan(sine_y / cosine)


def test_values_are_the_angular_sensitivity(table):
    rows, columns = np.random.default_rng(0).integers(30, len(table.sines) - 30, (2, 40))
    at = angles(table.sines[columns], table.sines[rows])
    for band, wavelength in enumerate(WAVELENGTHS):
        expected = EYE.sensitivity(*at, wavelength)
        assert table.values[band, rows, columns] == pytest.approx(expected, abs=1e-5)


def test_axes_are_those_of_the_source():
    """Coma along x makes the sensitivity asymmetric along x; the table has the same sign of x."""
    side = np.linspace(-1, 1, 41)
    coma = 0.3e-6 * (3 * (side**2 + side[:, None] ** 2) - 2) * side
    lens = Pupil(8e-6, thin_lens_focal_length=36e-6, medium_n=1.34, wavefront=WavefrontMap(coma))
    eye = Ommatidium(lens, Waveguide(1.9e-6))
    table = acceptance_function(eye, WAVELENGTHS[1:])
    middle = len(table.sines) // 2
    columns = middle + np.array([-12, -6, 6, 12])
    expected = eye.sensitivity(np.arcsin(table.sines[columns]), np.zeros(4), WAVELENGTHS[1])
    assert table.values[0, middle, columns] == pytest.approx(expected, abs=1e-5)
    assert not np.allclose(expected, expected[::-1], rtol=0.1)


def test_the_integral_is_that_of_a_fine_sum_in_polar_coordinates(table):
    polar, turn = (np.arange(60) + 0.5) * 0.25 / 60, (np.arange(24) + 0.5) * 2 * np.pi / 24
    x = np.sin(polar)[:, None] * np.cos(turn)
    y = np.sin(polar)[:, None] * np.sin(turn)
    seen = EYE.sensitivity(*angles(x, y), WAVELENGTHS[1]).mean(axis=1)
    expected = float((seen * np.sin(polar)).sum()) * 2 * np.pi * 0.25 / 60
    assert table.integrals[1] == pytest.approx(expected, rel=2e-3)


def test_a_smaller_loss_gives_a_wider_window_and_the_same_object_is_returned_again(table):
    assert acceptance_function(EYE, WAVELENGTHS) is table
    narrow, wide = (acceptance_function(EYE, WAVELENGTHS, loss) for loss in (0.05, 1e-3))
    assert narrow.sines[-1] < wide.sines[-1] <= 0.5 + (wide.sines[1] - wide.sines[0])
    assert np.all(narrow.integrals < wide.integrals)
    assert np.all(narrow.integrals > 0.94 * wide.integrals)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: acceptance_function(3, WAVELENGTHS), "ommatidium = 3: must be"),
        (lambda: acceptance_function(EYE, WAVELENGTHS, 0.5), "loss = 0.5: must lie in"),
        (lambda: acceptance_function(EYE, [-1.0]), "wavelength"),
        (
            lambda: acceptance_function(Ommatidium(EYE.lens, Waveguide(1e-8)), [math.nextafter(5e-7, 1)]),
            "guides nothing",
        ),
    ],
)
def test_bad_input_names_itself(call, message):
    with pytest.raises(ValueError, match=message):
        call()
