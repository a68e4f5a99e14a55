"""Microvilli: Malus' law, and the effect of steep rays on it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

import optics
from optics import Microvilli
from optics.point_spread.disk_sum import DiskSum
from validation.reference.richards_wolf import Light, focal_integrals

WAVE = 500e-9
SLOW = optics.Pupil(0.5e-3, thin_lens_focal_length=10e-3)
STEEP = optics.Pupil(0.9e-3, thin_lens_focal_length=1e-3)


def slow(**others):
    return optics.vector_focus(SLOW, WAVE, dx=1e-6, shape=(41, 41), **others)


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("azimuth", [0.0, 30.0, 117.0])
@pytest.mark.parametrize("ratio", [math.inf, 5.0])
def test_flat_rays_obey_malus(azimuth, ratio):
    """The signal is cos² of the angle between polarisation and microvilli, plus sin² divided by the dichroic ratio,
    except for errors of order sin²θ of the rays.
    """
    cells = Microvilli(azimuth, ratio)
    for plane in np.radians([0.0, 25.0, 60.0, 90.0, 150.0]):
        light = slow(polarization=(math.cos(plane), math.sin(plane)))
        cos2 = math.cos(plane - math.radians(azimuth)) ** 2
        v = 2 * math.pi / WAVE * math.sin(math.atan(0.05)) * 8e-6
        found = cells.signal(light, 8e-6) / (1 - jv(0, v) ** 2 - jv(1, v) ** 2)  # Airy's disk
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
    """The polarisation sensitivity is the ratio of the signals for the two planes of polarisation. Behind a slow lens,
    it equals the dichroic ratio.
    """
    cells, window = Microvilli(0.0, 10.0), {"dx": 50e-9, "shape": (61, 61)}
    assert cells.polarization_sensitivity(slow(), 8e-6) == pytest.approx(10, rel=0.02)
    found = cells.polarization_sensitivity(optics.vector_focus(STEEP, WAVE, **window), 1e-6)
    planes = [optics.vector_focus(STEEP, WAVE, polarization=p, **window) for p in ((1, 0), (0, 1))]
    assert found == pytest.approx(cells.signal(planes[0], 1e-6) / cells.signal(planes[1], 1e-6))
    assert found < 9


def absorbed_at(x, y, lens, z, jones, cells):
    """Return the absorbed light at places around the focus of a round lens, by Richards and Wolf's integrals."""
    radius, focal = lens.radius, lens.thin_lens_focal_length

    def light(theta):
        r = z * np.tan(theta)
        path = np.hypot(r, z) - z - (np.hypot(r, focal) - focal)
        return np.exp(2j * np.pi * path / WAVE) / np.cos(theta)

    ends, k = (0.0, math.atan2(radius, z)), 2 * math.pi / WAVE
    along, axial, twice, _ = focal_integrals(np.hypot(x, y), k, z, ends, Light(light, 6.0))
    phi, (p, q) = np.arctan2(y, x), np.array(jones) / np.linalg.norm(jones)
    ex = p * (along + twice * np.cos(2 * phi)) + q * twice * np.sin(2 * phi)
    ey = p * twice * np.sin(2 * phi) + q * (along - twice * np.cos(2 * phi))
    ez = -2j * axial * (p * np.cos(phi) + q * np.sin(phi))
    turn = math.radians(cells.azimuth_deg)
    with_them = np.abs(ex * math.cos(turn) + ey * math.sin(turn)) ** 2
    across = np.abs(ex) ** 2 + np.abs(ey) ** 2 + np.abs(ez) ** 2 - with_them
    return (with_them + across / cells.dichroic_ratio) / (math.pi * radius**2)


