"""Pupils of pixels at coarse tolerances: few nodes in each pixel, and errors that the check predicts."""

import numpy as np
import pytest
import torch

import optics
import optics.torch
from optics import Grid, PixelRelief, Pupil, Zernike
from optics.elements.beam import Beam
from optics.methods import pixel_nodes
from optics.methods.problem import Problem
from optics.methods.window_rank import DERIVATIVE_ERROR
from optics.methods.window_sampling import WindowSampling, window_sampling
from validation.reference import relative_l2

R, FOCUS, WAVE = 100e-6, 1e-3, 550e-9
RNG = np.random.default_rng(5)
ROUGH = 1e-6 * RNG.random((24, 24))
TRIANGLE = optics.Polygon([(-0.8, -0.5), (0.9, 0.1), (-0.3, 0.9)])
# Window's distance, its centre, and further parts of the pupil.
SCENES = {
    "focus": (FOCUS, (0.0, 0.0), {}),
    "off the axis": (FOCUS, (20e-6, -10e-6), {}),
    "out of focus": (1.1 * FOCUS, (0.0, 0.0), {"wavefront": Zernike({(3, 1): 0.1})}),
    "triangle": (FOCUS, (0.0, 0.0), {"aperture": TRIANGLE, "mask": optics.GaussianMask(80e-6)}),
    "ring": (FOCUS, (0.0, 0.0), {"aperture": optics.Annulus(0.4), "n": 1.7}),
}


def problem_of(name, tolerance, relief=ROUGH, shape=(23, 20)):
    distance, centre, parts = SCENES[name]
    pupil = Pupil(R, PixelRelief(relief), thin_lens_focal_length=FOCUS, **parts)
    beam = Beam(pupil, optics.PointSource(), WAVE, distance)
    return beam, Problem.from_beam(beam, Grid(shape, 1.5e-6, centre), tolerance, "float32")


@pytest.mark.parametrize("tolerance", [3e-2, 1e-2, 1e-3])
@pytest.mark.parametrize("name", SCENES)
def test_predicted_errors_are_upper_bounds(name, tolerance):
    beam, problem = problem_of(name, tolerance)
    sampling = window_sampling(problem)
    assert isinstance(sampling, WindowSampling)
    image = sampling.plain_intensity(beam, problem) / np.float32(beam.pupil.area)
    distance, centre, _ = SCENES[name]
    exact = optics.psf(
        beam.pupil, [WAVE], distance, dx=1.5e-6, shape=(23, 20), centre=centre, tolerance=1e-5, dtype="float64"
    ).psf
    actual, predicted = relative_l2(image, exact.ravel()), sampling.error(beam, problem, image)
    assert actual < predicted < tolerance
    assert sampling.finer.nodes.across == sampling.pupil.nodes.across + 1


def test_too_few_nodes_are_found_by_the_check(monkeypatch):
    monkeypatch.setattr(pixel_nodes, "QUADRATURE_SHARE", 20.0)
    beam, problem = problem_of("focus", 1e-2, shape=(65, 65))
    sampling = window_sampling(problem)
    image = sampling.plain_intensity(beam, problem) / np.float32(beam.pupil.area)
    assert sampling.error(beam, problem, image) > 1e-2


@pytest.mark.parametrize("heights", [np.zeros((24, 24)), ROUGH], ids=["flat", "rough"])
def test_gradients_are_those_at_a_tight_tolerance(heights):
    cotangent = torch.tensor(RNG.standard_normal((1, 23, 20)))

    def gradient(tolerance):
        numbers = torch.tensor(heights, requires_grad=True)
        pupil = Pupil(R, PixelRelief(numbers), thin_lens_focal_length=FOCUS)
        psf = optics.torch.psf(pupil, WAVE, FOCUS, dx=1.5e-6, shape=(23, 20), tolerance=tolerance, dtype="float64")
        (psf * cotangent).sum().backward()
        return numbers.grad.numpy()

    assert relative_l2(gradient(1e-2), gradient(1e-6)) < DERIVATIVE_ERROR * 1e-2


def test_a_differentiable_radius_moves_the_pixels_so_other_methods_are_used():
    import drjit as dr

    from optics.numerics.precision import precision

    radius = precision("float64").Float64(R)
    dr.enable_grad(radius)
    beam = Beam(Pupil(radius, PixelRelief(ROUGH), thin_lens_focal_length=FOCUS), optics.PointSource(), WAVE, FOCUS)
    assert window_sampling(Problem.from_beam(beam, Grid((23, 20), 1.5e-6), 1e-2, "float32")) is None


def test_pupils_share_nodes_and_ranks():
    """Neither depends on the heights, and both take longer than the PSF of a few pixels."""
    (_, one), (_, other) = (problem_of("focus", 1e-2, relief) for relief in (ROUGH, ROUGH[::-1]))
    assert one.aperture is other.aperture
    ranks = pixel_nodes._rank.cache_info().misses
    plans = [window_sampling(problem) for problem in (one, other)]
    assert pixel_nodes._rank.cache_info().misses - ranks <= 1
    assert all(a is b for a, b in zip(*(plan.pupil.layout for plan in plans), strict=True))
    assert one.stack.level.beams[0].pupil.height is None
