"""Predicted errors of measures bound the true errors of random pupils, and are not much larger than necessary."""

import math

import numpy as np
import pytest
from scipy.special import j0, j1

import optics
from optics.point_spread.arriving import arriving_light

WAVELENGTH = 550e-9
RNG = np.random.default_rng(46)
OPENINGS = [optics.Circle(), optics.Annulus(0.6), optics.Slit(0.5, 1.2), optics.Polygon.regular(5)]


def pupil_of(rng, waves, aperture=None):
    """A pupil `waves` wavelengths in radius at f/1 to f/4, blurred by up to half a wave of spherical aberration."""
    radius = waves * WAVELENGTH
    focus = 2 * radius * rng.uniform(1, 4)
    blur = optics.Zernike({(4, 0): rng.uniform(0, 0.1)})
    return optics.Pupil(radius, thin_lens_focal_length=focus, aperture=aperture or optics.Circle(), wavefront=blur)


@pytest.mark.parametrize("waves", RNG.uniform(0.6, 6, 6))
def test_arriving_light_of_a_bare_circle_is_airys(waves):
    """Light at frequencies beyond 1/λ is J₀² + J₁² of 2πR/λ. Its estimate from the edge has errors of up to 0.015."""
    seen = optics.psf(optics.Pupil(waves * WAVELENGTH), sensor_distance=5e-6, dx=0.2e-6, shape=(9, 9))
    light, unsure = arriving_light(seen, None)
    v = 2 * math.pi * waves
    assert abs(light[0] - (1 - j0(v) ** 2 - j1(v) ** 2)) < 3e-6 < unsure[0] <= 1e-4


@pytest.mark.parametrize(("aperture", "waves"), zip(OPENINGS, RNG.uniform(0.9, 2.5, 4), strict=True))
def test_contrasts_of_narrow_pupils_are_within_their_bound(aperture, waves):
    """MTFs of pupils a few wavelengths wide were refused, because the light that arrives was uncertain by 2 to 6 %."""
    pupil = pupil_of(RNG, waves, aperture)
    pitch = 0.4 * WAVELENGTH * math.hypot(pupil.radius, pupil.thin_lens_focal_length) / (2 * pupil.radius)
    narrow, wide = (
        optics.psf(pupil, [WAVELENGTH], dx=pitch, shape=(n, n), tolerance=tolerance, dtype="float64")
        for n, tolerance in ((41, 1e-3), (401, 1e-5))
    )
    light = arriving_light(wide, None)[0][0]
    assert -1e-4 < light - wide.window_sums[0] < 5e-3
    found = optics.mtf(narrow, tolerance=0.03)
    exact = optics.mtf(wide, arriving=light, tolerance=0.03)
    f = np.linspace(0.02, 0.95, 25) * found.cutoff[0]
    off = np.abs(found.profile(f) - exact.profile(f)).max()
    assert off < found.predicted_error[0] + exact.predicted_error[0] < 0.03


@pytest.mark.parametrize("seed", range(6))
def test_encircled_energy_is_within_its_bound(seed):
    """Sums over coarse and fine samples differ by less than the bound, which was at least 2e-4."""
    rng = np.random.default_rng(seed)
    pupil = pupil_of(rng, rng.uniform(5, 40), OPENINGS[seed % 4])
    unit = WAVELENGTH * math.hypot(pupil.radius, pupil.thin_lens_focal_length) / (2 * pupil.radius)
    n, apart = 2 * int(rng.integers(8, 20)) + 1, rng.uniform(0.15, 0.6)
    radii = rng.uniform(0, n // 2, 5) * apart * unit
    exact = optics.psf(
        pupil,
        [WAVELENGTH],
        dx=0.11 * unit,
        shape=(2 * int(n * apart / 0.22) + 19,) * 2,
        tolerance=1e-7,
        dtype="float64",
    )
    (true,), (least,) = optics.encircled_energy(exact, radii, with_error=True)
    assert least.max() < 1.5e-5
    for tolerance in (1e-2, 1e-3):
        seen = optics.psf(pupil, [WAVELENGTH], dx=apart * unit, shape=(n, n), tolerance=tolerance)
        (found,), (bound,) = optics.encircled_energy(seen, radii, with_error=True)
        assert (np.abs(found - true) < bound + least).all()
        (value,), (sure,) = optics.strehl_ratio(seen, with_error=True)
        assert abs(value - optics.strehl_ratio(exact)[0]) < sure + 4e-5
