"""PSFs of a population with a common plan, against the exact integral. Members for which the plan is unsuitable are
computed separately.
"""

import math

import numpy as np
import pytest

import optics
from optics import Grid
from optics.apertures.aperture import EDGE_REACH
from optics.methods.problem import SLOPE_MARGIN
from optics.numerics.interpolation import cubic_bsplines
from optics.point_spread import population
from optics.point_spread.population import (
    _sine,
    _splines_and_slopes,
    _spread,
    _Stack,
    _turns,
    population_pictures,
)
from optics.point_spread.population_members import HIGHEST_ORDER, Member, powers
from tests.optics.device_types import Float64
from validation.reference import relative_l2

Z, LAMBDA = 240e-6, 550e-9


def eyes(count, seed=0, **options):
    """Return pupils with radii of 15 to 40 µm, whose reliefs are close to a lens."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        radius = rng.uniform(15e-6, 40e-6)
        lens = optics.BSplineRelief.paraboloid(0, 1 / (0.5 * Z), radius).control_points
        yield optics.Pupil(radius, optics.BSplineRelief(lens + rng.random((4, 4)) * rng.uniform(0, 3e-6)), **options)


def members(pupils, source=math.inf):
    return [Member(pupil, LAMBDA, Z, source) for pupil in pupils]


APERTURES = [optics.Circle(), optics.Annulus(0.5), optics.Slit(0.4, 1.3), optics.Polygon.regular(6)]


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("aperture", APERTURES, ids=lambda aperture: type(aperture).__name__)
@pytest.mark.parametrize(("dx", "shape", "source"), [(0.25e-6, (65, 65), math.inf), (0.5e-6, (33, 48), 3e-3)])
def test_predicted_errors_hold_and_are_not_cowardly(aperture, dx, shape, source):
    pupils, window = list(eyes(6, aperture=aperture)), Grid(shape, dx)
    found = list(population_pictures(members(pupils, source), window, 1e-2))
    assert len(found) >= 4
    for index, image, plan in found:
        exact = optics.psf(pupils[index], [LAMBDA], Z, source, dx=dx, shape=shape, tolerance=1e-5).psf[0]
        error = relative_l2(image, exact)
        assert error <= plan.predicted_error <= 1e-2
        assert plan.predicted_error < 30 * error


def test_in_a_medium_behind_any_lens():
    lens = optics.Pupil(30e-6, medium_n=1.336, thin_lens_focal_length=Z)
    diverging = optics.Pupil(30e-6, thin_lens_focal_length=-2 * Z)
    window = Grid((33, 33), 0.4e-6)
    for pupil in (lens, diverging, optics.Pupil(12e-6)):
        [(_, image, plan)] = population_pictures(members([pupil]), window, 2e-2)
        exact = optics.psf(pupil, [LAMBDA], Z, dx=0.4e-6, shape=(33, 33), tolerance=1e-5).psf[0]
        assert relative_l2(image, exact) <= plan.predicted_error


def test_the_batch_takes_it_and_leaves_it_the_rest():
    """Three members of one batch are computed separately: a height map, a wide pupil whose remaining phase is too
    large, and a pupil with a derivative.
    """
    wide = optics.Pupil(200e-6, thin_lens_focal_length=Z)
    pupils = [*eyes(3), optics.Pupil(20e-6, np.zeros((5, 5))), wide, optics.Pupil(Float64(20e-6))]
    options = {"dx": 0.25e-6, "shape": (33, 33), "tolerance": 1e-2}
    batch = optics.psf_batch(pupils, [LAMBDA, 600e-9], Z, [math.inf, 2e-3], **options)
    together = ["population" in plan.why for plan in batch.plans]
    assert together == [True] * 12 + [False] * 12
    for place in ((0, 0, 1), (2, 1, 0), (3, 0, 0), (4, 1, 1), (5, 0, 0)):
        eye, depth, wave = place
        alone = optics.psf(pupils[eye], [(LAMBDA, 600e-9)[wave]], Z, (math.inf, 2e-3)[depth], **options)
        assert relative_l2(batch.psf[place], alone.psf[0]) < 1e-2
    exactly = optics.psf_batch(list(eyes(1)), [LAMBDA], Z, dx=0.25e-6, shape=(33, 33), tolerance=1e-4)
    assert "population" not in exactly.plan.why


def test_one_kernel_scale_for_all_rays_would_be_worse():
    """The remaining phase is three times smaller with ξ/c(ξ) than with ξ over the distance."""
    stack, window = _Stack.from_members(members(eyes(4))), Grid((65, 65), 0.25e-6)
    ours = _spread(stack, window)[:, -1]
    xi = stack.radius[:, 0, 0] * 0.7
    plain, bent = xi / stack.distance[:, 0, 0], _sine(stack, window, xi[:, None, None])[:, 0, 0]
    assert (bent < plain).all()
    worse = 2 * np.pi * (plain - bent) * window.half_diagonal / LAMBDA
    assert (worse > ours).all()


@pytest.mark.parametrize(
    ("suitable", "unsuitable", "dx"),
    [((0.04, 1.0), (0.05, 1.0), 0.3e-6), ((2e-6, 18e-6), (2e-6, 17e-6), 0.15e-6)],
    ids=["too many waves for float32", "near field"],
)
def test_each_limit_alone_excludes_a_pupil(suitable, unsuitable, dx):
    """The path over the pupil changes by R²/(zλ) = 2,900 or 4,500 waves, and kz is 206 or 194. The limits are 3,000 and
    200.
    """
    lenses = [
        Member(optics.Pupil(radius, thin_lens_focal_length=z), LAMBDA, z, math.inf)
        for radius, z in (suitable, unsuitable)
    ]
    found = population_pictures(lenses, Grid.square(17, dx), 5e-2)
    assert [index for index, *_ in found] == [0]


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="sensor_distance = -1"):
        optics.psf_batch(list(eyes(1)), sensor_distance=-1, tolerance=1e-2)
    with pytest.raises(ValueError, match="tolerance = 2"):
        optics.psf_batch(list(eyes(1)), tolerance=2)
    with pytest.raises(ValueError, match="pupil = 7"):
        optics.psf_batch([7], tolerance=1e-2)
    with pytest.raises(ValueError, match="source_distance = 0"):
        optics.psf_batch(list(eyes(1)), source_distances=[0], tolerance=1e-2)


def test_the_time_of_a_common_plan_follows_the_window():
    """An earlier version predicted 3e-4 s for every window, although 257 x 257 samples take 17 ms."""
    pupils = [optics.Pupil(5e-6, optics.BSplineRelief(1e-8 * np.eye(4)))] * 2
    ask = {"sensor_distance": 240e-6, "tolerance": 3e-2}
    times = [optics.psf_batch(pupils, **ask, dx=3e-5 / n, shape=(n, n)).plan for n in (17, 257)]
    assert all("population" in plan.why for plan in times)
    assert times[1].seconds > 30 * times[0].seconds > 3e-3
    assert times[1].seconds < 0.05


@pytest.mark.parametrize("source", [math.inf, 4e-4])
@pytest.mark.parametrize(
    "pupil",
    [
        optics.Pupil(20e-6, thin_lens_focal_length=200e-6, object_n=1.2),
        optics.Pupil(20e-6, thin_lens_focal_length=-300e-6),
        optics.Pupil(20e-6, optics.BSplineRelief(2e-6 * np.random.default_rng(3).random((4, 4)))),
        optics.Pupil(20e-6, thin_lens_focal_length=Z, wavefront=optics.Zernike({(3, 1): 0.2, (2, 0): 0.3})),
    ],
    ids=["lens", "diverging lens", "relief", "wavefront"],
)
def test_cycles_per_radius_are_differences_of_the_phase(pupil, source):
    """The phase consists of those of relief, wavefront and lens, and of the paths from the source and to the sensor."""
    member, window = Member(pupil, LAMBDA, Z, source), Grid.square(33, 0.5e-6)
    radius, wavelength, z, source, focal, before, _ = member.numbers

    def splines(t):
        return np.stack(cubic_bsplines((t + 1) / 2), axis=-1)

    def waves(x, y, to_sensor):
        r = radius * np.hypot(x, y)
        found = (
            np.einsum("yxi,ij,yxj->yx", splines(y), member.relief, splines(x))
            - np.sign(focal) * (np.hypot(r, focal) - abs(focal) if math.isfinite(focal) else 0) / wavelength
        )
        if math.isfinite(source):
            found += before * (np.hypot(r, source) - source) / wavelength
        zernike = np.tensordot(member.powers, powers(x, y, HIGHEST_ORDER), 1)
        return found + zernike + to_sensor * (np.hypot(r, z) - z) / wavelength

    n, step = (9, 1e-5) if member.order < 2 else (4 * member.order + 1, 1e-5)
    x, y = np.meshgrid(*[np.linspace(-1, 1, n) * (1 + EDGE_REACH)] * 2)

    def steepest(to_sensor, inside):
        along_x = (waves(x + step, y, to_sensor) - waves(x - step, y, to_sensor)) / (2 * step)
        along_y = (waves(x, y + step, to_sensor) - waves(x, y - step, to_sensor)) / (2 * step)
        return SLOPE_MARGIN * np.hypot(along_x, along_y)[inside].max()

    inside = np.hypot(x, y) <= 1 + EDGE_REACH
    everywhere = inside if member.order else np.ones_like(inside)  # a wavefront is not evaluated beyond the edge
    [turns], [sine] = _turns(_Stack.from_members([member]), window)
    tilt = radius * window.half_diagonal / (wavelength * z)
    assert turns == pytest.approx(steepest(1, everywhere) + tilt + member.detail, rel=1e-3)
    assert sine == pytest.approx((steepest(0, inside) + member.detail + 1) * wavelength / radius, rel=1e-3)


def test_slopes_of_splines_are_their_differences():
    x, step = np.linspace(-1.1, 1.1, 23), 1e-6
    values, slopes = _splines_and_slopes((x + 1) / 2)
    np.testing.assert_allclose(values, cubic_bsplines((x + 1) / 2))
    for k, slope in enumerate(slopes):
        ahead, behind = (cubic_bsplines((x + sign * step + 1) / 2)[k] for sign in (1, -1))
        np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), atol=1e-8)


@pytest.mark.parametrize("psfs", [1, 2, 5])
def test_a_stack_is_no_larger_than_memory_allows(monkeypatch, psfs):
    """Neither the samples of the pupils in a stack nor those of their windows exceed the limit."""
    window, sizes, images = Grid.square(49, 0.5e-6), [], population._images

    def counted(stack, samples, masks, window):
        sizes.append((len(stack.members), samples.at.size**2))
        return images(stack, samples, masks, window)

    monkeypatch.setattr(population, "_images", counted)
    pupils = members([next(eyes(1))] * 5)
    whole = [image for _, image, _ in population_pictures(pupils, window, 1e-2)]
    [(number, samples)] = sizes
    assert number == 5
    sizes.clear()
    monkeypatch.setattr(population, "STACK", psfs * max(samples, 49 * 49) + 1)
    found = [image for _, image, _ in population_pictures(pupils, window, 1e-2)]
    assert [number for number, _ in sizes] == {1: [1] * 5, 2: [2, 2, 1], 5: [5]}[psfs]
    np.testing.assert_allclose(found, whole, rtol=1e-5, atol=1e-6 * np.max(whole))
    monkeypatch.setattr(population, "STACK", samples - 1)
    assert list(population_pictures(pupils, window, 1e-2)) == []
