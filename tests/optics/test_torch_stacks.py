"""Stacks of PSFs in PyTorch at coarse tolerances: values, gradients, and PSFs that a stack cannot compute."""

import numpy as np
import pytest
import torch

import optics
import optics.torch
from optics import BSplineRelief, GaussianMask, HeightMap, MaskMap, PixelRelief, Pupil, WavefrontMap, Zernike
from optics.elements.torch_numbers import torch_numbers, with_numbers
from optics.methods import window_edges, window_stack
from optics.methods.window_rank import DERIVATIVE_ERROR
from optics.point_spread.light_batch import LightBatch
from validation.reference import relative_l2

R, FOCUS = 100e-6, 1e-3
RNG = np.random.default_rng(0)
WAVES, DEPTHS = [480e-9, 600e-9], [0.02, 0.1, np.inf]
VIEW = {"dx": 1.5e-6, "shape": (19, 16), "centre": (3e-6, -2e-6)}
ROUGH, SMALL = 2e-7 * RNG.standard_normal((6, 6)), 1e-7 * RNG.standard_normal((4, 4))
MODES, AMPLITUDES = 0.1 * RNG.standard_normal(10), 0.6 + 0.1 * RNG.random((6, 6))


def lens(radius=R, **parts):
    return Pupil(radius, thin_lens_focal_length=FOCUS, **parts)


def asking(value):
    return torch.tensor(value, dtype=torch.float64, requires_grad=True)


@pytest.fixture
def only_stacks(monkeypatch):
    """Dr.Jit computes no PSF, so that all are computed by stacks."""

    def refuse(self, places, *_):
        raise AssertionError(f"members {places} are not in a stack")

    monkeypatch.setattr(LightBatch, "images", refuse)


def test_each_psf_of_a_batch_is_that_of_a_single_call(only_stacks):
    """The pupils have two radii, so they need different samples. They also have reliefs, aberrations and masks."""
    pupils = [
        lens(height=HeightMap(asking(ROUGH)), mask=MaskMap(AMPLITUDES)),
        lens(60e-6, wavefront=Zernike(asking(MODES)), aperture=optics.Annulus(0.3)),
        lens(
            height=BSplineRelief(SMALL), mask=GaussianMask(asking(80e-6)), n=optics.RefractiveIndex.from_abbe(1.6, 40.0)
        ),
    ]
    found = optics.torch.psf(pupils, WAVES, 1.03e-3, DEPTHS, (0.004, -0.002), tolerance=1e-2, **VIEW).detach()
    assert found.shape == (3, 3, 2, 19, 16)
    for pupil, images in zip(pupils, found.numpy(), strict=True):
        fixed = with_numbers(pupil, {name: t.detach().numpy()[()] for name, t in torch_numbers(pupil).items()})
        for depth, image in zip(DEPTHS, images, strict=True):
            exact = optics.psf(fixed, WAVES, 1.03e-3, depth, (0.004, -0.002), tolerance=1e-5, **VIEW).psf
            assert max(map(relative_l2, image, exact)) < 1e-2


INPUTS = {
    "height": (ROUGH, lambda v: {"pupil": lens(height=HeightMap(v))}),
    "pixels": (ROUGH, lambda v: {"pupil": lens(height=PixelRelief(v))}),
    "control points": (SMALL, lambda v: {"pupil": lens(height=BSplineRelief(v))}),
    "wavefront": (ROUGH, lambda v: {"pupil": lens(wavefront=WavefrontMap(v, 110e-6))}),
    "modes": (MODES, lambda v: {"pupil": lens(wavefront=Zernike(v))}),
    "mode": (0.1, lambda v: {"pupil": lens(wavefront=Zernike({(2, 0): v, (3, 1): 0.05}))}),
    "mask": (AMPLITUDES, lambda v: {"pupil": lens(mask=MaskMap(v))}),
    "waist": (80e-6, lambda v: {"pupil": lens(mask=GaussianMask(v))}),
    "index": (1.5, lambda v: {"pupil": lens(height=HeightMap(ROUGH), n=v)}),
    "focal length": (FOCUS, lambda v: {"pupil": Pupil(R, HeightMap(ROUGH), thin_lens_focal_length=v)}),
    "sensor distance": (1.03e-3, lambda v: {"sensor_distance": v}),
    "source distance": (0.02, lambda v: {"source_distance": v}),
    "angle": ([0.004, -0.002], lambda v: {"source_angle": v}),
}


def call(name, value, tolerance, wavelengths=WAVES):
    given = {"pupil": lens(height=HeightMap(ROUGH)), "sensor_distance": 1.03e-3, "source_distance": DEPTHS[:2]}
    given |= INPUTS[name][1](value)
    return optics.torch.psf(given.pop("pupil"), wavelengths, **given, **VIEW, tolerance=tolerance, dtype="float64")


