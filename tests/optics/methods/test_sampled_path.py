"""Heights and wavefronts at samples of the pupil, from shared arrays."""

import numpy as np
import pytest
import torch

import optics
from optics import BSplineRelief, HeightMap, Pupil, WavefrontMap, Zernike
from optics.elements.pupil_path import relief_height, wavefront_ahead
from optics.methods import sampled_path
from optics.methods.problem import Problem
from optics.methods.sampled_path import sampled_height, sampled_wavefront
from optics.methods.window_sampling import window_sampling
from optics.numerics.grid import Grid
from optics.point_spread.request import Setup

RNG = np.random.default_rng(3)
R = 60e-6
RELIEFS = {
    "map": HeightMap(3e-7 * RNG.standard_normal((7, 9))),
    "large map": HeightMap(3e-7 * RNG.standard_normal((130, 5))),
    "patch": BSplineRelief(1e-6 * RNG.standard_normal((4, 4))),
}
FRONTS = {
    "map": WavefrontMap(3e-7 * RNG.standard_normal((9, 6)), 70e-6),
    "low order": Zernike(0.1 * RNG.standard_normal(15), 70e-6),
    "order 16": Zernike({(16, -4): 0.05, (16, 16): 0.02}),
    "order 18": Zernike({(18, -4): 0.05, (18, 18): 0.02}),
}


def samples(distance, centre=(0.0, 0.0)):
    """Samples of a pupil with as many samples as rough maps need."""
    pupil = Pupil(R, RELIEFS["map"], wavefront=FRONTS["map"], thin_lens_focal_length=distance)
    setup = Setup(distance, optics.PointSource(), Grid((33, 33), 1e-6, centre), 1e-2, "auto", "float32")
    problem: Problem = setup.request(pupil, 550e-9).problem
    return window_sampling(problem).pupil


# The largest sine is 0.06 or 0.35, so paths are interpolated in all scenes.
@pytest.mark.parametrize(("distance", "centre"), [(1e-3, (0.0, 0.0)), (2e-4, (1e-5, -5e-6))])
@pytest.mark.parametrize("name", [*RELIEFS, *FRONTS])
def test_values_are_those_at_all_points(name, distance, centre):
    own = samples(distance, centre)
    pairs = ("height", sampled_height, relief_height), ("wavefront", sampled_wavefront, wavefront_ahead)
    for kind, sampled, exact in pairs:
        pupil = Pupil(R, RELIEFS.get(name), wavefront=FRONTS.get(name))
        found, known = sampled(pupil, own, np.asarray), exact(pupil, *own.points)
        if getattr(pupil, kind) is None:
            assert found is None
            continue
        assert found.shape == own.grid.shape
        assert np.abs(found - known).max() < 1e-5 * np.ptp(known)


@pytest.mark.parametrize("name", ["map", "patch", "low order"])
def test_derivatives_are_the_transposed_matrix(name):
    own = samples(1e-3)
    relief, front = RELIEFS.get(name), FRONTS.get(name) if name == "low order" else None
    given = front.coefficients_um if relief is None else relief.control_points if name == "patch" else relief.samples
    scale = 1.0 if relief is None else 1e-6

    def values(numbers):
        own_relief = relief if relief is None else type(relief)(numbers * scale)
        own_front = front if front is None else Zernike(numbers)
        pupil = Pupil(R, own_relief, wavefront=own_front)
        sampled = sampled_wavefront if relief is None else sampled_height
        return sampled(pupil, own, torch.from_numpy)[::9, ::11] * 1e6

    numbers = torch.tensor(np.array(given) / scale, requires_grad=True)
    assert torch.autograd.gradcheck(values, numbers)


def test_maps_share_the_weights_of_samples(monkeypatch):
    """A second map with the same samples evaluates no splines."""
    own = samples(1e-3)
    first = sampled_height(Pupil(R, RELIEFS["map"]), own, np.asarray)
    monkeypatch.setattr(sampled_path, "spline_weights", None)
    twice = sampled_height(Pupil(R, HeightMap(2 * RELIEFS["map"].samples)), own, np.asarray)
    np.testing.assert_allclose(twice, 2 * first, rtol=1e-12)
