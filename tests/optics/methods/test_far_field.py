"""The far field by a few nodes, against the direct sum; and the number of nodes."""

import math
from functools import cache

import drjit as dr
import numpy as np
import pytest

import optics
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.methods.far_field import _nodes, _slow_part, far_field
from optics.methods.far_field_nodes import all_nodes, few_nodes
from optics.methods.problem import Problem
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from validation.reference import relative_l2

LAMBDA = 430e-9


def problem_of(radius, z, degrees, tolerance, seed=0, dtype="float32", side=61):
    """Return a problem whose glass changes the phase by several waves. Its window extends from the axis to rays at the
    angle `degrees`.
    """
    heights = 0.6 * radius * np.random.default_rng(seed).random((4, 4))
    beam = Beam(optics.Pupil(radius, optics.BSplineRelief(heights)), PointSource(), LAMBDA, z)
    window = Grid.square(side, 2 * z * math.tan(math.radians(degrees)) / side)
    return beam, Problem.from_beam(beam, window, tolerance, dtype)


def exactly(beam, problem):
    ask = {"method": "rayleigh_sommerfeld", "tolerance": 1e-7, "dtype": "float64"}
    window = problem.window
    return optics.psf(beam.pupil, [LAMBDA], beam.distance, dx=window.dx, shape=window.shape, **ask).psf[0]


@cache
def exact(radius, z, degrees):
    return exactly(*problem_of(radius, z, degrees, 1e-7, dtype="float64"))


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize(("radius", "z", "degrees"), [(8e-6, 241e-6, 42), (14e-6, 567e-6, 40), (5e-6, 100e-6, 20)])
def test_a_few_nodes_stand_for_all(radius, z, degrees, tolerance):
    beam, problem = problem_of(radius, z, degrees, tolerance, dtype="float32" if tolerance > 1e-4 else "float64")
    [how] = far_field(problem)
    assert len(how.nodes.kept) < 0.6 * how.nodes.count**2
    image = how.intensity(beam, problem).numpy().reshape(problem.window.shape) / beam.pupil.area
    assert relative_l2(image, exact(radius, z, degrees)) < 0.5 * tolerance


def test_nodes_that_forget_the_rest_s_size_are_wrong():
    """A number of nodes that follows from the phase alone misses the tolerance. The size of the slow factor matters,
    too.
    """
    _, problem = problem_of(5e-6, 100e-6, 40, 1e-3)
    [how] = far_field(problem)
    x, y = 5e-6 * np.random.default_rng(1).uniform(-0.7, 0.7, (2, 60))
    at = how.nodes.half_angle * np.cos(np.pi * (np.arange(how.nodes.count) + 0.5) / how.nodes.count)
    places = (x, y), at[None, :, None], problem.distance * np.tan(at)[:, None, None]
    whole = _slow_part(problem, *places)
    kept = whole[tuple(how.nodes.kept.T)]
    assert np.abs(np.tensordot(how.nodes.mix, kept, (0, 0)) - whole).max() < 10 * problem.ripple
    phase = whole / np.abs(whole)
    wrong = few_nodes(how.nodes.count, how.nodes.half_angle, phase, problem.ripple)
    made = np.tensordot(wrong.mix, whole[tuple(wrong.kept.T)], (0, 0))
    assert np.abs(made - whole).max() > 100 * problem.ripple


def test_all_nodes_interpolate_polynomials_in_angle():
    count, half = 5, 0.7
    angle = np.linspace(-0.6, 0.6, 9)[None, :] * np.ones((9, 1))
    weights = all_nodes(count, half).weights(angle, "float64")
    tangents = np.array(all_nodes(count, half).tangents)
    values = (lambda t: t[..., 0] ** 4 - t[..., 0] * t[..., 1] ** 2)(np.arctan(tangents) / half)
    found = np.tensordot(values, weights, (0, 0)).reshape(2, 9, 9)
    across, down = angle / half, angle.T / half
    np.testing.assert_allclose(found[0], across**4 - across * down**2, atol=1e-13)
    np.testing.assert_allclose(found[1], 0, atol=1e-13)


def test_fewer_nodes_for_looser_tolerances_and_smaller_pupils():
    def kept(radius, tolerance):
        _, problem = problem_of(radius, 567e-6, 40, tolerance)
        return len(_nodes(problem, 12).kept)

    by_tolerance = [kept(12e-6, tolerance) for tolerance in (1e-4, 1e-3, 1e-2, 1e-1)]
    assert by_tolerance == sorted(by_tolerance, reverse=True)
    assert by_tolerance[0] > 1.5 * by_tolerance[-1]
    assert kept(6e-6, 1e-2) < kept(12e-6, 1e-2) < kept(18e-6, 1e-2)


def test_few_nodes_carry_the_derivative_by_the_distance():
    """The nodes are chosen for the slow factor, and are also enough for its derivative."""
    beam, problem = problem_of(14e-6, 567e-6, 40, 1e-3, dtype="float64", side=15)
    [how] = far_field(problem)
    z = precision("float64").Float64(beam.distance)
    dr.enable_grad(z)
    image = how.intensity(Beam(beam.pupil, beam.source, beam.wavelength, z), problem)
    dr.set_grad(z, 1.0)
    dr.forward_to(image)
    step = 1e-4

    def at(k):
        ask = {"method": "rayleigh_sommerfeld", "tolerance": 1e-9, "dtype": "float64"}
        window, distance = problem.window, beam.distance * (1 + k * step)
        return optics.psf(beam.pupil, [LAMBDA], distance, dx=window.dx, shape=window.shape, **ask).psf[0].ravel()

    near, far = (at(k) - at(-k) for k in (1, 2))
    expected = (8 * near - far) / (12 * step * beam.distance) * beam.pupil.area
    assert relative_l2(dr.grad(image).numpy(), expected) < 5e-4


@pytest.mark.filterwarnings("error")
def test_a_window_of_one_sample_is_answered():
    """A window of one sample has no width, although directions are measured in half widths of the window."""
    pupil = optics.Pupil(25e-6)
    seen, exact = (
        optics.psf(pupil, shape=(1, 1), method=method).psf[0, 0, 0] for method in ("far_field", "rayleigh_sommerfeld")
    )
    assert seen == pytest.approx(exact, rel=1e-3)
