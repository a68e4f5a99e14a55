"""Microvilli in eyes: Malus' law and partial polarisation, and the vector focus of a scene with two polarisations."""

import math
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import optics
from optics import Eye, Microvilli
from optics.eye.polarization import polarised_error
from tests.optics.device_types import Float64

WAVE, F = 500e-9, 4e-3
PERFECT = Eye(resolution=(3, 4), bands=2, noise_sigma=0.0)
WHITE = np.ones((2, 6, 8))


def factor(angle, degree, azimuth, ratio):
    """Signal relative to unpolarised light: (ratio cos² + sin²) for the polarised part and (ratio + 1)/2 for the rest,
    divided by the latter."""
    turn = math.radians(angle - azimuth)
    along, across = (1.0, 0.0) if math.isinf(ratio) else (ratio, 1.0)
    plain = (along + across) / 2
    return (degree * (along * math.cos(turn) ** 2 + across * math.sin(turn) ** 2) + (1 - degree) * plain) / plain


@pytest.mark.parametrize("ratio", [1.0, 4.0, math.inf])
@pytest.mark.parametrize(("angle", "azimuth"), [(0.0, 0.0), (90.0, 0.0), (33.0, 33.0), (20.0, -65.0), (170.0, 35.0)])
@pytest.mark.parametrize("degree", [0.0, 0.3, 1.0])
def test_flat_rays_obey_malus(degree, angle, azimuth, ratio):
    eye = replace(PERFECT, microvilli=Microvilli(azimuth, ratio))
    found = eye.see(WHITE, 2, polarization=(degree, angle)) / PERFECT.see(WHITE, 2)
    np.testing.assert_allclose(found, factor(angle, degree, azimuth, ratio), rtol=1e-5, atol=1e-6)


def test_unpolarised_light_is_seen_as_without_microvilli():
    eye = replace(PERFECT, microvilli=Microvilli(30.0), pupil=optics.Pupil(20e-6))
    scene = np.random.default_rng(0).random((2, 6, 8))
    known = replace(eye, microvilli=None).see(scene, 2)
    np.testing.assert_array_equal(eye.see(scene, 2), known)
    np.testing.assert_allclose(eye.see(scene, 2, polarization=(0.0, 45.0)), known, rtol=1e-6)
    assert eye.white_signal == replace(eye, microvilli=None).white_signal


def test_rows_of_microvilli_are_repeated_from_the_top_left():
    rows = [[Microvilli(0.0, 5.0), Microvilli(60.0, 5.0), Microvilli(90.0, 1.0)], [Microvilli(120.0, math.inf)] * 3]
    found = replace(PERFECT, microvilli=rows).see(WHITE, 2, polarization=(0.8, 10.0)) / PERFECT.see(WHITE, 2)
    cells = [[rows[y % 2][x % 3] for x in range(4)] for y in range(3)]
    expected = [[factor(10.0, 0.8, cell.azimuth_deg, cell.dichroic_ratio) for cell in row] for row in cells]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-5)


def test_bands_and_places_may_be_polarised_differently():
    """Each receptor type has its own mixture of bands, and the left half of the scene is polarised at another angle
    than the right half.
    """
    eye = replace(PERFECT, microvilli=Microvilli(0.0, 6.0))
    angle = np.where(np.arange(8) < 4, 0.0, 70.0) * np.ones((6, 1))
    found = eye.see(WHITE, 2, polarization=(np.array([0.2, 0.9]), angle))
    single = np.stack([PERFECT.see(WHITE * (np.arange(2) == band)[:, None, None], 2) for band in range(2)])
    turned = np.array([[factor(at, p, 0.0, 6.0) for at in (0.0, 0.0, 70.0, 70.0)] for p in (0.2, 0.9)])
    np.testing.assert_allclose(found, (single * turned[:, None, None, :]).sum(axis=0), rtol=1e-5)


