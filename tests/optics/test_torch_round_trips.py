"""Conversions of tensors to the host in `optics.torch`, counted on the CPU.

On a GPU, each conversion would copy a tensor to the host and wait for it. Counted are all calls that give the numbers
of a tensor to Python or NumPy. On the CPU, NumPy shares the memory of tensors, and computes a few operations; the tests
use the operations for other devices instead.
"""

from collections import Counter
from contextlib import contextmanager
from unittest import mock

import numpy as np
import pytest
import torch
from scipy.sparse import csr_matrix

import optics.torch
from optics.methods.window_stack import WindowStack
from optics.numerics import array_library

TO_HOST = ("numpy", "__array__", "cpu", "tolist", "item", "__float__", "__int__", "__bool__")
VIEW = {"dx": 1e-6, "shape": (17, 17), "tolerance": 1e-2}


@pytest.fixture(autouse=True)
def elsewhere(monkeypatch):
    """Let operations treat tensors as if they lay on another device than the CPU."""
    monkeypatch.setattr(array_library, "on_host", lambda tensor: False)


@contextmanager
def conversions():
    """Count the conversions of tensors to the host."""
    found = Counter()

    def counted(name, original):
        def convert(self, *given, **more):
            found[name] += 1
            return original(self, *given, **more)

        return convert

    with mock.patch.multiple(torch.Tensor, **{name: counted(name, getattr(torch.Tensor, name)) for name in TO_HOST}):
        yield found


def pupil(heights):
    return optics.Pupil(40e-6, height=heights, thin_lens_focal_length=0.6e-3)


@pytest.fixture
def between():
    """Conversions between the light behind the pupil and the PSF, of each stack."""
    found, intensity = [], WindowStack.intensity

    def counted(self, sampling):
        with conversions() as inside:
            images = intensity(self, sampling)
        found.append((dict(inside), type(images)))
        return images

    with mock.patch.object(WindowStack, "intensity", counted):
        yield found


@pytest.mark.parametrize("name", ["height", "wavefront", "focal length", "mask"])
def test_no_tensor_leaves_its_device_between_pupil_and_image(between, name):
    values = {"focal length": 0.6e-3, "mask": np.full((6, 6), 0.8)}.get(name, 2e-8 * np.tri(6))
    given = torch.tensor(values, requires_grad=True)
    made = {
        "height": lambda: pupil(given),
        "wavefront": lambda: optics.Pupil(
            40e-6, wavefront=optics.WavefrontMap(given, 40e-6), thin_lens_focal_length=0.6e-3
        ),
        "focal length": lambda: optics.Pupil(40e-6, thin_lens_focal_length=given),
        "mask": lambda: optics.Pupil(40e-6, mask=optics.MaskMap(given, 40e-6), thin_lens_focal_length=0.6e-3),
    }[name]()
    found = optics.torch.psf(made, [500e-9, 600e-9], source_distance=[0.1, np.inf], sensor_distance=0.61e-3, **VIEW)
    assert between == [({}, torch.Tensor)]
    with conversions() as backward:
        found.square().sum().backward()
    assert not backward
    assert given.grad.abs().max() > 0


def test_the_number_of_conversions_does_not_grow_with_the_stack():
    """A plan needs the numbers of the inputs, and a check needs the images: once for each pupil."""
    counts = []
    for wavelengths, distances in (([500e-9], [np.inf]), ([450e-9, 500e-9, 550e-9, 600e-9], [0.1, 0.2, 0.5, np.inf])):
        heights = torch.tensor(2e-8 * np.tri(6), requires_grad=True)
        with conversions() as found:
            optics.torch.psf(pupil(heights), wavelengths, source_distance=distances, sensor_distance=0.61e-3, **VIEW)
        counts.append(sum(found.values()))
    assert counts[0] == counts[1] > 0


def test_a_round_trip_is_counted(between):
    """The counts are zero because nothing is converted, not because nothing is counted."""
    from optics.methods import window_stack

    summed = window_stack.window_field

    def there_and_back(light, *others):
        return summed(torch.from_numpy(light.detach().numpy()), *others)

    heights = torch.tensor(2e-8 * np.tri(6), requires_grad=True)
    with mock.patch.object(window_stack, "window_field", there_and_back):
        optics.torch.psf(pupil(heights), [500e-9], sensor_distance=0.61e-3, **VIEW)
    assert between[0][0]["numpy"] == 1


def test_operations_of_other_devices_agree_with_those_of_the_cpu(monkeypatch):
    rng = np.random.default_rng(0)
    matrix = csr_matrix(rng.random((7, 5)) * (rng.random((7, 5)) < 0.5))
    numbers, size = rng.normal(size=5), torch.tensor(rng.random(7))
    found = []
    for host in (True, False):
        monkeypatch.setattr(array_library, "on_host", lambda tensor, host=host: host)
        values = torch.tensor(numbers, requires_grad=True)
        waves = array_library.sparse_product(matrix, values)
        light = array_library.turned(size, waves, "float64")
        (light * 1j).real.sum().backward()
        found.append([waves.detach().numpy(), light.detach().numpy(), values.grad.numpy()])
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(found[0][1], size * np.exp(2j * np.pi * (matrix @ numbers)), rtol=1e-13)
