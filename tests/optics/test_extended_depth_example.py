"""The example of extended depth of field: PSFs agree with plain PyTorch, and training lowers errors."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import torch

SCRIPT = Path(__file__).parents[2] / "examples" / "10_extended_depth.py"


@pytest.fixture
def example(monkeypatch):
    specification = importlib.util.spec_from_file_location("extended_depth", SCRIPT)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    for name, value in {"SIDE": 17, "WIDTH": 32, "DISTANCES": 4, "TESTED": 5, "WAVELENGTHS": (540e-9,) * 3}.items():
        monkeypatch.setattr(module, name, value)
    return module


def test_both_cameras_agree_in_psfs_and_gradients(example):
    """An asymmetric mask detects flipped axes; two objects on both sides of the focus detect a wrong sign."""
    vergences = torch.tensor([0.4, 1.7])
    start = example.cubic() + 0.2 * torch.linspace(-1, 1, example.HEIGHTS, dtype=torch.float64)[:, None] ** 2
    weight = torch.tensor(np.random.default_rng(0).random((2, 3, 17, 17)), dtype=torch.float32)
    images, gradients = [], []
    for compute in (example.camera, example.plain_camera):
        heights = start.clone().requires_grad_()
        images.append(compute(heights, vergences))
        (images[-1] * weight).sum().backward()
        gradients.append(heights.grad)
    assert torch.linalg.norm(images[0] - images[1]) < 0.05 * torch.linalg.norm(images[0])
    assert torch.linalg.norm(images[0] - images[1].flip(0)) > 0.2 * torch.linalg.norm(images[0])
    cosine = torch.nn.functional.cosine_similarity(*(gradient.flatten() for gradient in gradients), dim=0)
    assert cosine > 0.97


def test_wiener_filter_has_the_smallest_error_of_linear_filters(example):
    """The filter alone restores scenes better than its neighbours with a wrong level of noise."""
    torch.manual_seed(0)
    scenes = example.leaves(4, np.random.default_rng(0))
    blur = example.plain_camera(example.cubic(), torch.tensor([0.001, 0.7, 1.3, 2.0]))
    network = example.Deblur(scenes)
    torch.nn.init.zeros_(network.correction[-1].weight)
    torch.nn.init.zeros_(network.correction[-1].bias)
    power, errors = network.power, []
    for factor in (0.1, 1.0, 10.0):
        network.power = power * factor
        restored = torch.stack([network(example.photographed(scene, blur), blur) for scene in scenes])
        errors.append(float((restored - scenes[:, None]).square().mean().detach()))
    assert errors[1] < min(errors[0], errors[2])


def test_training_raises_the_mean_ratio_and_lowers_its_spread(example):
    """The objective is the mean over distances minus FLATNESS standard deviations, in decibels."""
    scenes, found = example.leaves(6, np.random.default_rng(0)), []
    for steps in (1, 16):
        torch.manual_seed(0)
        heights, network = example.trained(example.plain_camera, example.cubic().requires_grad_(), scenes, steps)
        ratios, restored = example.judged(heights, network, scenes[:4])
        found.append(ratios.mean() - example.FLATNESS * ratios.std(ddof=1))
    assert found[1] > found[0] + 1, found
    assert restored.shape == (5, 3, 32, 32)
