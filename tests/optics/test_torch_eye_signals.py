"""Signals of eyes in PyTorch: values and derivatives agree with `Eye.see`, and descent through them finds a lens."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import torch

import optics.torch
from rhabdom import optics

SCRIPT = Path(__file__).parents[2] / "examples" / "11_lens_through_an_eye.py"
POINTS = optics.BSplineRelief.paraboloid(0.0, 6e3, 30e-6).control_points * 1e6  # [µm], somewhat out of focus
SCENE = np.random.default_rng(1).random((2, 12, 16))
WEIGHTS = torch.tensor(np.random.default_rng(2).random((3, 3, 4)))


def eye_of(points, fov_deg):
    pupil = optics.Pupil(30e-6, optics.BSplineRelief(points * 1e-6), n=1.5)
    return optics.Eye(pupil, (3, 4), fov_deg=fov_deg, bands=2, tolerance=1e-4, dtype="float64")


def test_derivatives_agree_with_differences_of_the_plain_eye():
    """Central differences of `Eye.see` are the oracle, for heights, field of view and distance of the scene."""
    points, fov, z = (torch.tensor(value, dtype=torch.float64, requires_grad=True) for value in (POINTS, 40.0, 5e-3))
    signals = optics.torch.eye_signals(eye_of(points, fov), SCENE, 4, z=z)
    assert signals.dtype == torch.float64
    (signals * WEIGHTS).sum().backward()

    def weighted(change, of_fov, of_z):
        seen = eye_of(POINTS + change, 40.0 + of_fov).see(SCENE, 4, z=5e-3 + of_z)
        return float((torch.tensor(seen) * WEIGHTS).sum())

    height = np.zeros((4, 4))
    height[1, 2] = 1e-3
    for found, step in ((points.grad[1, 2], (height, 0, 0)), (fov.grad, (0, 0.01, 0)), (z.grad, (0, 0, 1e-5))):
        back = tuple(-np.asarray(part) for part in step)
        width = 2 * max(float(np.max(part)) for part in step)
        assert float(found) == pytest.approx((weighted(*step) - weighted(*back)) / width, rel=2e-3)


def test_signals_without_gradients_are_those_of_the_plain_eye():
    eye = eye_of(torch.tensor(POINTS), 40.0)
    noisy = [
        see(SCENE, 4, np.random.default_rng(3), 1.0) for see in (lambda *a: optics.torch.eye_signals(eye, *a), eye.see)
    ]
    assert torch.equal(noisy[0], torch.from_numpy(noisy[1]))
    asking = eye_of(torch.tensor(POINTS, requires_grad=True), 40.0)
    with torch.no_grad():
        assert torch.equal(optics.torch.eye_signals(asking, SCENE, 4, np.random.default_rng(3), 1.0), noisy[0])


def test_only_eyes_are_accepted():
    with pytest.raises(ValueError, match=r"^eye = .*: must be"):
        optics.torch.eye_signals(optics.Pupil(30e-6), SCENE, 4)


@pytest.mark.slow
def test_descent_through_an_eye_finds_a_lens():
    losses, ratios = runpy.run_path(str(SCRIPT))["find"](40)
    assert ratios[0] < 0.05 < 0.3 < ratios[-1], "0.42 after 40 steps, 0.96 after 60"
    assert np.mean(losses[-4:]) < 0.2 * np.mean(losses[:4])