@pytest.mark.fast_cases(5)
@pytest.mark.parametrize("name", INPUTS)
def test_gradients_have_the_stated_error(name, monkeypatch):
    """The exact gradient is that of a PSF at a small tolerance, which is computed by Dr.Jit."""
    value = asking(INPUTS[name][0])
    weight = torch.tensor(np.random.default_rng(1).standard_normal((19, 16)))
    exact = torch.autograd.grad((call(name, value, 1e-4, WAVES[0]) * weight).sum(), value)[0]
    monkeypatch.setattr(LightBatch, "images", None)
    found = torch.autograd.grad((call(name, value, 1e-2, WAVES[0]) * weight).sum(), value)[0]
    assert float((found - exact).norm() / exact.norm()) < DERIVATIVE_ERROR * 1e-2


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("name", [name for name in INPUTS if name != "sensor distance"])
def test_gradients_are_those_of_the_sums(name, only_stacks):
    """The samples do not change with these inputs, so that differences agree to many digits."""
    scale = float(np.abs(INPUTS[name][0]).max())
    value = asking(np.asarray(INPUTS[name][0]) / scale)
    options = {"eps": 1e-6, "rtol": 1e-4, "atol": 1e-6, "nondet_tol": 1e-9, "fast_mode": True}
    assert torch.autograd.gradcheck(lambda v: call(name, v * scale, 1e-2) * 1e-9, (value,), **options)


def test_a_graph_serves_several_passes_and_no_second_derivative(only_stacks):
    value = asking(SMALL)
    image = call("control points", value, 1e-2)
    first, other = (torch.autograd.grad(image.sum() * k, value, retain_graph=True)[0] for k in (1, 2))
    torch.testing.assert_close(2 * first, other)
    (slope,) = torch.autograd.grad(image.sum(), value, create_graph=True)
    with pytest.raises(RuntimeError, match=r"^optics.torch.psf has no second derivatives"):
        slope.sum().backward()
    with torch.no_grad():
        assert not call("control points", value, 1e-2).requires_grad


def test_psfs_that_fail_the_check_are_computed_again(monkeypatch):
    """Half of the rays are neglected, and light from outside the window appears in it."""
    monkeypatch.setattr(window_edges, "NEGLECTED", 0.5)
    monkeypatch.setattr(window_edges, "RIM_CYCLES", 0.0)
    again, images = [], LightBatch.images
    monkeypatch.setattr(LightBatch, "images", lambda self, places, *a: again.append(places) or images(self, places, *a))
    strong = {"pupil": lens(wavefront=Zernike(5 * MODES)), "sensor_distance": 1.03e-3}
    found = optics.torch.psf(strong["pupil"], WAVES, 1.03e-3, DEPTHS, tolerance=3e-3, **VIEW).numpy()
    assert again
    for depth, image in zip(DEPTHS, found, strict=True):
        exact = optics.psf(**strong, wavelengths=WAVES, source_distance=depth, tolerance=1e-5, **VIEW).psf
        assert max(map(relative_l2, image, exact)) < 3e-3


def test_radii_and_other_methods_are_left_to_dr_jit(monkeypatch):
    class Reached(Exception):
        pass

    def reached(*_):
        raise Reached

    monkeypatch.setattr(LightBatch, "images", reached)
    for pupil, view in (
        (lens(asking(R)), {"tolerance": 1e-2}),
        (lens(height=asking(SMALL)), {"tolerance": 1e-4}),
        (lens(height=asking(SMALL)), {"tolerance": 1e-2, "method": "rayleigh_sommerfeld"}),
    ):
        with pytest.raises(Reached):
            optics.torch.psf(pupil, WAVES, 1.03e-3, **VIEW, **view)


@pytest.mark.parametrize("many", [1, 1e9])
def test_one_operation_computes_the_same_as_separate_ones(only_stacks, monkeypatch, many):
    """Also if memory limits the number of sources whose sums are computed together."""
    found = []
    for single in (True, False):
        monkeypatch.setattr(window_stack, "MOST_ENTRIES", many)
        if not single:
            monkeypatch.setattr(window_stack, "is_single", lambda *_: False)
        heights, modes = asking(ROUGH), asking(MODES)
        pupil = lens(height=HeightMap(heights), wavefront=Zernike(modes), mask=MaskMap(AMPLITUDES))
        images = optics.torch.psf(pupil, WAVES, 1.03e-3, DEPTHS, tolerance=1e-2, **VIEW)
        (images**2).mean().backward()
        found.append((images.detach(), heights.grad, modes.grad))
    for one, other in zip(*found, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-5 * float(other.abs().max()))
