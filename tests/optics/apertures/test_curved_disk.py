"""Smoothed waves behind disks and rings, against sums over the kernel around single points."""

from math import pi

import numpy as np
import pytest

from optics.apertures.circular import SoftAnnulus
from optics.apertures.curved_disk import curved_ring
from optics.apertures.soft_edge import SoftEdge
from optics.numerics.precision import precision
from optics.numerics.quadrature import gauss_legendre

EDGE, LEVELS = SoftEdge(9.5, 16.0, 0.015), 8192


def radii():
    return np.sqrt((np.arange(LEVELS) + 0.5) / LEVELS) * (1 + EDGE.reach)


def around(r, inner, curvature):
    """Return the convolution of wave and kernel at the distance r from the axis, divided by the wave."""
    share, weight = gauss_legendre(80)
    at, angle = (EDGE.reach * share)[:, None], (np.arange(2000) + 0.5) * (2 * pi / 2000)
    squared = (r + at * np.cos(angle)) ** 2 + (at * np.sin(angle)) ** 2
    inside = (squared <= 1) & (squared >= inner**2)
    wave = np.where(inside, np.exp(1j * pi * curvature * (squared - r * r)), 0).mean(axis=1)
    return EDGE.reach * weight @ (EDGE.ring(at[:, 0]) * wave)


@pytest.mark.parametrize("inner", [0.0, 0.4])
@pytest.mark.parametrize("curvature", [-7.0, 22.0])
def test_a_smoothed_wave_is_the_convolution_with_the_kernel(inner, curvature):
    found, r = curved_ring(EDGE, inner, curvature, LEVELS), radii()
    for place in np.searchsorted(r, [0.02, 0.35, 0.45, 0.6, 0.9, 1.0, 1.1]):
        assert abs(found[place] - around(r[place], inner, curvature)) < 5e-3
        assert abs(np.conj(found[place]) - around(r[place], inner, -curvature)) < 5e-3


def test_light_beyond_the_stopband_is_removed():
    """The wave has 22 r cycles per radius at the distance r from the axis."""
    found, r = np.abs(curved_ring(EDGE, 0.0, 22.0, LEVELS)), radii()
    assert np.abs(found[r < 0.25] - 1).max() < 0.02
    assert found[(r > 0.8) & (r < 0.9)].max() < 0.06
    plain = np.abs(curved_ring(EDGE, 0.0, 0.0, LEVELS))
    assert plain[(r > 0.5) & (r < 0.7)].min() > 0.98


@pytest.mark.parametrize("inner", [0.0, 0.4])
def test_a_flat_wave_is_the_transmittance_of_the_soft_aperture(inner):
    types = precision("float64")
    expected = SoftAnnulus(EDGE, inner).transmittance(types.Float64(radii()), types.Float64(np.zeros(LEVELS)), types)
    np.testing.assert_allclose(curved_ring(EDGE, inner, 0.0, LEVELS), expected.numpy(), atol=3e-4)
