"""Every exact method agrees with the textbook's angular spectrum, which detects wrong physics."""

import numpy as np
import pytest

import optics
from optics.methods.textbook import angular_spectrum_psf, lens_path, positions, relief_path
from optics.point_spread.planner import EXACT
from validation.reference import relative_l2

WAVELENGTH, N = 550e-9, 1.5
WINDOW = 21  # samples across
# The error of the textbook's grid comes from the sampled edge and from light that wraps around, 0.7 % here at most.
CLOSE = 0.01


class Case:
    """A pupil, and its optical paths on the grid of the textbook method."""

    def __init__(self, radius, distance, dx, samples, focal_length=None, relief=None):
        self.radius, self.distance, self.dx = radius, distance, dx
        x, y = positions(samples, dx)
        self.path = np.zeros((samples, samples))
        if focal_length is not None:
            self.path = self.path + lens_path(x, y, focal_length)
        height = None
        if relief is not None:
            height = optics.BSplineRelief.paraboloid(0.0, relief, radius)
            self.path = self.path + relief_path(-relief * (x**2 + y**2) / 2, N)
        self.pupil = optics.Pupil(radius, height, n=N, thin_lens_focal_length=focal_length)

    def textbook(self, path=None):
        whole = angular_spectrum_psf(
            self.path if path is None else path, self.dx, self.radius, WAVELENGTH, self.distance
        )
        middle = slice(len(whole) // 2 - WINDOW // 2, len(whole) // 2 + WINDOW // 2 + 1)
        return whole[middle, middle]

    def fast(self, method):
        settings = {"dx": self.dx, "shape": (WINDOW, WINDOW), "method": method}
        return optics.psf(self.pupil, [WAVELENGTH], self.distance, **settings).psf[0]


CASES = {
    "focus at high aperture": Case(15e-6, 30e-6, 0.2e-6, 1024, focal_length=30e-6),  # sin θ = 0.45
    "defocused lens": Case(15e-6, 100e-6, 0.25e-6, 512, focal_length=160e-6),
    "relief": Case(15e-6, 100e-6, 0.25e-6, 512, relief=6e3),
}


@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("method", EXACT)
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_methods_agree_with_the_textbook(case, method):
    assert relative_l2(case.fast(method), case.textbook()) < CLOSE


def test_a_lens_of_the_wrong_sign_does_not():
    case = CASES["defocused lens"]
    assert relative_l2(case.fast("auto"), case.textbook(-case.path)) > 10 * CLOSE


def test_fresnels_approximation_does_not_at_high_aperture():
    """Both the paraxial transfer function and the paraxial lens fail."""
    case = CASES["focus at high aperture"]
    x, y = positions(len(case.path), case.dx)
    assert relative_l2(case.fast("fresnel"), case.textbook()) > 10 * CLOSE
    assert relative_l2(case.fast("exact"), case.textbook(-(x**2 + y**2) / (2 * 30e-6))) > 10 * CLOSE


def test_power_arrives_whole():
    """All power that passes the pupil arrives, except for the evanescent part. No result is normalised."""
    case = CASES["defocused lens"]
    whole = angular_spectrum_psf(case.path, case.dx, case.radius, WAVELENGTH, case.distance)
    assert np.sum(whole) * case.dx**2 == pytest.approx(1, abs=0.01)