def by_vector_focus(pupil, receptor, places, cells, left, right):
    """Signals of receptors for a scene that is polarised at one angle left of its middle and at another right of it.
    The reference sums the vector focus times the part of each receptor lit from each side. Columns of the retina ascend
    with x from the left of the visual field."""
    dx = WAVE / math.sin(math.atan(pupil.radius / F)) / 8
    found = np.zeros(len(places))
    for angle, side in ((left, 1), (right, -1)):
        jones = (math.cos(math.radians(angle)), math.sin(math.radians(angle)))
        light = optics.vector_focus(pupil, WAVE, F, polarization=jones, dx=dx, shape=(385, 385))
        profile = cells.absorbed(light).sum(axis=0) * dx**2
        found += np.clip(0.5 + side * (light.grid.x - places[:, None]) / receptor, 0, 1) @ profile
    return found / ((1 + 1 / cells.dichroic_ratio) / 2)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(
    ("left", "right", "wavefront"),
    [
        (0.0, 90.0, None),
        (20.0, 65.0, optics.Zernike({(3, 1): 0.1, (2, 2): 0.06})),
        (45.0, -45.0, optics.Zernike({(3, 1): -0.1})),
    ],
)
def test_a_scene_polarised_in_two_ways_is_the_vector_focus_of_both(left, right, wavefront):
    """The receptor in the middle sees the border between the two polarisations; its neighbours see it only because of
    blur.
    """
    pupil = optics.Pupil(0.4e-3, thin_lens_focal_length=F, wavefront=wavefront)
    receptor, azimuth = 5e-6, 15.0
    eye = Eye(
        pupil,
        resolution=(3, 3),
        fov_deg=math.degrees(2 * math.atan(1.5 * receptor / F)),
        sensor_width=3 * receptor,
        full_aperture=0.8e-3,
        bands=1,
        receptors=optics.Receptors((500.0,), range_nm=(499.0, 501.0)),
        noise_sigma=0.0,
        microvilli=Microvilli(azimuth, 8.0),
    )
    assert eye.spectral_bands.wavelengths[0] == pytest.approx(WAVE)
    scene, angle = np.ones((1, 46, 46)), np.where(np.arange(46) < 23, left, right) * np.ones((46, 1))
    found = (eye.see(scene, 2, polarization=(1.0, angle)) / eye.see(scene, 2))[0, 1]
    places = receptor * np.array([-1.0, 0.0, 1.0])
    expected = by_vector_focus(pupil, receptor, places, eye.microvilli[0][0], left, right)
    np.testing.assert_allclose(found, expected, atol=0.012)  # 0.0062 from steep rays, the rest beyond the windows
    sides = [factor(at, 1.0, azimuth, 8.0) for at in (left, right)]
    assert np.abs(found[[0, 2]] - sides).min() > 0.024  # larger than the signals without blur would allow


def worst(pupil, z, sine):
    """Integral over the image of the difference between the vector focus and Malus' law times scalar theory, relative
    to white."""
    dx = WAVE / sine / 5
    light = optics.vector_focus(pupil, WAVE, z, dx=dx, shape=(121, 121))
    found = []
    for plane in (0.0, 30.0, 45.0, 90.0):
        turn = math.radians(plane)
        field = math.sqrt(2) * (math.cos(turn) * light.parts[0] + math.sin(turn) * light.parts[1])
        one = replace(light, parts=field[None], intensity=np.abs(field) ** 2)
        for azimuth, ratio in ((0.0, math.inf), (90.0, math.inf), (20.0, 5.0)):
            taken = Microvilli(azimuth, ratio).absorbed(one) / ((1 + 1 / ratio) / 2)
            found.append(np.abs(taken - light.scalar * factor(plane, 1.0, azimuth, ratio)).sum() * dx**2)
    return max(found)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("seed", range(12))
def test_steep_rays_err_by_less_than_eyes_allow(seed):
    """The numerical aperture is at most 0.5. Pupils are circles, hexagons, slits and rings, in focus and out of focus,
    with and without aberrations.
    """
    rng = np.random.default_rng(seed)
    sine = float(rng.choice([0.1, 0.2, 0.35, 0.5]))
    aperture = (optics.Circle(), optics.Polygon.regular(6), optics.Slit(0.9, 1.7), optics.Annulus(0.6))[seed % 4]
    modes = {(2, 2): 0.1 * rng.normal(), (3, 1): 0.1 * rng.normal(), (4, 0): 0.05 * rng.normal()}
    wavefront = optics.Zernike({mode: float(at) for mode, at in modes.items()}) if seed % 3 else None
    radius = F * math.tan(math.asin(sine))
    pupil = optics.Pupil(radius, thin_lens_focal_length=F, aperture=aperture, wavefront=wavefront)
    z = F + float(rng.choice([0.0, 1.5, -1.0])) * WAVE / sine**2
    actual = worst(pupil, z, sine)
    assert actual < polarised_error(pupil, z) < 2.5 * actual


@pytest.mark.slow
@pytest.mark.parametrize("angle", [(0.5, 0.0), (0.3, -0.4)])
def test_so_do_they_off_the_axis_across_their_own_ray(angle):
    """The field and the microvilli are turned with the ray through the pupil's centre, by Rodrigues' matrix."""
    pupil = optics.Pupil(F * math.tan(math.asin(0.1)), thin_lens_focal_length=F)
    ray = np.array([math.tan(angle[0]), math.tan(angle[1]), 1.0])
    ray /= np.linalg.norm(ray)
    cross = np.array([[0, 0, ray[0]], [0, 0, ray[1]], [-ray[0], -ray[1], 0]])
    turned = np.eye(3) + cross + cross @ cross / (1 + ray[2])
    np.testing.assert_allclose(turned @ [0, 0, 1], ray, atol=1e-12)
    light = optics.vector_focus(pupil, WAVE, polarization=(1, 0.5), source_angle=angle, dx=WAVE, shape=(121, 121))
    plane, off = math.degrees(math.atan(0.5)), []
    for matrix in (turned, np.eye(3)):
        for azimuth in (0.0, 40.0, 90.0):
            along = matrix @ [math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth)), 0.0]
            taken = np.abs(np.tensordot(along, light.field, axes=1)) ** 2 * 2
            difference = np.abs(taken - light.scalar * factor(plane, 1.0, azimuth, math.inf)).sum()
            off.append(difference / light.scalar.sum())
    assert max(off[:3]) < polarised_error(pupil, F)
    assert max(off[3:]) > 5 * max(off[:3])  # microvilli that are not turned


