"""Parts of the method of the angular spectrum: obliquity, the limits of the spectrum's taper, and the tapers that are
tried.
"""

import math

import numpy as np
import pytest
from scipy.special import erf

import optics
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.methods import angular_spectrum
from optics.methods.angular_spectrum import split_spectrum, versine, whole_spectrum
from optics.methods.problem import Problem
from optics.methods.spectral_taper import Taper, tapers
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

METHODS = {"angular_spectrum": whole_spectrum, "split_angular_spectrum": split_spectrum}


def problems():
    """Return problems for pupils of some microns to a millimetre, with the sensor in front of the focus, in it and
    behind it.
    """
    for radius in (5e-6, 40e-6, 1e-3):
        for distance in (3 * radius, 30 * radius):
            for focus in (0.7, 1.0, 30.0):
                pupil = optics.Pupil(radius, thin_lens_focal_length=focus * distance)
                beam = Beam(pupil, PointSource(), 550e-9, distance)
                window = Grid.square(65, 550e-9 * distance / radius / 4)
                yield from (Problem.from_beam(beam, window, tolerance) for tolerance in (1e-4, 1e-2))


def test_versine_keeps_its_digits_near_the_axis():
    """The plain expression 1 - cos θ has four digits left at θ = 1e-6."""
    theta = np.array([1e-6, 1e-4, 1e-2, 0.3, 1.0, math.pi / 2])
    found = versine(precision("float64").Float64(np.sin(theta) ** 2)).numpy()
    # Ten roundings of float64, because some are in sin² itself.
    np.testing.assert_allclose(found, 2 * np.sin(theta / 2) ** 2, rtol=10 * 2.2e-16)


@pytest.mark.parametrize(("dtype", "error"), [("float32", 3e-6), ("float64", 1e-13)])
def test_spectra_fade_as_an_error_function(dtype, error):
    types, taper = precision(dtype), Taper(band=2e6, width=3e5, blur=4e-6, sine=0.0, tangent=0.0)
    f = np.linspace(0, 4e6, 401)
    steepness = 2 / taper.width * math.sqrt(math.pi * taper.width * taper.blur / 2)
    exact = (1 - erf((f - taper.band - taper.width / 2) * steepness)) / 2
    found = taper.fade(types.Float64(f * f), types).numpy()
    np.testing.assert_allclose(found, exact, atol=error)


@pytest.mark.parametrize("method", METHODS)
def test_no_taper_that_is_not_tried_would_be_cheaper(method):
    skipped = 0
    for problem in problems():
        tried, whole = METHODS[method](problem), tapers(problem)
        every = [angular_spectrum._sampling(problem, taper, method) for taper in whole]
        assert min((each.seconds for each in tried), default=0) == min((each.seconds for each in every), default=0)
        skipped += len(whole) - len(tried)
    assert skipped > 0
