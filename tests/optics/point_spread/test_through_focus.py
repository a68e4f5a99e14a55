"""PSFs through focus against Lommel's closed form, and the best focus against the lens equation."""

import math

import numpy as np
import pytest

import optics
from validation import reference

RADIUS, FOCAL, WAVELENGTH = 0.5e-3, 20e-3, 550e-9
LENS = optics.Pupil(RADIUS, thin_lens_focal_length=FOCAL)


def test_peaks_are_lommels():
    """The PSF on the axis of an f/20 lens, through focus. Paraxial theory has an error of (R/f)² = 6e-4."""
    distances = FOCAL * np.linspace(0.97, 1.04, 9)
    found = optics.through_focus(LENS, distances, wavelengths=[WAVELENGTH, 450e-9], dx=2e-6, shape=(5, 7))
    assert found.psf.shape == (9, 2, 5, 7)
    for index, wavelength in enumerate((WAVELENGTH, 450e-9)):
        right = [float(reference.defocused_psf(0.0, wavelength, RADIUS, FOCAL, z)) for z in distances]
        np.testing.assert_allclose(found.psf[:, index, 2, 3], right, atol=3e-3 * max(right))
    assert not found.psf.flags.writeable
    assert not found.distances.flags.writeable


@pytest.mark.parametrize("defocus_um", [-0.3, 0.0, 0.45])
def test_the_best_focus_is_that_of_the_lens_equation(defocus_um):
    """Positive defocus c is an additional power of 4√3 c/R², since c √3 (2ρ² - 1) has the curvature of a lens. The
    distance is exact to a tenth of the step of the distances; the other sign is wrong by many steps."""
    pupil = optics.Pupil(RADIUS, thin_lens_focal_length=FOCAL, wavefront=optics.Zernike({(2, 0): defocus_um}))

    def focus(c_um):
        return 1 / (1 / FOCAL + 4 * math.sqrt(3) * c_um * 1e-6 / RADIUS**2)

    step = 0.2e-3
    middle = focus(defocus_um) + np.random.default_rng(3).uniform(-0.5, 0.5) * step
    distances = middle + step * np.arange(-3, 4)
    found = optics.through_focus(pupil, distances, wavelengths=[WAVELENGTH, 450e-9], dx=3e-6, shape=(33, 33))
    np.testing.assert_allclose(found.best_focus(), focus(defocus_um), atol=0.1 * step)
    ratios = found.measured(optics.strehl_ratio)
    assert ratios.shape == (7, 2)
    assert ratios.max() > 0.95
    inside = found.measured(lambda result: optics.encircled_energy(result, [5e-6, 10e-6]))
    assert inside.shape == (7, 2, 2)
    if defocus_um:
        assert abs(focus(-defocus_um) - focus(defocus_um)) > step


@pytest.mark.parametrize(
    ("distances", "says"),
    [
        ([], r"sensor_distances = \[\]: must be a row of ascending distances"),
        ([2e-3, 1e-3], "must be a row of ascending distances"),
        ([[1e-3]], "must be a row of ascending distances"),
        ([-1e-3, 1e-3], "sensor_distances = -0.001: must be greater than 0"),
        ([1e-3, math.nan], "must be a row of ascending distances"),
        ("far", "sensor_distances: must be real numbers"),
    ],
)
def test_bad_distances_are_refused(distances, says):
    with pytest.raises(ValueError, match=says):
        optics.through_focus(LENS, distances)


def test_a_focus_outside_the_range_is_refused():
    with pytest.raises(ValueError, match="sensor_distance: must be left out"):
        optics.through_focus(LENS, [FOCAL], sensor_distance=FOCAL)
    few = optics.through_focus(LENS, [FOCAL], dx=3e-6, shape=(9, 9))
    with pytest.raises(ValueError, match="1 sensor_distances: must be three or more"):
        few.best_focus()
    beyond = optics.through_focus(LENS, FOCAL * np.array([1.005, 1.01, 1.015]), dx=3e-6, shape=(33, 33))
    with pytest.raises(ValueError, match=r"the end of the range: must rise and fall within it"):
        beyond.best_focus()