def test_modes_of_rhabdoms_take_polarised_light_as_squares_do():
    guide = optics.Waveguide(2e-6, 1.36, 1.34)
    eye = Eye(optics.Pupil(12e-6, medium_n=1.34, object_n=1.0), (3, 3), 20.0, 60e-6, bands=1, waveguide=guide)
    scene = np.ones((1, 12, 12))
    known = replace(eye, microvilli=Microvilli(10.0, 7.0))
    found = known.see(scene, 4, polarization=(0.5, 70.0)) / eye.see(scene, 4)
    np.testing.assert_allclose(found, factor(70.0, 0.5, 10.0, 7.0), rtol=1e-5)


def test_derivatives_are_those_of_unpolarised_light_times_the_same():
    """The derivatives are with respect to the radius of the pupil and the waist of a mask. The polarisation is the same
    everywhere.
    """
    slopes = {}
    for polarization in (None, (0.7, 30.0)):
        radius, waist = Float64(12e-6), Float64(10e-6)
        dr.enable_grad(radius, waist)
        pupil = optics.Pupil(radius, mask=optics.GaussianMask(waist), thin_lens_focal_length=120e-6)
        eye = Eye(pupil, (3, 3), 45.0, 100e-6, bands=1, dtype="float64", microvilli=Microvilli(75.0, 5.0))
        dr.backward(dr.sum(eye.see(np.ones((1, 6, 6)), 2, polarization=polarization).array))
        slopes[polarization] = np.array([dr.grad(part).numpy()[0] for part in (radius, waist)])
    plain, polarised = slopes.values()
    assert np.abs(plain).min() > 1e3
    np.testing.assert_allclose(polarised, plain * factor(30.0, 0.7, 75.0, 5.0), rtol=1e-6)


def test_photons_are_those_of_the_polarised_signal():
    """The variance of shot noise is proportional to the signal."""
    eye = replace(
        PERFECT, resolution=(40, 40), microvilli=Microvilli(0.0, math.inf), photon_budget=optics.PhotonBudget(1.0)
    )
    scene, rng = np.ones((2, 40, 40)), np.random.default_rng(0)
    noises = [
        (eye.see(scene, 1, rng, polarization=(0.9, at)) - eye.see(scene, 1, polarization=(0.9, at))).var()
        for at in (0.0, 90.0)
    ]
    assert noises[0] / noises[1] == pytest.approx(1.9 / 0.1, rel=0.15)


CELLS = Microvilli(0.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: replace(PERFECT, microvilli=3.0), "microvilli = 3.0: must be Microvilli"),
        (lambda: replace(PERFECT, microvilli=[[CELLS], [CELLS, CELLS]]), "rows of them, all as long"),
        (lambda: replace(PERFECT, microvilli=[]), "microvilli = "),
        (lambda: replace(PERFECT, microvilli=[[CELLS, None]]), "microvilli = "),
        (lambda: PERFECT.see(WHITE, 2, polarization=(1.0, 0.0)), "this eye has no microvilli"),
        (lambda: seen((1.5, 0.0)), r"degree = 1.5: must be in \[0, 1\]"),
        (lambda: seen((1.0, math.nan)), "angle holds NaN"),
        (lambda: seen(0.5), r"polarization = 0.5: must be \(degree, angle_deg\)"),
        (lambda: seen((np.ones(3), 0.0)), r"degree has shape \(3,\): must be a number, \(2,\), \(6, 8\)"),
        (lambda: seen((1.0, 1j)), "angle: must be real numbers"),
        (
            lambda: Eye(optics.Pupil(100e-6, thin_lens_focal_length=241e-6), microvilli=CELLS),
            "NA 0.38: .* up to 0.091 of white's; tolerance = 0.01 allows NA 0.13",
        ),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def seen(polarization):
    return replace(PERFECT, microvilli=CELLS).see(WHITE, 2, polarization=polarization)


def test_wider_tolerances_allow_steeper_rays():
    steep = optics.Pupil(100e-6, thin_lens_focal_length=241e-6)
    assert Eye(steep, tolerance=0.1, microvilli=CELLS).microvilli == ((CELLS,),)
    assert Eye(steep).microvilli is None
