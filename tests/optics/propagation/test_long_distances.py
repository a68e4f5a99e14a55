"""Fields that travel millions of wavelengths in float64 are as accurate as fields that travel a few.

The number of waves of the path, z/λ, has a rounding error proportional to z/λ. At 10⁶ wavelengths it is an error of the
phase of about 10⁻⁹. Therefore no formula may round the whole path.
"""

from fractions import Fraction

import numpy as np
import pytest

import optics
from validation.reference import relative_l2

WAVELENGTH = 500e-9
SIDE = 52
# A Gaussian of waist 4.2 samples is below exp(-38) at the sides of 52 samples and at their Nyquist frequency, so that
# neither adds an error.
SAMPLES_PER_WAIST = 4.2


def spot(distance, share):
    """Return a Gaussian beam whose Rayleigh length is share² times the distance, the pitch of its samples, and its
    waist.
    """
    waist = share * np.sqrt(abs(distance) * WAVELENGTH / np.pi)
    x = (np.arange(SIDE) - SIDE // 2) * waist / SAMPLES_PER_WAIST
    return np.exp(-np.add.outer(x**2, x**2) / waist**2), float(waist / SAMPLES_PER_WAIST), waist


def exact(u, dx, distance, x, y):
    """Return the field without its carrier, ∫ Û exp(ikz (cos θ - 1)) exp(2πi f·x) df over the band of the samples. With
    cos θ - 1 = -sin²θ / (1 + cos θ), the rounding error is not proportional to the distance.
    """
    nodes, weights = np.polynomial.legendre.leggauss(160)
    f, df = 0.5 / dx * nodes, 0.5 / dx * weights
    at = (np.arange(SIDE) - SIDE // 2) * dx
    spectrum = np.exp(-2j * np.pi * np.outer(f, at)) @ u @ np.exp(-2j * np.pi * np.outer(at, f)) * dx**2
    s2 = np.add.outer(f**2, f**2) * WAVELENGTH**2
    spectrum = spectrum * np.exp(-2j * np.pi * distance / WAVELENGTH * s2 / (1 + np.sqrt(1 - s2))) * np.outer(df, df)
    return np.exp(2j * np.pi * np.outer(y, f)) @ spectrum @ np.exp(2j * np.pi * np.outer(f, x))


# The predicted error is 6e-13. Rounding of z/λ would exceed it from 10⁴ wavelengths on, and reach 1e-7 at 10⁹.
@pytest.mark.parametrize("seed", range(12))
def test_float64_keeps_its_accuracy_over_any_distance(seed):
    rng = np.random.default_rng(seed)
    distance = float(rng.choice([-1, 1]) * WAVELENGTH * 10 ** rng.uniform(3.5, 9))
    u, dx, waist = spot(distance, rng.uniform(0.5, 2))
    # The window lies within the beam, whose waist at this distance is at least 1.1 times the initial one.
    window = {"out_dx": dx * rng.uniform(0.3, 1), "out_centre": tuple(rng.uniform(-0.3, 0.3, 2) * waist)}
    shape = tuple(int(n) for n in rng.integers(8, SIDE, 2))
    asked = {"dx": dx, "wavelength": WAVELENGTH, "distance": distance, "dtype": "float64", "tolerance": 3e-12}
    found = optics.propagate(u, out_shape=shape, **window, **asked)
    true = exact(u, dx, distance, found.x, found.y)
    assert found.plan.predicted_error <= 1e-12
    assert relative_l2(np.abs(found.u) ** 2, np.abs(true) ** 2) <= found.plan.predicted_error


@pytest.mark.parametrize("seed", range(4))
def test_the_phase_of_a_long_path_is_that_of_the_exact_quotient(seed):
    """The number of waves of the carrier is the exact quotient of the two float64 numbers z and λ, rounded once."""
    rng = np.random.default_rng(seed)
    distance = float(WAVELENGTH * 10 ** rng.uniform(4, 9))
    u, dx, waist = spot(distance, 1.0)
    found = optics.propagate(
        u, dx=dx, wavelength=WAVELENGTH, distance=distance, method="fresnel", dtype="float64", tolerance=3e-12
    )
    # The paraxial beam (Siegman, Lasers, §17.1) in units of its waist.
    spread = 1 + 1j * distance * WAVELENGTH / (np.pi * waist**2)
    beam = np.exp(-np.add.outer(found.y**2, found.x**2) / (waist**2 * spread)) / spread
    beam = beam * np.exp(2j * np.pi * float(Fraction(distance) / Fraction(WAVELENGTH) % 1))
    assert np.linalg.norm(found.u - beam) <= 1e-12 * np.linalg.norm(beam)  # twice the predicted rounding error


@pytest.mark.parametrize("distance", [5e-3, 0.5])
def test_light_at_the_beginning_of_a_fade_is_in_the_prediction(distance):
    """Most of a tilted beam is outside a narrow window, and is faded out. Light close to the sides of the window is at
    the beginning of the fade, which blurs it back into the window. It loses too little power there for the lost power
    to indicate the error.
    """
    side, tilt, stretch, outputs = 84, 0.15, 3.3, 40
    dx = float(np.sqrt(distance * WAVELENGTH / 3000))
    x = np.arange(side) - side // 2
    u = np.exp(-((x / 6.0) ** 2) + 2j * np.pi * tilt * x)
    centre = distance * WAVELENGTH * tilt / dx
    found = optics.propagate(
        np.outer(u, u), dx=dx, wavelength=WAVELENGTH, distance=distance, out_dx=stretch * dx, dtype="float64",
        out_shape=(outputs, outputs), out_centre=(centre, centre), tolerance=1e-9, method="fresnel",
    )  # fmt: skip
    # The paraxial field is a product of two sums over one axis. 6000 frequencies repeat it every 6000 samples, out of
    # reach of the light, which spreads over 3000.
    f = (np.arange(6000) / 6000 - 0.5) / dx
    spectrum = np.exp(-2j * np.pi * np.outer(f, x * dx)) @ u * np.exp(-1j * np.pi * distance * WAVELENGTH * f**2)
    along = np.exp(2j * np.pi * np.outer(found.x, f)) @ spectrum / 6000
    bright = np.abs(np.outer(along, along)) ** 2
    assert relative_l2(np.abs(found.u) ** 2, bright) <= found.plan.predicted_error
