"""The error of scalar theory that plans report: against Richards and Wolf's integrals, and the vector focus of many
pupils."""

import math

import numpy as np
import pytest

import optics
from optics.methods.scalar_theory import IN_FOCUS, MARGIN, light_spread, scalar_theory_error
from validation.reference.richards_wolf import Light, focal_integrals

WAVE, F = 500e-9, 2e-3
MODES = [(2, -2), (2, 0), (2, 2), (3, -3), (3, -1), (3, 1), (3, 3), (4, 0), (4, 2)]
TWO_HOLES = optics.union(optics.Disk(0.05, (0.9, 0.0)), optics.Disk(0.05, (-0.9, 0.0)))


def lens(sine, **others):
    return optics.Pupil(F * math.tan(math.asin(sine)), thin_lens_focal_length=F, **others)


def in_focus(sine):
    """Return the relative L2 errors over the plane, in light polarised along x and in unpolarised light. The field (I₀
    + I₂ cos 2φ, I₂ sin 2φ, -2i I₁ cos φ) around the axis has an intensity a + b cos 2φ.
    """
    rho = np.linspace(0, 25 / sine, 1500) * WAVE
    light = Light(lambda theta: 1 / np.cos(theta))
    along, axial, twice, scalar = focal_integrals(rho, 2 * math.pi / WAVE, F, (0.0, math.asin(sine)), light)
    mean, varying = along**2 + twice**2 + 2 * axial**2, 2 * along * twice + 2 * axial**2
    off = mean - scalar**2
    polarised = np.sum(rho * (off**2 + varying**2 / 2)) / np.sum(rho * (mean**2 + varying**2 / 2))
    return math.sqrt(polarised), math.sqrt(np.sum(rho * off**2) / np.sum(rho * mean**2))


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("sine", [0.01, *(sine for sine, _ in IN_FOCUS[1:])])
def test_a_round_pupil_in_focus_errs_as_tabulated(sine):
    polarised, unpolarised = in_focus(sine)
    assert scalar_theory_error(sine) == pytest.approx(MARGIN * polarised, rel=2e-3)
    assert unpolarised < polarised < 1.25 * unpolarised


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("sine", [0.1, 0.3])
def test_unpolarised_light_errs_by_what_curvature_it_has(sine):
    """The error is -∇²I/4k² to second order, which follows from Airy's pattern without vector theory."""
    u = np.linspace(1e-6, 80, 20001)
    from scipy.special import j1, jv

    airy, slope = (2 * j1(u) / u) ** 2, -8 * j1(u) * jv(2, u) / u**2
    curved = np.gradient(u * slope, u) / u
    expected = math.sqrt(np.sum(u * curved**2) / np.sum(u * airy**2)) / 4 * sine**2
    assert in_focus(sine)[1] == pytest.approx(expected, rel=0.02 + sine**2 / 2)


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        ({}, 1 / 4),
        ({"aperture": optics.Annulus(0.9)}, (1 + 0.9**2) / 4),
        ({"aperture": optics.Slit(0.1, 1.2)}, 1.2**2 / 12),
        ({"aperture": optics.Polygon.regular(6, 11.0)}, 5 / 24),
        ({"aperture": TWO_HOLES}, 0.9**2 + 0.05**2 / 4),
        ({"mask": optics.GaussianMask(0.2e-3)}, 0.2e-3**2 / 2 / (F * math.tan(math.asin(0.3))) ** 2),
        ({"mask": optics.MaskMap(np.zeros((9, 9)))}, 0),
    ],
)
def test_spread_of_light_over_a_pupil(others, expected):
    assert light_spread(lens(0.3, **others)) == pytest.approx(expected, rel=5e-3)


def test_steep_plans_name_it_and_others_do_not():
    steep = optics.plan(
        optics.Pupil(62e-6, thin_lens_focal_length=30e-6), WAVE, 30e-6, dx=0.1e-6, shape=(33, 33), tolerance=1e-2
    )
    assert steep.scalar_error == pytest.approx(MARGIN * in_focus(0.9)[0], rel=0.02)
    assert "scalar theory    error up to 0.6" in str(steep)
    hole = optics.plan(optics.Pupil(30e-6), WAVE, 30e-6, dx=0.5e-6, shape=(33, 33), tolerance=1e-2)
    assert hole.scalar_error < 1e-3  # the same angle, but the light goes straight on
    assert "scalar theory" not in str(hole)


