"""Light through several pupils at once, against each pupil alone."""

import math

import numpy as np
import pytest

import optics
from optics import PointSource
from optics.elements.beam import Beam
from optics.elements.light_stack import LightStack
from optics.elements.pupil_polynomials import HIGHEST_ORDER, power_sum, powers_of
from optics.elements.wavefront import mode

WAVE, R = 550e-9, 20e-6
RNG = np.random.default_rng(3)
PUPILS = {
    "open": optics.Pupil(R),
    "lens in two media": optics.Pupil(R, thin_lens_focal_length=200e-6, object_n=1.2, medium_n=1.336),
    "diverging lens": optics.Pupil(0.7 * R, thin_lens_focal_length=-300e-6),
    "relief": optics.Pupil(1.5 * R, optics.BSplineRelief(2e-6 * RNG.random((4, 4))), n=1.6),
    "relief without a step": optics.Pupil(R, optics.BSplineRelief(2e-6 * RNG.random((4, 4))), n=1.336, medium_n=1.336),
    "wavefront": optics.Pupil(R, wavefront=optics.Zernike({(3, 1): 0.2, (2, 0): 0.3, (4, -4): 0.1}, 1.3 * R)),
    "high mode": optics.Pupil(R, wavefront=optics.Zernike({(HIGHEST_ORDER + 2, 0): 0.02})),
    "maps": optics.Pupil(R, 1e-6 * RNG.random((6, 6)), wavefront=optics.WavefrontMap(1e-7 * RNG.random((5, 5)))),
    "mask": optics.Pupil(R, mask=optics.GaussianMask(R)),
}
SOURCES = [PointSource(), PointSource(3e-3), PointSource(math.inf, (0.1, -0.05)), PointSource(1e-3, (0.0, 0.02))]
BEAMS = tuple(Beam(pupil, source, WAVE, 240e-6) for pupil in PUPILS.values() for source in SOURCES)


def points(stack):
    x, y = RNG.uniform(-0.8, 0.8, (2, len(stack.beams), 5, 6)) * stack.radius[:, None, None]
    return x, y


def test_the_paths_of_a_stack_are_those_of_its_beams():
    stack = LightStack(BEAMS)
    x, y = points(stack)
    for beam, found, *at in zip(BEAMS, stack.waves(x, y), x, y, strict=True):
        apart = found - beam.waves(*at)
        assert np.ptp(apart) < 1e-5  # in waves, up to a constant


def test_amplitudes_and_parts():
    stack = LightStack(BEAMS)
    x, y = points(stack)
    amplitude = stack.amplitude(x, y)
    for beam, found, *at in zip(
        BEAMS, amplitude, x / stack.radius[:, None, None], y / stack.radius[:, None, None], strict=True
    ):
        np.testing.assert_allclose(found, np.broadcast_to(beam.pupil.amplitude(*at), found.shape))
    some = [30, 2, 17]
    np.testing.assert_allclose(stack.part(some).waves(x[some], y[some]), stack.waves(x, y)[some], atol=1e-5)


def test_slopes_are_differences_of_the_path():
    stack, step = LightStack(BEAMS), 1e-4 * R
    slopes = stack.slopes
    for beam, along_x, along_y, most in zip(BEAMS, slopes.along_x, slopes.along_y, slopes.steepest, strict=True):
        x, y = slopes.x * beam.pupil.radius, slopes.y * beam.pupil.radius
        for along, (dx, dy) in ((along_x, (step, 0)), (along_y, (0, step))):
            ahead, behind = (beam.pupil.path(x + s * dx, y + s * dy, WAVE, beam.source) for s in (1, -1))
            np.testing.assert_allclose(along, (ahead - behind) / (2 * step), atol=0.05 * most + 1e-9)


def test_zernike_polynomials_are_sums_of_powers():
    x, y = RNG.uniform(-0.7, 0.7, (2, 1, 8, 5))
    for n in range(HIGHEST_ORDER + 1):
        for m in range(-n, n + 1, 2):
            pupil = optics.Pupil(10e-6, wavefront=optics.Zernike({(n, m): 1e-3}))
            waves = power_sum(1e3 * powers_of(pupil, 1e-6, 0.0)[None], x, y)
            expected = mode(n, m, np.zeros(1), np.zeros(1)) - mode(n, m, x, y)
            np.testing.assert_allclose(waves, expected, atol=3e-5)


@pytest.mark.parametrize("name", ["high mode", "maps"])
def test_other_elements_are_no_polynomials(name):
    assert powers_of(PUPILS[name], WAVE, 0.5) is None
