"""Samples for random reliefs with and without a lens, against the direct sum over the hard aperture."""

import numpy as np
import pytest

import optics
from optics import Grid, PointSource
from optics.apertures.curved_disk import curved_ring
from optics.elements.beam import Beam
from optics.elements.light_stack import LightStack
from optics.methods import sine_stack
from optics.methods.problem import Problem
from optics.methods.window_images import window_image_errors, window_images
from optics.methods.window_plan import WindowPlan
from optics.methods.window_sampling import window_sampling
from validation.reference import relative_l2

Z, LAMBDA = 240e-6, 550e-9
WINDOW = Grid((33, 33), 0.5e-6)


def random_reliefs(count, power, seed, radii=(10e-6, 60e-6), **options):
    """Pupils with random 4 x 4 control points of up to 3 µm, to which the heights of a lens are added."""
    rng = np.random.default_rng(seed)
    for radius in rng.uniform(*radii, count):
        points = rng.random((4, 4)) * rng.uniform(0, 3e-6)
        lens = optics.BSplineRelief.paraboloid(0, power, radius).control_points
        yield optics.Pupil(radius, optics.BSplineRelief(points + lens), **options)


def plan_of(pupils, tolerance=1e-2, smoothed=True):
    beams = tuple(Beam(pupil, PointSource(), LAMBDA, Z) for pupil in pupils)
    return WindowPlan(LightStack(beams), WINDOW, np.full(len(beams), tolerance), smoothed=smoothed)


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("tolerance", [3e-2, 1e-2, 3e-3])
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("power", [0.0, 1 / (0.5 * Z), -1 / (0.5 * Z)])
def test_errors_against_the_direct_sum(power, seed, tolerance):
    """The predicted errors are valid. The actual ones are at most half the tolerance."""
    pupils, ask = list(random_reliefs(4, power, seed)), {"dx": WINDOW.dx, "shape": WINDOW.shape}
    batch = optics.psf_batch(pupils, [LAMBDA], Z, **ask, tolerance=tolerance)
    for pupil, image, plan in zip(pupils, batch.psf[:, 0, 0], batch.plans, strict=True):
        exact = optics.psf(pupil, [LAMBDA], Z, **ask, tolerance=1e-4, method="rayleigh_sommerfeld").psf[0]
        assert relative_l2(image, exact) < min(plan.predicted_error, tolerance / 2)
        assert plan.predicted_error <= tolerance
        assert plan.method == "low_rank"


def test_a_smoothed_wave_needs_far_fewer_samples():
    """Most light of wide pupils without a lens misses the window. Lenses that focus have no curvature to smooth."""
    wide = list(random_reliefs(6, 0.0, 2, (40e-6, 60e-6)))
    plan, flat = plan_of(wide), plan_of(wide, smoothed=False)
    assert (np.abs(plan.edges.curvature) > 10).all()
    assert (plan.counts < 0.5 * flat.counts).all()
    assert not flat.edges.curvature.any()
    assert not plan_of(list(random_reliefs(6, 1 / (0.5 * Z), 3))).edges.curvature.any()


def test_only_disks_and_rings_are_smoothed():
    for aperture, smoothed in ((optics.Annulus(0.3), True), (optics.Polygon.regular(6), False)):
        [pupil] = random_reliefs(1, 0.0, 4, (50e-6, 60e-6), aperture=aperture)
        assert bool(plan_of([pupil]).edges.curvature[0]) == smoothed


@pytest.mark.parametrize("wrong", [0.0, -1.0], ids=["not smoothed", "wrong sign"])
def test_the_check_rejects_an_unsuitable_wave(monkeypatch, wrong):
    """Few samples with the plain soft edge alias light into the window. A wrong wave loses light."""
    pupils = list(random_reliefs(3, 0.0, 5, (40e-6, 60e-6)))

    def errors():
        plan = plan_of(pupils)
        for place in range(3):
            samples, finer = plan.samples(np.array([place]))
            own = plan.stack.part([place])
            image = window_images(own, samples, 3, False, WINDOW, "float32")
            yield window_image_errors(own, finer, image, WINDOW, 1e-2)[0]

    right = list(errors())
    sine_stack._profile.cache_clear()
    monkeypatch.setattr(
        sine_stack, "curved_ring", lambda edge, inner, curvature, n: curved_ring(edge, inner, wrong * curvature, n)
    )
    found = list(errors())
    sine_stack._profile.cache_clear()
    assert max(right) < 1e-2 < min(found)


