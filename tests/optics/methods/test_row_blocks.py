"""Large pupils and rules are summed in blocks, with the same result as at once."""

import numpy as np
import pytest

import optics
from optics import BSplineRelief, Grid, PointSource, Pupil
from optics.elements.beam import Beam
from optics.methods import rayleigh_sommerfeld, row_blocks
from optics.methods.problem import Problem
from optics.point_spread.planner import choose
from validation.reference import relative_l2

BENT = BSplineRelief(np.arange(16.0).reshape(4, 4) * 1e-7)


def problem_of(pupil, window, distance=240e-6, **more):
    beam = Beam(pupil, PointSource(), 550e-9, distance)
    return beam, Problem.from_beam(beam, window, more.pop("tolerance", 1e-3), **more)


def intensity(sampling, beam, problem):
    return sampling.intensity(beam, problem).numpy()


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("height", [None, BENT])  # without a relief, a quarter of each plane is stored
@pytest.mark.parametrize("method", ["angular_spectrum", "split_angular_spectrum"])
def test_blocks_of_rows_add_up_to_the_whole_pupil(method, height, dtype, monkeypatch):
    rng = np.random.default_rng(abs(hash((method, dtype))) % 2**32)
    pupil = Pupil(30e-6, height, aperture=optics.Slit(0.9, 1.3), thin_lens_focal_length=250e-6)
    middle = (0.0, 0.0) if height is None else (3e-6, -5e-6)
    beam, problem = problem_of(pupil, Grid((21, 32), 1.1e-6, middle), dtype=dtype)
    assert problem.even == (height is None)
    sampling = choose(problem, method)[1]
    at_once = intensity(sampling, beam, problem)
    for share in rng.uniform(0.05, 0.9, 3):
        stored = sampling.part(sampling.pupil)
        monkeypatch.setattr(row_blocks, "AT_ONCE", int(share * np.prod(stored.shape)))
        blocks = list(row_blocks.row_blocks(stored))
        assert len(blocks) > 1
        assert sum(block.shape[0] for _, block in blocks) == stored.shape[0]
        assert np.allclose(np.concatenate([block.y for _, block in blocks]), stored.y, atol=1e-15)
        assert relative_l2(intensity(sampling, beam, problem), at_once) < {"float32": 1e-5, "float64": 1e-12}[dtype]


@pytest.mark.parametrize("pupil", [Pupil(30e-6), Pupil(30e-6, BENT, mask=optics.GaussianMask(20e-6))])
def test_blocks_of_nodes_add_up_to_the_whole_rule(pupil, monkeypatch):
    beam, problem = problem_of(pupil, Grid((5, 7), 2e-6))
    sampling = choose(problem, "rayleigh_sommerfeld")[1]
    at_once = intensity(sampling, beam, problem)
    monkeypatch.setattr(rayleigh_sommerfeld, "AT_ONCE", sampling.count // 7)
    assert relative_l2(intensity(sampling, beam, problem), at_once) < 1e-6


def test_memory_does_not_grow_with_the_rows_of_a_pupil(monkeypatch):
    """Twice the radius needs four times the samples, but only the arrays of a block and of the spectrum are stored."""
    _, problem = problem_of(Pupil(30e-6, BENT, thin_lens_focal_length=240e-6), Grid.square(9, 1e-6))
    whole = choose(problem, "split_angular_spectrum")[1]
    monkeypatch.setattr(row_blocks, "AT_ONCE", int(np.prod(whole.pupil.shape)) // 16)
    parts = min(optics.methods.angular_spectrum.split_spectrum(problem), key=lambda each: each.seconds)
    assert parts.bytes < whole.bytes


def test_pupils_far_beyond_the_limits_are_planned_at_once():
    """X-rays of 1 pm need 10^14 samples. Their blocks are counted without a list of all blocks."""
    assert row_blocks.block_size(Grid((10**9, 10**9), 1e-12))[0] > 10**7
    with pytest.raises(optics.AccuracyError, match=r"needs integrals over .* GB and about .* s by hankel"):
        optics.plan(Pupil(30e-6, thin_lens_focal_length=240e-6), 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("distance", [10e-3, 12e-3])
def test_a_pupil_of_more_than_4096_samples_across(distance):
    """An earlier version refused it because of its number of samples, although it takes a few seconds and a few hundred
    megabytes.
    """
    pupil = Pupil(1.5e-3, BSplineRelief(np.arange(16.0).reshape(4, 4) * 1e-8), thin_lens_focal_length=distance)
    ask = {"sensor_distance": 1.01 * distance, "dx": 1e-6, "shape": (65, 65)}
    plan = optics.plan(pupil, **ask, method="split_angular_spectrum")
    assert plan.samples[0] > 4096
    found = optics.psf(pupil, **ask, method="split_angular_spectrum")
    assert found.plan.predicted_error < 1e-3
    some = {**ask, "shape": (1, 65)}
    exact = optics.psf(pupil, **some, method="rayleigh_sommerfeld", tolerance=1e-5, dtype="float64")
    assert relative_l2(found.psf[0, 32:33], exact.psf[0]) < 1e-3
