"""The rank of the slow rest is what the tolerance needs: it holds at every tolerance, and is no larger than that."""

import numpy as np
import pytest

from optics import BSplineRelief, Grid, PointSource, Pupil, Zernike
from optics.elements.beam import Beam
from optics.methods import low_rank as low_rank_module
from optics.methods.low_rank import low_rank
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import nodes

Z, WINDOW = 240e-6, Grid.square(65, 0.25e-6)


def eyes(count):
    rng = np.random.default_rng(5)
    for radius in rng.uniform(15e-6, 40e-6, count):
        lens = BSplineRelief.paraboloid(0.0, 1 / 120e-6, radius).control_points
        yield Beam(Pupil(radius, BSplineRelief(lens + 1e-6 * rng.random((4, 4)))), PointSource(), 550e-9, Z)


def errors(tolerance, count=8):
    found = []
    for beam in eyes(count):
        problem, exactly = (Problem.of(beam, WINDOW, each, "float64") for each in (tolerance, 1e-8))
        (how,), (reference,) = low_rank(problem), nodes(exactly)
        exact = reference.intensity(beam, exactly).numpy()
        found.append(np.linalg.norm(how.intensity(beam, problem).numpy() - exact) / np.linalg.norm(exact))
    return np.array(found)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3, 1e-5])
def test_sampling_takes_no_more_than_half_the_tolerance(tolerance):
    """That is what a plan promises; rays' amplitudes err by less than the rim's, which the rank was chosen by."""
    assert errors(tolerance).max() < tolerance / 2


def test_a_rank_chosen_for_far_more_error_breaks_the_promise(monkeypatch):
    monkeypatch.setattr(low_rank_module, "RANK_RIPPLE", 20 * low_rank_module.RANK_RIPPLE)
    assert errors(1e-3).max() > 1e-3 / 2


def test_square_windows_share_one_matrix_and_others_do_not():
    """The picture of an oblong window is the middle of a square one's."""
    beam = next(eyes(1))
    square, oblong = (Problem.of(beam, Grid(shape, 0.25e-6), 1e-4, "float64") for shape in ((65, 65), (33, 65)))
    whole, part = (low_rank(problem)[0].intensity(beam, problem).numpy() for problem in (square, oblong))
    middle = whole.reshape(65, 65)[16:49]
    assert np.linalg.norm(part.reshape(33, 65) - middle) < 1e-4 * np.linalg.norm(middle)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_the_matrix_is_limited_in_bytes_and_not_in_samples_across(dtype):
    """A strongly aberrated focus of a thousand zones, rank 7 of 700 samples, took the direct sum and 24 s before."""
    tangent = 0.3 / np.sqrt(1 - 0.3**2)
    radius = 1000 * 550e-9 / tangent
    lens = Pupil(radius, thin_lens_focal_length=radius / tangent, wavefront=Zernike({(6, 2): 0.08, (5, 5): 0.08}))
    beam = Beam(lens, PointSource(), 550e-9, radius / tangent)
    found = low_rank(Problem.of(beam, Grid.square(513, 550e-9 / 0.3 / 8), 1e-3, dtype))
    if dtype == "float64":
        assert found == []
        return
    (how,) = found
    assert how.largest < 1000 < 4096 < how.rank * how.samples[0]
    assert (how.rank * how.samples[0]) ** 2 * 8 <= low_rank_module.MOST_BYTES
