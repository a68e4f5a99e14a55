"""The soft disk: its spectrum is the hard disk's where it matters and nothing where a grid would alias it."""

import numpy as np
import pytest
from scipy.special import j1

from optics.aperture import SoftDisk
from optics.precision import precision

RADIUS = 20e-6


def spectrum_errors(ripple):
    """Largest error in the passband, and largest value at the stopband, against the envelope of the disk's spectrum."""
    disk = SoftDisk.cheapest(RADIUS, 1e6, ripple, RADIUS / 4)
    rate = 2 * disk.stopband
    n = 2 * int((RADIUS + disk.reach) * rate + 2)
    x = (np.arange(n) - n // 2) / rate
    types = precision("float64")
    xx, yy = np.meshgrid(x, x)
    sampled = disk.transmittance(types.Float64(xx.ravel()), types.Float64(yy.ravel()), types).numpy().reshape(n, n)
    f = np.linspace(1e3, disk.stopband, 200)
    spectrum = (np.exp(-2j * np.pi * np.outer(f, x)) @ sampled.sum(axis=0)) / rate**2
    envelope = np.pi * RADIUS**2 / np.maximum(1, (2 * np.pi * RADIUS * f) ** 1.5)
    error = np.abs(spectrum - RADIUS * j1(2 * np.pi * RADIUS * f) / f) / envelope
    return error[f < disk.passband].max(), np.abs(spectrum / envelope)[-1]


@pytest.mark.parametrize("ripple", [1e-2, 1e-3, 1e-5])
def test_spectrum_is_the_disks_to_the_ripple(ripple):
    passband, stopband = spectrum_errors(ripple)
    assert passband < 10 * ripple
    assert stopband < 10 * ripple


def test_a_hard_edge_fails_the_same_test():
    """Binary samples at the same rate are wrong by percents: the oracle tells the methods apart."""
    disk = SoftDisk.cheapest(RADIUS, 1e6, 1e-5, RADIUS / 4)
    rate = 2 * disk.stopband
    x = np.arange(-(RADIUS + disk.reach), RADIUS + disk.reach, 1 / rate)
    binary = (np.hypot(x[:, None], x) < RADIUS).sum(axis=0)
    f = np.linspace(1e3, disk.passband, 200)
    spectrum = (np.exp(-2j * np.pi * np.outer(f, x)) @ binary) / rate**2
    envelope = np.pi * RADIUS**2 / np.maximum(1, (2 * np.pi * RADIUS * f) ** 1.5)
    assert (np.abs(spectrum - RADIUS * j1(2 * np.pi * RADIUS * f) / f) / envelope).max() > 1e-2


def test_one_inside_zero_outside():
    disk = SoftDisk.cheapest(RADIUS, 1e6, 1e-4, RADIUS / 4)
    inside, outside = (RADIUS - 1.001 * disk.reach), (RADIUS + 1.001 * disk.reach)
    profile = disk.profile(np.array([0.0, inside, RADIUS, outside]))
    np.testing.assert_allclose(profile[[0, 1, 3]], [1, 1, 0], atol=1e-9)
    assert 0.4 < profile[2] < 0.6
