"""The rank of the slow part follows the tolerance: it is sufficient at every tolerance, and not larger than
necessary."""

import numpy as np
import pytest

import optics
from optics import BSplineRelief, Grid, PixelRelief, PointSource, Pupil, Zernike
from optics.elements.beam import Beam
from optics.methods import low_rank as low_rank_module
from optics.methods import slow_factor
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
        problem, exactly = (Problem.from_beam(beam, WINDOW, each, "float64") for each in (tolerance, 1e-8))
        (how,), (reference,) = low_rank(problem), nodes(exactly)
        exact = reference.intensity(beam, exactly).numpy()
        found.append(np.linalg.norm(how.intensity(beam, problem).numpy() - exact) / np.linalg.norm(exact))
    return np.array(found)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3, 1e-5])
def test_sampling_takes_no_more_than_half_the_tolerance(tolerance):
    """Every plan relies on this. The rank is determined by the amplitudes at the rim, and the amplitudes inside have
    smaller errors.
    """
    assert errors(tolerance).max() < tolerance / 2


def test_a_rank_chosen_for_far_more_error_breaks_the_promise(monkeypatch):
    monkeypatch.setattr(slow_factor, "RANK_RIPPLE", 20 * slow_factor.RANK_RIPPLE)
    assert errors(1e-4).max() > 1e-4 / 2


@pytest.mark.fast_cases(5)
@pytest.mark.parametrize("relief", [None, PixelRelief(1e-6 * np.random.default_rng(1).random((5, 5)))])
@pytest.mark.parametrize("centre", [(0.0, 0.0), (9e-6, -4e-6)])
@pytest.mark.parametrize("shape", [(1, 1), (1, 8), (9, 1), (33, 65), (16, 17), (17, 16)])
def test_windows_of_any_shape_are_the_direct_sum_s(shape, centre, relief):
    """The sum treats the two halves of the window together. With an even number of samples, one sample has no mirror
    image.
    """
    beam = next(eyes(1)) if relief is None else Beam(Pupil(15e-6, relief), PointSource(), 550e-9, Z)
    problem = Problem.from_beam(beam, Grid(shape, 0.25e-6, centre), 1e-6, "float64")
    (how,), (reference,) = low_rank(problem), nodes(problem)
    exact = reference.intensity(beam, problem).numpy()
    assert np.linalg.norm(how.intensity(beam, problem).numpy() - exact) < 1e-6 * np.linalg.norm(exact)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_the_matrix_is_limited_in_bytes_and_not_in_samples_across(dtype):
    """A strongly aberrated focus of a thousand Fresnel zones has rank 7, with 700 samples across. The direct sum would
    take 24 s.
    """
    tangent = 0.3 / np.sqrt(1 - 0.3**2)
    radius = 1000 * 550e-9 / tangent
    lens = Pupil(radius, thin_lens_focal_length=radius / tangent, wavefront=Zernike({(6, 2): 0.08, (5, 5): 0.08}))
    beam = Beam(lens, PointSource(), 550e-9, radius / tangent)
    found = low_rank(Problem.from_beam(beam, Grid.square(513, 550e-9 / 0.3 / 8), 2e-4, dtype))
    if dtype == "float64":
        assert found == []
        return
    (how,) = found
    assert len(how.pupil.at) < 1000 < 4096 < how.rank * how.samples[0]
    assert (how.rank * how.samples[0]) ** 2 * 8 <= low_rank_module.MOST_BYTES


def test_it_is_not_offered_close_to_the_pupil():
    """One wavelength behind a pupil that is sixty wavelengths wide, the error would be 0.2, while the predicted error
    is 5e-3.
    """
    window = {"sensor_distance": 0.5e-6, "dx": 0.1e-6, "shape": (9, 9)}
    even = optics.MaskMap(np.ones((4, 4)))  # the cheapest only without symmetry
    found = optics.psf(optics.Pupil(30e-6, mask=even), [500e-9], tolerance=1e-2, **window)
    exact = optics.psf(optics.Pupil(30e-6), [500e-9], tolerance=1e-6, dtype="float64", **window)
    assert np.linalg.norm(found.psf - exact.psf) < found.plan.predicted_error * np.linalg.norm(exact.psf)
    assert found.plan.method != "low_rank"