def integral(radius, centre, picture):
    """Return the integral of an image over a disk, by Gauss nodes in polar coordinates."""
    nodes, weights = np.polynomial.legendre.leggauss(30)
    r, turns = radius * (nodes + 1) / 2, 2 * np.pi * np.arange(90) / 90
    x, y = centre[0] + np.outer(r, np.cos(turns)), centre[1] + np.outer(r, np.sin(turns))
    return (
        float((weights * r * radius / 2) @ picture(x.ravel(), y.ravel()).reshape(x.shape).sum(axis=1)) * 2 * np.pi / 90
    )


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("seed", range(16))
def test_predicted_errors_hold_for_any_receptor_and_samples(seed):
    """Receptors are 0.05 to 4 λ/NA wide, and anywhere near the focus. Samples are up to 0.7 λ/NA apart, in windows of
    at least three samples. A sum over the samples within the disk would have a median error of about 20 %.
    """
    rng = np.random.default_rng(seed)
    sine = float(rng.choice([0.05, 0.2, 0.5, 0.8, 0.9]))
    lens = optics.Pupil(8e-3 * math.tan(math.asin(sine)), thin_lens_focal_length=8e-3)
    unit, z = WAVE / sine, 8e-3 + float(rng.choice([0.0, rng.uniform(-2, 2)])) * WAVE / sine**2
    radius, centre = float(10 ** rng.uniform(-1.3, 0.6)) * unit, tuple(rng.uniform(-1.5, 1.5, 2) * unit)
    cells = Microvilli(float(rng.uniform(0, 180)), float(rng.choice([1, 3, 10, math.inf])))
    jones, dx = rng.normal(size=2) + 1j * rng.normal(size=2), float(rng.uniform(0.05, 0.7)) * unit
    n = 2 * math.ceil((math.hypot(*centre) + radius) / dx) + 1
    plane_waves = {"polarization": jones, "tolerance": 0.3}  # as in the integrals
    light = optics.vector_focus(lens, WAVE, z, dx=dx, shape=(n, n), **plane_waves)
    assert light.plan.method == "plane_waves"
    found, error = cells.signal(light, radius, centre, with_error=True)
    expected = integral(radius, centre, lambda x, y: absorbed_at(x, y, lens, z, jones, cells))
    # Out of focus the lens' rays go to its focus, and rays of the integrals go to the image.
    turned = 0.0 if z == 8e-3 else 1e-4 * found
    assert abs(found - expected) < min(error, 1.1e-6 + turned)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(
    ("sine", "focal", "wavefront", "aperture"),
    [
        (0.2, 0.3e-3, None, optics.Circle()),
        (0.2, 0.3e-3, optics.Zernike({(3, 1): 0.08, (2, 2): 0.05}), optics.Circle()),
        (0.4, 0.08e-3, None, optics.Polygon.regular(6, 10.0)),
    ],
)
@pytest.mark.parametrize("defocus", [0.0, 1.5, -4.0])
@pytest.mark.parametrize(("tolerance", "worst"), [(0.3, 2.0), (1e-3, 4e-3)])
def test_what_light_errs_by_is_told(sine, focal, wavefront, aperture, defocus, tolerance, worst):
    """The scalar image, computed by plane waves or exactly, is compared with `psf` at a tolerance of 1e-6. The reported
    error exceeds the tolerance if a disk holds less light than the window.
    """
    lens = optics.Pupil(
        focal * math.tan(math.asin(sine)), thin_lens_focal_length=focal, wavefront=wavefront, aperture=aperture
    )
    unit, z = WAVE / sine, focal + defocus * WAVE / sine**2
    window = {"dx": unit / 4, "shape": (33, 33)}
    light = optics.vector_focus(lens, WAVE, z, tolerance=tolerance, **window)
    exact = optics.psf(lens, [WAVE], z, tolerance=1e-6, dtype="float64", **window)
    ratios = []
    for radius in (0.5 * unit, 2 * unit):
        disk = DiskSum.over(light, radius)
        found, error = disk.integrate(disk.light.scalar)
        off = abs(found - float(optics.encircled_energy(exact, radius)[0, 0]))
        assert off < error < worst * found + 2e-6
        ratios.append(error / off)
    # In focus nearly all of the reported error belongs to single components, and a sum does not have it.
    assert tolerance == 1e-3 or defocus == 0 or min(ratios) < 100


@pytest.mark.slow
def test_signals_do_not_depend_on_samples():
    """The signals and the polarisation sensitivity behind a rotated hexagon are the same in coarse windows, in narrow
    ones, and in windows with an even number of samples.
    """
    hexagon = optics.Pupil(1e-3, thin_lens_focal_length=2e-3, aperture=optics.Polygon.regular(6))
    cells, angle, place = Microvilli(20.0, 8.0), (0.1, -0.05), (0.3e-6, -0.2e-6)
    windows = [(0.1e-6, (61, 61)), (0.7e-6, (5, 5)), (1e-6, (4, 6))]
    how = {"source_angle": angle, "tolerance": 1e-4}
    lights = [optics.vector_focus(hexagon, WAVE, dx=dx, shape=shape, **how) for dx, shape in windows]
    where = [(light.centre[0] + place[0], light.centre[1] + place[1]) for light in lights]
    signals = [cells.signal(light, 0.6e-6, at) for light, at in zip(lights, where, strict=True)]
    np.testing.assert_allclose(signals, signals[0], rtol=3e-6)
    ratios = [cells.polarization_sensitivity(light, 0.6e-6, at) for light, at in zip(lights, where, strict=True)]
    np.testing.assert_allclose(ratios, ratios[0], rtol=3e-6)
    assert cells.signal(lights[0], 0.6e-6) != pytest.approx(signals[0], rel=1e-2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Microvilli(400.0), "azimuth_deg = 400"),
        (lambda: Microvilli(0.0, 0.5), "dichroic_ratio = 0.5"),
        (lambda: Microvilli().absorbed(1.0), "light = 1.0"),
        (lambda: Microvilli().signal(slow(), 1e-3), "radius = 0.001 m: must end within the window, 2e-05 m"),
        (lambda: Microvilli().signal(slow(), -1e-6), "radius = -1e-06"),
        (lambda: Microvilli().signal(slow(), 1e-6, (3e-5, 0)), "centre = .* within the window"),
        (lambda: Microvilli().signal(replace(slow(), towards=None), 8e-6), "not from vector_focus"),
        (lambda: Microvilli().signal(replace(slow(), dx=1e-3), 5e-3), r"dx=1.67e-06, shape=\(6019, 6019\)"),
        (lambda: Microvilli().polarization_sensitivity(slow(polarization=(1, 0)), 8e-6), "light is polarised"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(("name", "low", "high"), [("azimuth_deg", -360, 360), ("dichroic_ratio", 1, 1e12)])
def test_limits_of_microvilli(name, low, high):
    for value in (low, high):
        assert getattr(optics.Microvilli(**{"azimuth_deg": 0.0, name: value}), name) == value
    for value in (low - 0.5, high * 1.001):
        with pytest.raises(ValueError, match=rf"^{name} = "):
            optics.Microvilli(**{"azimuth_deg": 0.0, name: value})
