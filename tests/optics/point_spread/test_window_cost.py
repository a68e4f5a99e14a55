"""Windows that need too much memory or time are refused at once, and the cost of all others is predicted."""

import dataclasses
import math
import time

import numpy as np
import pytest

import optics
from optics import AccuracyError, BSplineRelief, Grid, PointSource, Pupil
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.accuracy import MOST_BYTES
from optics.point_spread.planner import choose
from optics.point_spread.window_cost import window_bytes, window_seconds

SYMMETRIC = Pupil(30e-6, thin_lens_focal_length=240e-6)
BENT = Pupil(30e-6, BSplineRelief(1e-7 * np.eye(4)), thin_lens_focal_length=240e-6)
HUGE = [(20_000, 20_000), (100_000, 100_000), (10**9, 10**9), (1, 10**9), (10**9, 3)]


def draw_huge(rng):
    """Return a random shape of 10^8 to 10^18 samples."""
    samples, height = 10 ** rng.uniform(8, 18), 10 ** rng.uniform(0, 9)
    return int(height), math.ceil(samples / height)


@pytest.mark.parametrize("ask", [optics.psf, optics.plan, optics.vector_focus, optics.white_psf])
@pytest.mark.parametrize("pupil", [SYMMETRIC, BENT])
def test_huge_windows_are_refused_at_once(ask, pupil):
    rng = np.random.default_rng(0)
    for shape in [*HUGE, *(draw_huge(rng) for _ in range(10))]:
        start = time.process_time()
        with pytest.raises(
            AccuracyError, match=r"needs .* [GM]B and about .* s.*; the limits are 4 GB and 60 s: .*at most \d+ samples"
        ):
            ask(pupil, dx=1e-10, shape=shape)
        assert time.process_time() - start < 2  # most of it is the first use of a pupil


def test_many_windows_at_once_are_refused():
    """Each of these PSFs is possible alone."""
    several = r"PSFs of shape = \(\d+, \d+\) needs .* GB .*: compute fewer PSFs at once, or use at most \d+ samples"
    with pytest.raises(AccuracyError, match=several):
        optics.psf_batch([BENT] * 100, dx=1e-8, shape=(4096, 4096), sensor_distance=240e-6)
    with pytest.raises(AccuracyError, match=several):
        optics.psf(BENT, np.linspace(4e-7, 7e-7, 100), dx=1e-8, shape=(4096, 4096))


@pytest.mark.parametrize("pupil", [SYMMETRIC, BENT])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_the_plan_includes_the_window(pupil, dtype):
    """A symmetric PSF of 4096 x 4096 samples took 4.7 s in an earlier version, while its plan predicted 0.001 s."""
    times = {n: optics.plan(pupil, dx=1e-5 / n, shape=(n, n), dtype=dtype).seconds for n in (64, 1024, 4096)}
    assert 1 < times[4096] < 10
    assert times[4096] > 10 * times[1024] > 50 * times[64]


def test_no_finished_window_is_refused_for_its_size_alone():
    """The largest windows that pass the check fit into memory with their cheapest method."""
    plan = optics.plan(SYMMETRIC, dx=1e-9, shape=(6000, 6000))
    assert plan.seconds < 60
    with pytest.raises(AccuracyError, match="the limits are"):
        optics.plan(SYMMETRIC, dx=1e-9, shape=(7000, 7000))


def test_an_unchecked_window_costs_less():
    """The kernel of an eye is not compared with the direct sum."""
    problem = Problem.from_beam(Beam(BENT, PointSource(), 550e-9, 240e-6), Grid.square(2048, 1e-7), 1e-2)
    eyes = dataclasses.replace(problem, reach=1e-4)
    assert window_seconds(eyes) < 0.4 * window_seconds(problem)
    assert window_bytes(eyes, None) < 0.4 * window_bytes(problem, None)


def test_refusals_name_the_memory():
    """A pupil of 3 mm close to its sensor needs tens of gigabytes."""
    beam = Beam(Pupil(3e-3, BSplineRelief(1e-5 * np.eye(4))), PointSource(), 550e-9, 2e-3)
    problem = Problem.from_beam(beam, Grid.square(1001, 4e-6), 1e-2)
    with pytest.raises(AccuracyError, match=r"needs \d+ samples across, \d+ GB and .*; the limits are 4 GB and 60 s"):
        choose(problem)
    assert MOST_BYTES == 4e9


def test_refusals_of_hankel_transforms_count_radii_and_angles():
    """The message states the numbers of nodes of two integrals, and not samples across a grid."""
    with pytest.raises(AccuracyError, match=r"needs integrals over \S+ radii and \S+ angles, .* by hankel"):
        optics.psf(Pupil(30e-6), [1e-12])
