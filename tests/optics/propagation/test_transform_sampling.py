"""Padding of a finite transform: light at Nyquist's frequency ends as if cut off, and blurs."""

import math

import numpy as np
import pytest

import optics
from optics.numerics.grid import Grid
from optics.propagation.transfer_function import EVERYTHING, Passage
from optics.propagation.transform_sampling import blurred_back, sampling

WAVELENGTH = 550e-9
# [m] of padding. Compared with almost none, the blur falls to a fifth (disk near the window) ... a thirtieth, which
# changes the reference of an estimate by at most 10 %. Twice the padding halves that and costs seven times more.
FAR = 0.6e-3
# Allowed error of the estimate. It assumes that Nyquist's light is incoherent and even over the source. If it is
# neither (all rows of a square are alike), the largest error found was a factor of three.
FACTOR = 5


def disk(n, dx, radius):
    x = (np.arange(n) - n // 2) * dx
    return (np.hypot.outer(x, x) <= radius).astype(complex)


def square(n, dx, radius):
    inside = np.abs((np.arange(n) - n // 2) * dx) <= radius
    return np.outer(inside, inside).astype(complex)


def noise(n, dx, radius):
    return disk(n, dx, radius) * np.exp(2j * np.pi * np.random.default_rng(0).random((n, n)))


def carried(u, dx, z, window, spare, paraxial):
    """Return the field in the window, and the relative error of its intensity that `blurred_back` predicts."""
    how = sampling(Passage(WAVELENGTH, z, paraxial, EVERYTHING, 3e-6, window.centre), Grid(u.shape, dx), window, spare)
    assert how.passage.band == EVERYTHING  # otherwise nothing would be cut off
    period, n, m = how.period, u.shape[0], window.shape[0]
    wrapped = np.zeros((n, period), complex)
    wrapped[:, :n] = u
    spectrum = np.fft.fft(np.roll(wrapped, -(n // 2), axis=1), axis=1)  # for the rows that hold light
    spectrum = np.fft.fft(np.roll(np.pad(spectrum, ((0, period - n), (0, 0))), -(n // 2), axis=0), axis=0)
    f = np.fft.fftfreq(period, dx)
    f2 = f[:, None] ** 2 + f[None, :] ** 2
    waves = z / WAVELENGTH - z * WAVELENGTH * f2 / 2 if paraxial else z * np.sqrt(np.maximum(WAVELENGTH**-2 - f2, 0))
    waves = waves + f[None, :] * window.centre[0] + f[:, None] * window.centre[1]
    at = (np.arange(m) - m // 2) * round(window.dx / dx) % period
    out = np.fft.ifft(np.fft.ifft(spectrum * np.exp(2j * np.pi * waves), axis=0)[at], axis=1)[:, at]
    power = np.sum(np.abs(out) ** 2) * (window.dx / dx) ** 2
    return out, 2 * math.sqrt(blurred_back(spectrum.T, how) / power)


class TestBlur:
    @pytest.mark.fast_cases(2)
    @pytest.mark.parametrize("source", [disk, square, noise])
    @pytest.mark.parametrize(
        ("dx", "z", "radius", "m", "step", "centre", "paraxial"),
        [
            (0.47e-6, 200e-6, 50e-6, 129, 2, (0.0, 0.0), False),
            (0.47e-6, 200e-6, 50e-6, 129, 2, (0.0, 0.0), True),
            (0.4e-6, 100e-6, 20e-6, 65, 1, (20e-6, 0.0), True),
            (0.34e-6, 60e-6, 20e-6, 65, 1, (0.0, 10e-6), True),
        ],
    )
    def test_is_about_what_it_is_said_to_be(self, source, dx, z, radius, m, step, centre, paraxial):
        u, window = source(2 * int(radius / dx) + 3, dx, radius), Grid((m, m), step * dx, centre)
        exact, _ = carried(u, dx, z, window, FAR, paraxial)
        found, said = carried(u, dx, z, window, 1e-6, paraxial)
        actual = np.linalg.norm(np.abs(found) ** 2 - np.abs(exact) ** 2) / np.linalg.norm(np.abs(exact) ** 2)
        assert actual / FACTOR < said < actual * FACTOR

    @pytest.mark.slow
    def test_falls_with_the_room(self):
        """The error falls like 1 / padding if the padding is wide. For a source of 130 µm and a window of 120 µm, the
        nearest repeated light is closer than that.
        """
        u, window = disk(215, 0.47e-6, 50e-6), Grid((129, 129), 0.94e-6)
        said = [carried(u, 0.47e-6, 200e-6, window, room, True)[1] for room in (200e-6, 400e-6, 800e-6)]
        assert 1.4 < said[0] / said[1] < 2
        assert 1.6 < said[1] / said[2] < 2.1

    def test_is_nothing_for_what_ends_before_nyquist(self):
        """A smooth beam has almost no light at Nyquist's frequency."""
        n, dx = 215, 0.47e-6
        x = (np.arange(n) - n // 2) * dx
        u = np.exp(-np.add.outer(x**2, x**2) / (15e-6) ** 2).astype(complex)
        assert carried(u, dx, 200e-6, Grid((129, 129), 0.94e-6), 1e-6, False)[1] < 1e-6

    def test_propagate_makes_room_for_it(self):
        u, dx, z, window = disk(215, 0.47e-6, 50e-6), 0.47e-6, 200e-6, Grid((129, 129), 0.94e-6)
        settings = {"dx": dx, "wavelength": WAVELENGTH, "distance": z, "out_dx": window.dx, "out_shape": window.shape}
        far = np.abs(carried(u, dx, z, window, 2 * FAR, False)[0]) ** 2
        for tolerance in (3e-3, 1e-3):
            found = np.abs(optics.propagate(u, **settings, tolerance=tolerance, dtype="float64").u) ** 2
            assert np.linalg.norm(found - far) < tolerance * np.linalg.norm(far)


def test_no_room_where_none_would_do():
    """White noise has much light at the Nyquist frequency. More padding cannot reduce its error, because the samples
    themselves do not determine the field.
    """
    dx, z, window = 0.47e-6, 200e-6, Grid((129, 129), 0.94e-6)
    u = noise(213, dx, 50e-6)
    settings = {"dx": dx, "wavelength": WAVELENGTH, "distance": z, "out_dx": window.dx, "out_shape": window.shape}
    for tolerance in (0.3, 1e-4):
        passage = Passage(WAVELENGTH, z, False, EVERYTHING, 3e-3 * tolerance, (0.0, 0.0))
        how = sampling(passage, Grid(u.shape, dx), window, math.sqrt(WAVELENGTH * z))
        assert how.passage.band == EVERYTHING
        plan = optics.propagate(u, **settings, tolerance=tolerance, dtype="float64").plan
        assert plan.samples == (how.period, how.period)
        assert ("Nyquist" in plan.why) == (tolerance == 1e-4)  # an error that padding cannot remove is reported
