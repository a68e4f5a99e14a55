"""Samples follow from the light in the window at coarse tolerances, and the check finds the error of every PSF."""

import numpy as np
import pytest

import optics
from optics import BSplineRelief, GaussianMask, Grid, HeightMap, PointSource, Pupil, Zernike
from optics.elements.beam import Beam
from optics.methods import window_edges as module
from optics.methods.problem import Problem
from optics.methods.window_sampling import WindowSampling, window_sampling
from optics.methods.window_sums import pupil_gradient, window_field
from validation.reference import relative_l2

WAVE, RADIUS, FOCUS = 550e-9, 1e-3, 10e-3
WINDOW = {"sensor_distance": FOCUS, "dx": 1.4e-6, "shape": (33, 33)}


def lens(**bent):
    return Pupil(RADIUS, thin_lens_focal_length=FOCUS, **bent)


def rough(noise):
    x = (np.arange(32) + 0.5) / 16 - 1
    smooth = 0.3e-6 * (x**3 - x[:, None] ** 2 * x + 0.5 * np.cos(3 * x[:, None]))
    return HeightMap(smooth + noise * np.random.default_rng(2).standard_normal((32, 32)))


def modes(order, size):
    rng = np.random.default_rng(3)
    return Zernike({(n, m): size * rng.normal() / n for n in range(2, order + 1) for m in range(-n, n + 1, 2)})


def test_predicted_errors_hold_and_little_is_wasted():
    found = []
    for pupil in (
        lens(),
        lens(height=rough(60e-9)),
        lens(height=rough(150e-9)),
        lens(wavefront=modes(4, 0.2)),
        lens(wavefront=modes(6, 0.3)),
        lens(mask=GaussianMask(0.7e-3)),
        lens(aperture=optics.Polygon.regular(5)),
    ):
        coarse = optics.psf(pupil, [WAVE], **WINDOW, tolerance=1e-2)
        assert coarse.plan.method == "low_rank"
        error = relative_l2(coarse.psf, optics.psf(pupil, [WAVE], **WINDOW, tolerance=2e-4).psf)
        assert error <= coarse.plan.predicted_error <= 1e-2
        found.append((error, coarse.plan.predicted_error / error))
    errors, ratios = np.median(found, axis=0)
    assert errors > 1e-2 / 30
    assert ratios < 10


def test_a_rough_relief_needs_samples_for_its_light_alone():
    """Samples for all of the detail of the relief would be too many, and the PSF would be refused."""
    plan = optics.psf(lens(height=rough(150e-9)), [WAVE], **WINDOW, tolerance=1e-2).plan
    assert plan.predicted_error < 1e-2
    assert plan.samples[0] < 130


def test_the_check_finds_light_that_samples_miss(monkeypatch):
    """Light that belongs outside the window appears in it, because half of the rays are neglected."""
    monkeypatch.setattr(module, "NEGLECTED", 0.5)
    monkeypatch.setattr(module, "RIM_CYCLES", 0.0)
    monkeypatch.setattr(module, "RIM_MISSED", 1.0)
    pupil = lens(wavefront=modes(6, 0.6))
    beam = Beam(pupil, PointSource(), WAVE, FOCUS)
    problem = Problem.from_beam(beam, Grid(WINDOW["shape"], WINDOW["dx"]), 1e-2)
    sampling = window_sampling(problem)
    image = sampling.plain_intensity(beam, problem) / pupil.area
    exact = optics.psf(pupil, [WAVE], **WINDOW, tolerance=1e-4).psf.ravel()
    assert sampling.error(beam, problem, image) > relative_l2(image, exact) > 1e-2
    assert optics.psf(pupil, [WAVE], **WINDOW, tolerance=1e-2).plan.predicted_error <= 1e-2


def test_a_steep_pupil_off_the_axis_needs_more_than_one_point_of_the_window():
    relief = BSplineRelief(2e-6 * np.random.default_rng(1).random((4, 4)))
    pupil = Pupil(40e-6, relief, thin_lens_focal_length=200e-6)
    beam, window = Beam(pupil, PointSource(), WAVE, 200e-6), Grid((33, 25), 1.5e-6, (9e-6, -4e-6))
    problem = Problem.from_beam(beam, window, 1e-2, "float64")
    sampling = window_sampling(problem)
    assert isinstance(sampling, WindowSampling)
    assert sampling.rank > 1
    view = {"dx": window.dx, "shape": window.shape, "centre": window.centre, "dtype": "float64"}
    exact = optics.psf(pupil, [WAVE], 200e-6, **view, tolerance=1e-8)
    image = sampling.plain_intensity(beam, problem) / pupil.area
    assert relative_l2(image, exact.psf.ravel()) <= sampling.error(beam, problem, image) <= 1e-2
    fields = (sampling.field(beam, problem).numpy(), optics.psf(pupil, [WAVE], 200e-6, **view, field=True).field[0])
    overlap = np.abs(np.vdot(*fields)) / np.linalg.norm(fields[0]) / np.linalg.norm(fields[1])
    assert overlap > 1 - 1e-4


def test_tight_tolerances_do_not_use_it():
    beam = Beam(lens(), PointSource(), WAVE, FOCUS)
    assert window_sampling(Problem.from_beam(beam, Grid(WINDOW["shape"], WINDOW["dx"]), 1e-4)) is None


def arrays(rank, *axes):
    rng = np.random.default_rng(4)

    def some(*shape):
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    return some(*axes, 7, 7), some(rank, rank, 7, 7), some(5, 7 * rank), some(6, 7 * rank), some(*axes, 5, 6)


@pytest.mark.parametrize("rank", [1, 3])
def test_the_gradient_is_the_adjoint_of_the_sums(rank):
    """Leading axes, here of two pupils and three wavelengths, are independent."""
    pupil, *geometry, cotangent = arrays(rank, 2, 3)
    field = window_field(pupil, *geometry)
    assert field.shape == (2, 3, 5, 6)
    np.testing.assert_allclose(field[1, 2], window_field(pupil[1, 2], *geometry), rtol=1e-12)
    found = pupil_gradient(cotangent, *geometry)
    assert found.shape == pupil.shape
    assert np.vdot(found, pupil) == pytest.approx(np.vdot(cotangent, field), rel=1e-12)


def test_torch_arrays_are_accepted():
    torch = pytest.importorskip("torch")
    pupil, *geometry, cotangent = arrays(2)
    inputs = torch.tensor(pupil, requires_grad=True)
    field = window_field(inputs, *map(torch.from_numpy, geometry))
    (torch.from_numpy(cotangent).conj() * field).sum().real.backward()
    np.testing.assert_allclose(field.detach().numpy(), window_field(pupil, *geometry), rtol=1e-12)
    np.testing.assert_allclose(inputs.grad.numpy(), pupil_gradient(cotangent, *geometry), rtol=1e-12)