def test_plans_of_batches_report_it_too():
    """Plans of a batch report the error, equal to that of a single pupil."""
    eye = optics.Pupil(20e-6, aperture=optics.Annulus(0.5), thin_lens_focal_length=100e-6)
    window = {"dx": 0.3e-6, "shape": (33, 33), "tolerance": 0.02}
    [together] = optics.psf_batch([eye], [WAVE], **window).plans
    alone = optics.plan(eye, WAVE, 100e-6, **window)
    assert together.scalar_error == pytest.approx(alone.scalar_error)
    assert together.scalar_error == pytest.approx(scalar_theory_error(math.sin(math.atan(0.2)), 1.25 / 4))
    hole, window = optics.Pupil(50e-6), {"dx": 0.2e-6, "shape": (33, 33), "tolerance": 0.05}
    [straight] = optics.psf_batch([hole], [WAVE], 240e-6, **window).plans
    assert straight.scalar_error == pytest.approx(optics.plan(hole, WAVE, 240e-6, **window).scalar_error, rel=0.3)


def pupils(rng):
    """Return a random pupil of any kind, aberrated by up to 0.6 waves, with its NA and its defocus [λ/NA²]."""
    sine = float(rng.choice([0.1, 0.3, 0.5, 0.7, 0.85, 0.9]))
    weights = rng.normal(size=len(MODES))
    rms = float(rng.choice([0.0, 0.03, 0.07, 0.15, 0.3, 0.6])) * WAVE * 1e6
    waves = {mode: float(at) * rms for mode, at in zip(MODES, weights / np.linalg.norm(weights), strict=True)}
    radius, turn = F * math.tan(math.asin(sine)), float(rng.uniform(0, 60))
    across = float(rng.uniform(0.1, 1.2))
    kinds = (
        {},
        {"aperture": optics.Annulus(float(rng.uniform(0.2, 0.95)))},
        {"aperture": optics.Polygon.regular(int(rng.integers(3, 8)), turn)},
        {"aperture": optics.Slit(across, 0.999 * math.sqrt(4 - across**2))},
        {"aperture": TWO_HOLES},
        {"mask": optics.GaussianMask(float(rng.uniform(0.4, 1.5)) * radius)},
    )
    kind = kinds[int(rng.integers(len(kinds)))]
    wavefront = optics.Zernike(waves) if rms else None
    return lens(sine, wavefront=wavefront, **kind), sine, float(rng.choice([0.0, rng.uniform(-2, 2)]))


def errors(light, rng):
    """Return errors of scalar theory over windows of several widths around the brightest sample, for unpolarised light
    and for 8 planes of polarisation.
    """
    y, x = np.unravel_index(light.scalar.argmax(), light.scalar.shape)
    turns = np.arange(8) * np.pi / 8
    fields = np.tensordot(np.stack([np.cos(turns), np.sin(turns)], 1), light.parts, axes=1) * math.sqrt(2)
    pictures = [light.psf, *(np.abs(fields) ** 2).sum(axis=1)]
    for half in (1, 2, 4, 8, 16, 32):
        down, right = rng.integers(-half + 1, half, 2)
        rows, columns = (slice(max(0, at - half), at + half + 1) for at in (y + down, x + right))
        for picture in pictures:
            here, there = picture[rows, columns], light.scalar[rows, columns]
            yield float(np.linalg.norm(here - there) / np.linalg.norm(here))


@pytest.fixture(scope="module")
def ratios():
    """Return the ratios of actual and predicted errors, (case, window and polarisation)."""
    rng, found = np.random.default_rng(5), []
    for _ in range(36):
        pupil, sine, defocus = pupils(rng)
        z, window = F + defocus * WAVE / sine**2, {"dx": WAVE / sine / 8, "shape": (65, 65)}
        plan = optics.plan(pupil, WAVE, z, tolerance=0.1, method="rayleigh_sommerfeld", **window)
        light = optics.vector_focus(pupil, WAVE, z, **window)
        found.append([error / plan.scalar_error for error in errors(light, rng)])
    return np.array(found)


@pytest.mark.slow
def test_plans_say_no_less_than_scalar_theory_errs_by(ratios):
    assert np.mean(ratios <= 1) >= 0.99
    assert ratios.max() < 1.5


@pytest.mark.slow
def test_nor_much_more(ratios):
    worst = ratios.max(axis=1)
    assert np.median(worst) > 1 / 2.5
    assert np.mean(worst > 1 / 5) > 0.95
