"""PSFs of many beams at once, against PSFs at a small tolerance; unsuitable beams are left to other methods."""

import math

import drjit as dr
import numpy as np
import pytest

import optics
from optics import Grid, PointSource
from optics.elements.beam import Beam
from optics.elements.light_stack import LightStack
from optics.methods import window_edges, window_plan
from optics.point_spread.coarse_batch import coarse_psfs
from tests.optics.device_types import Float64
from validation.reference import relative_l2

Z, LAMBDA = 240e-6, 550e-9


def eyes(count, radii, seed=0, power=1 / (0.5 * Z), **options):
    """Pupils with random reliefs, to which the heights of a lens are added."""
    rng = np.random.default_rng(seed)
    for radius in rng.uniform(*radii, count):
        lens = optics.BSplineRelief.paraboloid(0, power, radius).control_points
        yield optics.Pupil(radius, optics.BSplineRelief(lens + rng.random((4, 4)) * rng.uniform(0, 3e-6)), **options)


def beam(pupil, source=math.inf, distance=Z, wavelength=LAMBDA):
    return Beam(pupil, PointSource(source), wavelength, distance)


def checked(beams, window, tolerance, dtype="float32"):
    """Return the indices of the PSFs that are computed, after a comparison of each with an accurate one."""
    found = []
    for index, image, plan in coarse_psfs(beams, window, tolerance, dtype):
        light = beams[index]
        ask = {"dx": window.dx, "shape": window.shape, "tolerance": 1e-5, "dtype": "float64"}
        asked = light.pupil, [light.wavelength], light.distance, light.source.distance
        error = relative_l2(image, optics.psf(*asked, **ask).psf[0])
        assert error <= plan.predicted_error <= tolerance
        found.append((index, plan.predicted_error / error))
    assert np.median([ratio for _, ratio in found]) < 10
    return sorted(index for index, _ in found)


APERTURES = [optics.Circle(), optics.Annulus(0.5), optics.Slit(0.4, 1.3), optics.Polygon.regular(6)]


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("aperture", APERTURES, ids=lambda aperture: type(aperture).__name__)
@pytest.mark.parametrize(("dx", "shape", "source"), [(0.25e-6, (65, 65), math.inf), (0.5e-6, (33, 48), 3e-3)])
def test_predicted_errors_of_lenses(aperture, dx, shape, source):
    beams = [beam(pupil, source) for pupil in eyes(6, (15e-6, 60e-6), aperture=aperture)]
    assert checked(beams, Grid(shape, dx), 1e-2) == [*range(6)]


