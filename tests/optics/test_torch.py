"""The bridge to PyTorch: gradients equal Dr.Jit's and central differences, and a design converges."""

import numpy as np
import pytest
import torch

import optics
import optics.torch
from optics import AccuracyError, BSplineRelief, Pupil
from optics.numerics import device

VIEW = {"sensor_distance": 150e-6, "dx": 1e-6, "shape": (21, 17)}
EXACTLY = {"dtype": "float64", "tolerance": 1e-7}


def test_values_are_those_of_psf():
    points = np.random.default_rng(0).random((4, 4)) * 2e-6
    here = optics.torch.psf(torch.tensor(points), radius=15e-6, wavelengths=[500e-9, 600e-9], **VIEW)
    there = optics.psf(Pupil(15e-6, BSplineRelief(points)), [500e-9, 600e-9], **VIEW)
    assert here.shape == (2, 21, 17)
    np.testing.assert_array_equal(here.detach().numpy(), there.psf)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("shape", [(4, 4), (7, 7)])
def test_gradients_equal_central_differences(shape):
    """float64: differences of h = 1e-10 m have 1e-9/1e-4 of rounding, hence 1e-4 of the largest gradient. The method's
    own error is the same on both sides, so the tolerance need not be that small."""
    rng = np.random.default_rng(1)
    points, weight = rng.random(shape) * 1e-6, torch.tensor(rng.random((1, 21, 17)))

    def loss(heights, radius, n):
        return (optics.torch.psf(heights, radius=radius, n=n, **VIEW, **EXACTLY) * weight).sum()

    heights = torch.tensor(points, requires_grad=True)
    radius = torch.tensor(15e-6, dtype=torch.float64, requires_grad=True)
    n = torch.tensor(1.5, dtype=torch.float64, requires_grad=True)
    loss(heights, radius, n).backward()
    largest = heights.grad.abs().max()
    for index in ((0, 1), (3, 2)):
        step = np.zeros(shape)
        step[index] = 1e-10
        difference = loss(torch.tensor(points + step), 15e-6, 1.5) - loss(torch.tensor(points - step), 15e-6, 1.5)
        assert float(heights.grad[index]) == pytest.approx(float(difference / 2e-10), abs=1e-4 * float(largest))
    fixed = torch.tensor(points)
    difference = loss(fixed, 15e-6 + 1e-10, 1.5) - loss(fixed, 15e-6 - 1e-10, 1.5)
    assert float(radius.grad) == pytest.approx(float(difference / 2e-10), rel=1e-4)
    difference = loss(fixed, 15e-6, 1.5 + 1e-5) - loss(fixed, 15e-6, 1.5 - 1e-5)
    assert float(n.grad) == pytest.approx(float(difference / 2e-5), rel=1e-4)


@pytest.mark.slow
def test_a_lens_is_learnt_by_adam():
    """The lens improves from a weak lens to the focus: an image loss in torch, the optics in Dr.Jit."""
    weak = 0.5 * BSplineRelief.paraboloid(0.0, 1 / (0.5 * 150e-6), 12e-6).control_points
    lens = optics.torch.PointSpread(12e-6, heights=torch.tensor(weak), unit=0.1e-6, **VIEW)
    x, y = (torch.arange(n) - n // 2 for n in (17, 21))
    spot = torch.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / (2 * 3.0**2))
    optimiser = torch.optim.Adam(lens.parameters(), lr=1.0)
    losses = []
    for _ in range(25):
        optimiser.zero_grad()
        loss = -torch.log((lens() * spot).sum() * 1e-12)
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < losses[0] - 0.3
    found = optics.psf(Pupil(12e-6, BSplineRelief(lens.heights.detach().numpy())), **VIEW)
    before = optics.psf(Pupil(12e-6, BSplineRelief(weak)), **VIEW)
    assert optics.strehl_ratio(found)[0] > 1.3 * optics.strehl_ratio(before)[0]


def test_errors_pass_through():
    with pytest.raises(ValueError, match="aperture_radius"):
        optics.torch.psf(torch.zeros(4, 4), radius=-1.0, **VIEW)
    with pytest.raises(ValueError, match=r"heights = .*must be a kind of Tensor"):
        optics.torch.psf(np.zeros((4, 4)), radius=1e-5, **VIEW)
    with pytest.raises(ValueError, match=r"heights = .*must be a kind of Tensor"):
        optics.torch.PointSpread(1e-5, heights=np.zeros((4, 4)), **VIEW)
    with pytest.raises(ValueError, match=r"field: only `optics.psf` returns it"):
        optics.torch.psf(torch.zeros(4, 4), radius=1e-5, field=True, **VIEW)
    with pytest.raises(AccuracyError, match="float32 allows"):
        optics.torch.psf(torch.zeros(4, 4), radius=1e-5, tolerance=1e-8, **VIEW)


def test_a_gpu_that_torch_cannot_use_is_refused(monkeypatch):
    monkeypatch.setenv(device.VARIABLE, "cuda")
    monkeypatch.setattr(device, "has_gpu", lambda: True)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(optics.BackendError, match="RHABDOM_DEVICE requires a GPU, but this torch has none"):
        optics.torch.psf(torch.zeros(4, 4), radius=30e-6, sensor_distance=240e-6)


def test_one_wavelength_may_stand_alone():
    for wavelengths in (500e-9, [500e-9]):
        assert optics.torch.PointSpread(15e-6, wavelengths, **VIEW)().shape == (1, 21, 17)
