"""Plans: the cheapest sufficient method is named with its reasons, and impossible requests get a message."""

import dataclasses
import math

import numpy as np
import pytest

from optics import AccuracyError, BSplineRelief, Grid, PointSource, Pupil
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.point_spread.planner import APPROXIMATE, EXACT, METHODS, WEIGHING, choose


def problem_of(pupil, distance, window, tolerance, **more):
    return Problem.from_beam(Beam(pupil, PointSource(), 550e-9, distance), window, tolerance, **more)


# A prism with a negligible slope: not symmetric, so that all methods compete.
BENT = BSplineRelief(1e-9 * np.eye(4))
LENS_PUPIL = Pupil(30e-6, BENT, thin_lens_focal_length=240e-6)
LENS = problem_of(LENS_PUPIL, 240e-6, Grid.square(65, 0.5e-6), 2e-4)
PINHOLE = problem_of(Pupil(1e-6, BENT), 5e-3, Grid.square(65, 1e-4), 1e-3)
WIDE = problem_of(Pupil(90e-6, BSplineRelief(15e-6 * np.eye(4))), 100e-6, Grid.square(201, 1e-6), 1e-2)


@pytest.mark.parametrize("problem", [LENS, PINHOLE, WIDE])
def test_auto_takes_the_cheapest(problem):
    plan, _ = choose(problem)
    for method in METHODS:
        try:
            other, sampling = choose(problem, method)
        except AccuracyError:
            continue
        assert other.method == method
        assert plan.seconds <= other.seconds or sampling.model_error > problem.tolerance / 3


def test_method_follows_the_problem():
    symmetric = problem_of(Pupil(30e-6, thin_lens_focal_length=240e-6), 240e-6, Grid.square(65, 0.5e-6), 2e-4)
    assert choose(symmetric)[0].method in ("hankel", "rayleigh_sommerfeld")
    # Near a focus pupil and path turn through few cycles together: a few nodes are enough, but not for many outputs.
    coarsely = problem_of(LENS_PUPIL, 240e-6, Grid.square(33, 1e-6), 2e-4)
    assert choose(coarsely)[0].method == "rayleigh_sommerfeld"
    finely = problem_of(LENS_PUPIL, 240e-6, Grid.square(801, 0.04e-6), 2e-4)
    assert choose(finely)[0].method in ("low_rank", "split_angular_spectrum")
    assert choose(PINHOLE, "exact")[0].method in ("far_field", "rayleigh_sommerfeld", "low_rank")
    assert choose(PINHOLE)[0].method in ("fresnel", "rayleigh_sommerfeld")
    assert choose(WIDE)[0].method == "angular_spectrum"


@pytest.mark.parametrize("problem", [LENS, PINHOLE, WIDE])
def test_auto_takes_no_approximation_that_errs_by_more_than_the_tolerance(problem):
    for tolerance in (1e-1, 1e-2, 1e-3, 1e-4):
        plan, sampling = choose(dataclasses.replace(problem, tolerance=tolerance))
        assert sampling.model_error < tolerance / 2
        assert plan.predicted_error <= tolerance
        assert choose(dataclasses.replace(problem, tolerance=tolerance), "exact")[0].method in EXACT


def test_a_method_is_not_asked_where_that_costs_more_than_it_can_save():
    """A method is not examined if it is slower than the chosen one, or if it would save less time than its examination
    takes. For a problem that takes long, all methods are examined.
    """
    small = problem_of(LENS_PUPIL, 240e-6, Grid.square(33, 1e-6), 1e-2)
    plan, _ = choose(small)
    asked = {option.method for option in plan.options}
    left_out = {name for name in METHODS if name not in asked and name not in ("hankel", "pinhole")}
    assert "far_field" in left_out
    for name in left_out:
        other, sampling = choose(small, name)
        assert other.seconds + WEIGHING[name].asking > plan.seconds or sampling.model_error > small.tolerance / 2
    finely = problem_of(LENS_PUPIL, 240e-6, Grid.square(801, 0.04e-6), 2e-4)
    asked = {option.method for option in choose(finely)[0].options}
    assert asked >= {"low_rank", "angular_spectrum", "split_angular_spectrum", "rayleigh_sommerfeld", "fresnel"}


@pytest.mark.parametrize("method", APPROXIMATE)
def test_an_approximation_by_name_says_how_wrong_it_is(method):
    plan, sampling = choose(LENS, method)
    assert plan.method == method
    assert plan.predicted_error > sampling.model_error > LENS.tolerance


@pytest.mark.parametrize("method", ["angular_spectrum", "split_angular_spectrum"])
def test_more_digits_cost_more_samples(method):
    samples = [
        choose(dataclasses.replace(LENS, tolerance=tolerance, dtype="float64"), method)[0].samples[0]
        for tolerance in (1e-2, 1e-5, 1e-9)
    ]
    assert samples == sorted(samples)
    assert samples[0] < samples[-1] < 3 * samples[0]  # digits are cheap: convergence is spectral


def test_sampling_resolves_the_lens():
    """Sampling the phase of an ideal lens requires dx < λ / (2 NA)."""
    _, sampling = choose(LENS, "angular_spectrum")
    assert sampling.pupil.dx < 550e-9 / (2 * 0.124)


def test_plan_prints_as_a_table():
    text = str(choose(LENS)[0])
    for name in ("method", "samples", "dtype", "predicted error", "predicted time", "why", "Fresnel number 6.82"):
        assert name in text


def test_refusals_say_what_it_would_take():
    far_too_large = dataclasses.replace(WIDE, radius=3e-3, distance=2e-3, window=Grid.square(1001, 4e-6))
    with pytest.raises(AccuracyError, match=r"needs \d+ samples across, \d+ GB and about .* the limits are"):
        choose(far_too_large)
    with pytest.raises(AccuracyError, match="dtype='float64' allows"):
        choose(dataclasses.replace(LENS, tolerance=1e-8))
    with pytest.raises(AccuracyError, match="grazing"):
        choose(dataclasses.replace(LENS, distance=1e-7), "angular_spectrum")
    assert math.isfinite(choose(LENS)[0].predicted_error)
