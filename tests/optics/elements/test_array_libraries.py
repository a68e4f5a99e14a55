"""Elements evaluate on arrays of NumPy, PyTorch and Dr.Jit: the same numbers, and each library's own derivatives."""

import warnings

import drjit as dr
import numpy as np
import pytest
import torch

import optics
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.numerics.array_library import like
from optics.numerics.precision import precision

TYPES = precision("float64")
RNG = np.random.default_rng(0)
R, WAVE = 30e-6, 500e-9
POINTS, MAP = 1e-6 * RNG.random((4, 4)), 1e-6 * RNG.random((9, 9))
DIM = 0.4 + 0.1 * np.arange(8.0)[:, None] / 8 * np.ones(8)
AT = np.linspace(-R, R, 12)
X, Y = np.meshgrid(AT, AT)
# Every number that may carry a derivative -> its value, and the pupil and source made of such a number.
INPUTS = {
    "control points": (POINTS, lambda v: {"height": optics.BSplineRelief(v)}),
    "samples": (MAP, lambda v: {"height": optics.HeightMap(v)}),
    "three samples": (MAP[:3, :3], lambda v: {"height": v}),
    "pixels": (MAP, lambda v: {"height": optics.PixelRelief(v)}),
    "index": (np.array(1.6), lambda v: {"height": MAP, "n": v}),
    "focal length": (np.array(-2e-4), lambda v: {"thin_lens_focal_length": v}),
    "vector of coefficients": (0.1 * RNG.random(15), lambda v: {"wavefront": optics.Zernike(v)}),
    "one coefficient": (np.array(0.1), lambda v: {"wavefront": optics.Zernike({(3, -1): v, (4, 0): 0.2}, 2 * R)}),
    "map of a wavefront": (MAP, lambda v: {"wavefront": optics.WavefrontMap(v, 1.2 * R)}),
    "mask": (DIM, lambda v: {"mask": optics.MaskMap(v)}),
    "waist": (np.array(2e-5), lambda v: {"mask": optics.GaussianMask(v)}),
    "radius": (
        np.array(R),
        lambda v: {"aperture_radius": v, "height": MAP, "wavefront": optics.Zernike([0, 0.1, 0.3])},
    ),
    "source distance": (np.array(1e-3), lambda v: {"source": PointSource(v, (0.1, -0.2))}),
    "source angle": (np.array(-0.2), lambda v: {"source": PointSource(1e-3, (0.1, v))}),
    "angle of a plane wave": (np.array(-0.2), lambda v: {"source": PointSource(angle=(0.1, v))}),
}


def light(name, value):
    given = {"aperture_radius": R, "source": PointSource(1e-3, (0.1, -0.2)), **INPUTS[name][1](value)}
    return Beam(source=given.pop("source"), pupil=optics.Pupil(**given), wavelength=WAVE, distance=2e-4)


def amplitude_and_waves(name, value, x, y):
    """The amplitude also depends on x and y in units of the radius."""
    beam = light(name, value)
    return beam.pupil.amplitude(x / R, y / R), beam.waves(x, y)


def on_drjit(name, value):
    return amplitude_and_waves(name, value, TYPES.Float64(X.ravel()), TYPES.Float64(Y.ravel()))


@pytest.mark.parametrize("name", INPUTS)
def test_all_libraries_give_the_same_numbers(name):
    value = INPUTS[name][0]
    known = [part.numpy() for part in on_drjit(name, value)]
    flat = amplitude_and_waves(name, value, X.ravel(), Y.ravel())
    across = amplitude_and_waves(name, value, AT[None, :], AT[:, None])
    torches = amplitude_and_waves(name, value, torch.tensor(X), torch.tensor(Y))
    for own in (flat, across, torches):
        for part, one in zip(own, known, strict=True):
            np.testing.assert_allclose(np.ravel(part), one, rtol=1e-12, atol=1e-13 * np.abs(one).max())
    assert (type(across[1]), type(torches[1])) == (np.ndarray, torch.Tensor)


@pytest.mark.parametrize("name", INPUTS)
def test_torch_and_drjit_carry_the_same_derivatives(name):
    value, back = INPUTS[name][0], RNG.standard_normal(X.size)
    of_torch = torch.tensor(value, requires_grad=True)
    passed, waves = amplitude_and_waves(name, of_torch, torch.tensor(X.ravel()), torch.tensor(Y.ravel()))
    ((passed + waves) * torch.tensor(back)).sum().backward()
    of_drjit = TYPES.Tensor64(value) if value.ndim else TYPES.Float64(float(value))
    dr.enable_grad(of_drjit)
    passed, waves = on_drjit(name, of_drjit)
    dr.backward(dr.sum((passed + waves) * TYPES.Float64(back)))
    known = dr.grad(of_drjit).numpy().reshape(value.shape)
    assert np.abs(known).max() > 0
    np.testing.assert_allclose(of_torch.grad.numpy(), known, rtol=1e-9, atol=1e-11 * np.abs(known).max())


def test_numpy_drops_derivatives_and_other_libraries_refuse_to():
    asked = torch.tensor(MAP, requires_grad=True)
    pupil = optics.Pupil(R, asked)
    np.testing.assert_array_equal(pupil.height.height(X / R, Y / R), optics.HeightMap(MAP).height(X / R, Y / R))
    with pytest.raises(
        ValueError, match=r"requires a derivative of PyTorch, which would be lost here: call optics.torch"
    ):
        pupil.height.height(TYPES.Float64(0.1), TYPES.Float64(0.2))
    known = TYPES.Tensor64(MAP)
    dr.enable_grad(known)
    with pytest.raises(ValueError, match=r"requires a derivative of Dr.Jit, which would be lost here$"):
        optics.HeightMap(known).height(torch.tensor(0.1), torch.tensor(0.2))


def test_a_tensor_keeps_its_precision():
    relief = optics.HeightMap(torch.tensor(MAP, dtype=torch.float32, requires_grad=True))
    found = relief.height(torch.tensor(X / R), torch.tensor(Y / R))
    found.sum().backward()
    assert (found.dtype, relief.samples.grad.dtype) == (torch.float64, torch.float32)


def test_a_tensor_without_gradient_is_converted_without_a_warning():
    """It may be a result of elements, such as the amplitude of a mask."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = like(torch.zeros(2), torch.tensor([0.25, 0.5], dtype=torch.float64))
    assert found.dtype == torch.float32
    assert found.tolist() == [0.25, 0.5]
