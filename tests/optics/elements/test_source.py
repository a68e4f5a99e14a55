"""Paths of plane and spherical waves, against the distances themselves."""

import math

import numpy as np
import pytest

from optics import PointSource
from optics.numerics.precision import precision

TYPES = precision("float64")
X, Y = np.random.default_rng(0).uniform(-50e-6, 50e-6, (2, 50))


def path(source):
    return source.path(TYPES.Float64(X), TYPES.Float64(Y)).numpy()


def test_plane_wave_on_axis_is_flat():
    np.testing.assert_array_equal(path(PointSource()), 0)


@pytest.mark.parametrize("angle", [(0.0, 0.0), (0.2, -0.1)])
@pytest.mark.parametrize("distance", [300e-6, 5e-3])
def test_spherical_wave_is_the_distance_from_the_source(distance, angle):
    sx, sy = (-distance * math.tan(theta) for theta in angle)
    exact = np.sqrt((X - sx) ** 2 + (Y - sy) ** 2 + distance**2) - np.sqrt(sx**2 + sy**2 + distance**2)
    np.testing.assert_allclose(path(PointSource(distance, angle)), exact, atol=1e-18)


def test_a_far_source_is_a_plane_wave():
    angle = (0.1, 0.05)
    far = path(PointSource(1e3, angle))
    np.testing.assert_allclose(far, path(PointSource(math.inf, angle)), atol=3e-12)
    assert np.polyfit(X, far, 1)[0] > 0  # travels towards +x


@pytest.mark.parametrize("distance", [0.0, -1.0, math.nan])
def test_bad_distance(distance):
    with pytest.raises(ValueError, match="source_distance"):
        PointSource(distance)