def test_a_wrapped_lens_as_a_map_has_enough_samples_at_each_tolerance():
    """The jumps between samples of the map diffract light far from its rays, and the edge sends it anywhere."""
    x = (np.arange(128) + 0.5) / 64 - 1
    wrapped = (-(60e-6**2) * (x**2 + x[:, None] ** 2) / 480e-6) % 1.1e-6
    found = [
        optics.psf(optics.Pupil(60e-6, wrapped), sensor_distance=480e-6, shape=(65, 65), tolerance=tolerance)
        for tolerance in (1e-2, 3e-3, 1e-3)
    ]
    errors = [result.plan.predicted_error for result in found]
    assert relative_l2(found[0].psf, found[2].psf) <= errors[0] + errors[2]
    assert relative_l2(found[1].psf, found[2].psf) <= errors[1] + errors[2]
    assert {result.plan.method for result in found} == {"low_rank"}


def test_the_check_finds_a_ripple_of_narrow_edges():
    """The window lies in the shadow of a ring, so that both edges determine its light. Maps have narrow edges."""
    heights = optics.HeightMap(1.3e-8 * np.random.default_rng(0).random((10, 10)))
    pupil, z = optics.Pupil(75e-6, heights, aperture=optics.Annulus(0.56)), 520e-6
    view = {"dx": 41e-9, "shape": (43, 45)}
    exact = optics.psf(pupil, [LAMBDA], z, **view, tolerance=1e-5, method="rayleigh_sommerfeld").psf[0]
    found = optics.psf(pupil, [LAMBDA], z, **view, tolerance=2.25e-3, method="low_rank")
    assert relative_l2(found.psf[0], exact) <= found.plan.predicted_error


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("tolerance", [1e-2, 3e-2, 3e-3])
@pytest.mark.parametrize("order", [9, 6])
def test_the_first_plan_suffices_for_polynomials_of_high_order(order, tolerance):
    """Some of their rays are far steeper at the rim than the median. A former plan for the median was not accurate."""
    rng, count = np.random.default_rng(1), (order + 1) * (order + 2) // 2
    window, focus = Grid((65, 65), 1.4e-6), 10e-3
    for _ in range(2):
        modes = 0.1 * rng.standard_normal(count) / np.sqrt(np.arange(1, count + 1))
        pupil = optics.Pupil(1e-3, wavefront=optics.Zernike(modes), thin_lens_focal_length=focus)
        beam = Beam(pupil, PointSource(), LAMBDA, focus)
        problem = Problem.from_beam(beam, window, tolerance)
        sampling = window_sampling(problem)
        image = sampling.plain_intensity(beam, problem) / pupil.area
        exact = optics.psf(pupil, [LAMBDA], focus, dx=window.dx, shape=window.shape, tolerance=1e-4).psf
        assert relative_l2(image, exact.ravel()) < sampling.error(beam, problem, image) < tolerance


def test_slopes_at_the_rim_include_oblique_light():
    """The slopes of an oblique source and of the path to its image cancel, so the density is that on the axis."""
    wavefront, angle = optics.Zernike({(5, 1): 0.2}), (0.02, -0.01)
    pupil = optics.Pupil(1e-3, wavefront=wavefront, thin_lens_focal_length=10e-3)

    def edges(at, centre):
        stack = LightStack((Beam(pupil, PointSource(angle=at), LAMBDA, 10e-3),))
        return WindowPlan(stack, Grid((33, 33), 1.4e-6, centre), np.array([1e-2])).edges

    straight, oblique = edges((0.0, 0.0), (0.0, 0.0)), edges(angle, tuple(10e-3 * np.tan(angle)))
    assert oblique.density == pytest.approx(straight.density, rel=0.05)
    assert LightStack((Beam(optics.Pupil(1e-3), PointSource(), LAMBDA, 1e-2),)).rim_slopes is None
