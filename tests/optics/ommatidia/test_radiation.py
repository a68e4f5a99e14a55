"""Radiation of modes: against the integral over their field in the plane, or the tilted plane, at the rhabdom's end."""

import math

import numpy as np
import pytest

from optics import Waveguide
from optics.ommatidia.radiation import radiated, reach

WAVE, N = 450e-9, 1.34
K = 2 * math.pi * N / WAVE


def integral(modes, x, y, end):
    """Return the Rayleigh-Sommerfeld integral over a plane that faces the pupil's centre, on a fine polar grid."""
    b, far = modes[0].radius, reach(modes)
    r, weight = [], []
    for low, high, n in ((0, b, 40), (b, far, 120)):
        at, share = np.polynomial.legendre.leggauss(n)
        r.append((low + high) / 2 + (high - low) / 2 * at)
        weight.append(share * (high - low) / 2)
    r, weight = np.concatenate(r), np.concatenate(weight)
    phi = 2 * np.pi * np.arange(140) / 140
    u, v = np.outer(r, np.cos(phi)).ravel(), np.outer(r, np.sin(phi)).ravel()
    size = np.repeat(weight * r * 2 * np.pi / 140, 140)
    end = np.array(end)
    axis, normal = -end / np.linalg.norm(end), np.array([0, 0, -1.0])
    w = np.cross(normal, axis)
    cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    turn = np.eye(3) + cross + cross @ cross / (1 + axis @ normal)  # Rodrigues
    place = end[:, None] + np.outer(turn[:, 0], u) + np.outer(turn[:, 1], v)
    field = np.array([mode.field(u, v) * size for mode in modes])
    d = np.sqrt((place[0] - x[:, None]) ** 2 + (place[1] - y[:, None]) ** 2 + place[2] ** 2)
    kernel = place[2] / (2 * np.pi * d**2) * (1 / d - 1j * K) * np.exp(1j * K * (d - np.linalg.norm(end)))
    return field @ kernel.T


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(
    ("diameter", "radius", "end", "within"),
    [
        (1.4e-6, 12e-6, (0.0, 0.0, 67e-6), 1e-6),
        (3e-6, 30e-6, (0.0, 0.0, 67e-6), 1e-6),
        (1.4e-6, 12e-6, (20e-6, -9e-6, 67e-6), 5e-3),  # the plane's tilt changes each point's obliquity a little
        (2e-6, 100e-6, (0.0, 80e-6, 240e-6), 2e-3),
    ],
)
def test_modes_radiate_what_their_field_does(diameter, radius, end, within):
    modes = Waveguide(diameter, 1.38, N).modes(WAVE)
    rng = np.random.default_rng(1)
    r, phi = radius * np.sqrt(rng.random(25)), 2 * np.pi * rng.random(25)
    x, y = r * np.cos(phi), r * np.sin(phi)
    expected = integral(modes, x, y, end)
    assert len(modes) >= 3
    np.testing.assert_allclose(radiated(modes, x, y, end, K), expected, atol=within * np.abs(expected).max())