def test_random_reliefs_without_the_power_of_a_lens():
    """Most of the light misses the window. The samples resolve the light that diffracts into it at the rim."""
    beams = [beam(pupil) for pupil in eyes(6, (10e-6, 50e-6), seed=1, power=0.0)]
    assert checked(beams, Grid((33, 33), 0.5e-6), 1e-2) == [*range(6)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tolerance", [3e-2, 3e-3])
def test_all_of_them_differ(seed, tolerance):
    """Pupils with and without power, in front of a window at various distances, in light of several wavelengths."""
    rng = np.random.default_rng(seed)
    beams = []
    for power in (0.0, 1 / (0.5 * Z)):
        for pupil in eyes(10, (5e-6, 55e-6), seed, power, medium_n=1.336, object_n=1.0):
            beams.append(beam(pupil, rng.choice([math.inf, 3e-3]), rng.uniform(1, 2) * Z, rng.uniform(4e-7, 7e-7)))
    assert len(checked(beams, Grid((41, 33), 0.4e-6), tolerance)) >= 12


def zernike(rng, radius=None):
    order = rng.integers(3, 7)
    modes = {(n, m): 0.05 * rng.normal() / (n - 1) for n in range(2, order + 1) for m in range(-n, n + 1, 2)}
    return optics.Zernike(modes, radius)


def smooth_map(rng, reach=None):
    x = np.linspace(-1, 1, 6)
    a, b, c = 0.2 * rng.normal(size=3)
    values = 0.6 + a * x[None, :] + b * x[:, None] + c * x[:, None] * x[None, :]
    return optics.MaskMap(values / max(1.0, 1.1 * np.abs(values).max()), reach)


LENS = {"thin_lens_focal_length": Z}
KINDS = {
    "wavefront": lambda rng, radius: LENS | {"wavefront": zernike(rng)},
    "wavefront of a wider pupil": lambda rng, radius: LENS | {"wavefront": zernike(rng, radius * rng.uniform(1, 2))},
    "map of a wavefront": lambda rng, radius: LENS | {"wavefront": optics.WavefrontMap(5e-8 * rng.random((6, 6)))},
    "map of heights": lambda rng, radius: LENS | {"height": 4e-7 * rng.random((8, 8))},
    "gaussian mask": lambda rng, radius: LENS | {"mask": optics.GaussianMask(radius * rng.uniform(0.5, 2))},
    "map": lambda rng, radius: LENS | {"mask": smooth_map(rng)},
    "map of a wider pupil": lambda rng, radius: LENS | {"mask": smooth_map(rng, radius * rng.uniform(1.1, 1.5))},
    "two media": lambda rng, radius: LENS | {"object_n": 1.0, "medium_n": rng.uniform(1.2, 1.5)},
    "diverging lens": lambda rng, radius: {"thin_lens_focal_length": -2 * Z},
    "all of it": lambda rng, radius: {
        "height": optics.BSplineRelief.paraboloid(0, 1.336 / (0.164 * Z), radius),
        "wavefront": zernike(rng),
        "mask": optics.GaussianMask(radius),
        "object_n": 1.336,
        "medium_n": 1.336,
        "aperture": optics.Annulus(0.4),
    },
}


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize(("tolerance", "radii", "side"), [(1e-2, (10e-6, 24e-6), 49), (1e-3, (5e-6, 10e-6), 33)])
@pytest.mark.parametrize("kind", KINDS)
def test_predicted_errors_of_other_elements(kind, tolerance, radii, side):
    rng, beams = np.random.default_rng(0), []
    for radius in rng.uniform(*radii, 6):
        source = rng.choice([math.inf, rng.uniform(2e-3, 1e-2)])
        beams.append(beam(optics.Pupil(radius, **KINDS[kind](rng, radius)), float(source)))
    # At a small tolerance, the check rejects most maps, whose knots diffract light far away, and some wavefronts.
    assert len(checked(beams, Grid.square(side, 0.25e-6), tolerance)) >= (1 if "heights" in kind else 3)


def test_light_from_one_side_of_a_near_pupil():
    """The mask transmits more on one side, and a prism deflects the light to the same side or to the other."""
    prism, beams = optics.Zernike({(1, 1): 0.375}), []
    for side in (-1, 1):
        mask = optics.MaskMap(np.broadcast_to(0.45 + 0.4 * side * np.linspace(-1, 1, 5), (5, 5)))
        pupil = optics.Pupil(3e-6, thin_lens_focal_length=20e-6, mask=mask, wavefront=prism)
        beams.append(beam(pupil, distance=20e-6))
    assert checked(beams, Grid.square(33, 0.247e-6), 5e-2) == [0, 1]
    assert checked(beams, Grid.square(33, 0.247e-6), 1e-2, "float64") == [0, 1]


@pytest.mark.parametrize(("inner", "waist", "tolerance"), [(0.8, 0.25, 1e-2), (0.6, 0.2, 5e-2), (0.3, 0.25, 1e-2)])
def test_masks_that_are_bright_where_the_aperture_is_shut(inner, waist, tolerance):
    """The soft edge transmits light of the mask's bright middle, which is much more than the light of the opening."""
    mask = optics.GaussianMask(waist * 12e-6)
    pupil = optics.Pupil(12e-6, aperture=optics.Annulus(inner), mask=mask, thin_lens_focal_length=Z)
    ask = {"dx": 0.5e-6, "shape": (33, 33)}
    batch = optics.psf_batch([pupil], [LAMBDA], Z, **ask, tolerance=tolerance)
    exact = optics.psf(pupil, [LAMBDA], Z, **ask, tolerance=1e-6, method="exact", dtype="float64").psf[0]
    assert relative_l2(batch.psf[0, 0, 0], exact) < batch.plan.predicted_error < tolerance


def test_a_failing_check_leads_to_a_second_attempt(monkeypatch):
    """The first samples blur the rim, from which light diffracts into the window. The second samples resolve it."""
    monkeypatch.setattr(window_edges, "RIM_CYCLES", 0.8)
    monkeypatch.setattr(window_edges, "EDGE_CYCLES", 0.2)
    monkeypatch.setattr(window_edges, "EXPONENT", -3.0)
    beams, window = [beam(pupil) for pupil in eyes(4, (20e-6, 40e-6), power=0.0)], Grid.square(33, 0.5e-6)
    first = window_plan.WindowPlan(LightStack(tuple(beams)), window, np.full(4, 1e-2))
    found = {index: plan.samples[0] for index, _, plan in coarse_psfs(beams, window, 1e-2, "float32")}
    assert any(across > 2 * first.counts[index] + 1 for index, across in found.items())
    assert len(checked(beams, window, 1e-2)) >= 3


def test_the_batch_leaves_derivatives_pixels_and_small_tolerances_to_others():
    carried = Float64(20e-6)
    dr.enable_grad(carried)
    pixels = optics.PixelRelief(1e-7 * np.eye(4))
    pupils = [*eyes(3, (15e-6, 40e-6)), optics.Pupil(carried), optics.Pupil(20e-6, pixels)]
    options = {"dx": 0.25e-6, "shape": (33, 33), "tolerance": 1e-2}
    beams, window = [beam(pupil) for pupil in pupils], Grid((33, 33), 0.25e-6)
    assert sorted(index for index, *_ in coarse_psfs(beams, window, 1e-2, "float32")) == [0, 1, 2]
    assert not list(coarse_psfs(beams, window, 1e-4, "float32"))
    batch = optics.psf_batch(pupils, [LAMBDA, 600e-9], Z, [math.inf, 2e-3], **options)
    for eye, depth, wave in ((0, 0, 1), (2, 1, 0), (3, 0, 0), (4, 1, 1)):
        alone = optics.psf(pupils[eye], [(LAMBDA, 600e-9)[wave]], Z, (math.inf, 2e-3)[depth], **options)
        assert relative_l2(batch.psf[eye, depth, wave], alone.psf[0]) < 2e-2


def test_a_batch_is_the_same_as_single_psfs():
    """Both have the same plans, samples and checks. Only the order of sums differs."""
    pupils = list(eyes(5, (12e-6, 55e-6)))
    options = {"dx": 0.25e-6, "shape": (33, 33), "tolerance": 1e-2}
    batch = optics.psf_batch(pupils, [LAMBDA], Z, **options)
    for pupil, image, plan in zip(pupils, batch.psf[:, 0, 0], batch.plans, strict=True):
        alone = optics.psf(pupil, [LAMBDA], Z, **options)
        assert relative_l2(image, alone.psf[0]) < 1e-5
        assert plan.samples == alone.plan.samples
        assert plan.predicted_error == pytest.approx(alone.plan.predicted_error, rel=0.02)
        assert plan.scalar_error == pytest.approx(alone.plan.scalar_error)


def test_bad_input_is_named():
    pupils = list(eyes(1, (15e-6, 40e-6)))
    with pytest.raises(ValueError, match="sensor_distance = -1"):
        optics.psf_batch(pupils, sensor_distance=-1, tolerance=1e-2)
    with pytest.raises(ValueError, match="tolerance = 2"):
        optics.psf_batch(pupils, tolerance=2)
    with pytest.raises(ValueError, match="pupil = 7"):
        optics.psf_batch([7], tolerance=1e-2)
    with pytest.raises(ValueError, match="source_distance = 0"):
        optics.psf_batch(pupils, source_distances=[0], tolerance=1e-2)


def test_constants_of_the_phase_do_not_affect_the_digits():
    lens = {"thin_lens_focal_length": Z}
    low = lens | {"wavefront": optics.Zernike({(3, 1): 0.1})}
    relief = optics.BSplineRelief(np.full((4, 4), 5e-4))
    tall = lens | {"height": relief, "wavefront": optics.Zernike({(3, 1): 0.1, (0, 0): 50.0})}
    pupils = [optics.Pupil(15e-6, **how) for how in (low, tall)]
    batch = optics.psf_batch(pupils, [LAMBDA], Z, shape=(33, 33), tolerance=1e-2)
    assert relative_l2(batch.psf[1], batch.psf[0]) < 1e-5


def test_predicted_times_follow_the_window():
    pupils = [optics.Pupil(5e-6, optics.BSplineRelief(1e-8 * np.eye(4)))] * 2
    ask = {"sensor_distance": 240e-6, "tolerance": 3e-2}
    times = [optics.psf_batch(pupils, **ask, dx=3e-5 / n, shape=(n, n)).plan.seconds for n in (17, 257)]
    assert 2e-4 < times[0] < times[1] < 0.05
