"""Microvilli: Malus' law, and what steep rays leave of it."""

import math

import numpy as np
import pytest

import optics
from optics import Microvilli

WAVE = 500e-9
SLOW = optics.Pupil(0.5e-3, thin_lens_focal_length=10e-3)
STEEP = optics.Pupil(0.9e-3, thin_lens_focal_length=1e-3)


def slow(**others):
    return optics.vector_focus(SLOW, WAVE, dx=1e-6, shape=(41, 41), **others)


@pytest.mark.parametrize("azimuth", [0.0, 30.0, 117.0])
@pytest.mark.parametrize("ratio", [math.inf, 5.0])
def test_flat_rays_obey_malus(azimuth, ratio):
    """cos² of the angle between polarisation and microvilli, and 1/ratio of the rest; to sin²θ of the rays."""
    cells = Microvilli(azimuth, ratio)
    for plane in np.radians([0.0, 25.0, 60.0, 90.0, 150.0]):
        light = slow(polarization=(math.cos(plane), math.sin(plane)))
        cos2 = math.cos(plane - math.radians(azimuth)) ** 2
        here = np.hypot(light.grid.x, light.grid.y[:, None]) <= 8e-6
        found = cells.signal(light, 8e-6) / (light.psf[here].sum() * 1e-12)
        assert found == pytest.approx(cos2 + (1 - cos2) / ratio, abs=2e-3)


def test_unpolarised_and_circular_light_are_the_same_to_them():
    signals = [Microvilli(azimuth).signal(slow(polarization=p), 8e-6) for azimuth in (0, 45) for p in (None, (1, 1j))]
    np.testing.assert_allclose(signals, signals[0], rtol=2e-3)


def test_no_preference_absorbs_all():
    light = optics.vector_focus(STEEP, WAVE, polarization=(1, 0), dx=50e-9, shape=(41, 41))
    np.testing.assert_allclose(Microvilli(20.0, 1.0).absorbed(light), light.psf)
    crossed = sum(Microvilli(azimuth, math.inf).absorbed(light) for azimuth in (20.0, 110.0))
    np.testing.assert_allclose(crossed, light.intensity[:2].sum(axis=0))


def test_steep_rays_lower_polarisation_sensitivity():
    """It is the dichroic ratio behind a slow lens, and the ratio of signals in both planes behind any."""
    cells, window = Microvilli(0.0, 10.0), {"dx": 50e-9, "shape": (61, 61)}
    assert cells.polarization_sensitivity(slow(), 8e-6) == pytest.approx(10, rel=0.02)
    found = cells.polarization_sensitivity(optics.vector_focus(STEEP, WAVE, **window), 1e-6)
    planes = [optics.vector_focus(STEEP, WAVE, polarization=p, **window) for p in ((1, 0), (0, 1))]
    assert found == pytest.approx(cells.signal(planes[0], 1e-6) / cells.signal(planes[1], 1e-6))
    assert found < 9


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Microvilli(400.0), "azimuth_deg = 400"),
        (lambda: Microvilli(0.0, 0.5), "dichroic_ratio = 0.5"),
        (lambda: Microvilli().absorbed(1.0), "light = 1.0"),
        (lambda: Microvilli().signal(slow(), 1e-3), "radius = 0.001 m"),
        (lambda: Microvilli().polarization_sensitivity(slow(polarization=(1, 0)), 8e-6), "light is polarised"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()
