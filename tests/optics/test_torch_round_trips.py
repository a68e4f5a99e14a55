"""Copies between host and device in `optics.torch`, recorded on a stand-in for a GPU.

Between pupil and image, a call copies three things to the host: the numbers of its tensors, from which it plans, the
rows and columns in which it checks PSFs, and the errors that the check finds. Backward passes copy nothing.
"""

from unittest import mock

import numpy as np
import pytest
import torch
from scipy.sparse import csr_matrix

import optics.torch
from optics.methods import window_check, window_stack
from optics.numerics import array_library
from tests.optics.stand_in_device import DEVICE, DeviceTensor, stand_in

VIEW = {"dx": 1e-6, "shape": (17, 17), "tolerance": 1e-2}
PER_PSF = 20  # rows and columns of a check


def lens(**parts):
    return optics.Pupil(**{"aperture_radius": 40e-6, "thin_lens_focal_length": 0.6e-3, **parts})


HEIGHTS, MASK = 2e-8 * np.tri(6), 0.8 - 0.02 * np.tri(6)
# Each input that may require a gradient -> its value, and a pupil with it.
INPUTS = {
    "height map": (HEIGHTS, lambda v: lens(height=v)),
    "control points": (HEIGHTS[:4, :4], lambda v: lens(height=optics.BSplineRelief(v))),
    "pixels": (HEIGHTS, lambda v: lens(height=optics.PixelRelief(v))),
    "wavefront map": (HEIGHTS, lambda v: lens(wavefront=optics.WavefrontMap(v, 40e-6))),
    "vector of Zernike": (np.array([0, 0, 0, 0.02, 0.05, 0.01, 0.03]), lambda v: lens(wavefront=optics.Zernike(v))),
    "mode of Zernike": (0.05, lambda v: lens(wavefront=optics.Zernike({(2, 0): v, (3, 1): 0.05}))),
    "focal length": (0.6e-3, lambda v: lens(thin_lens_focal_length=v)),
    "index": (1.5, lambda v: lens(height=HEIGHTS, n=v)),
    "mask": (MASK, lambda v: lens(mask=optics.MaskMap(v, 40e-6))),
    "waist": (30e-6, lambda v: lens(mask=optics.GaussianMask(v))),
}
FAST = {"height map", "vector of Zernike", "mask", "index"}
CHOSEN = [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in INPUTS]


def asking(value):
    """Return a tensor on the device that requires a gradient."""
    return torch.tensor(value, dtype=torch.float64).to(DEVICE).requires_grad_()


def psf(pupil, waves=(500e-9, 600e-9), source=(0.1, np.inf), **view):
    return optics.torch.psf(pupil, waves, source_distance=source, **{"sensor_distance": 0.61e-3, **VIEW, **view})


def on_host(tensor):
    return tensor.detach().cpu().double().numpy()


@pytest.mark.parametrize("name", CHOSEN)
def test_only_inputs_places_and_errors_are_copied_to_the_host(name):
    value, make = INPUTS[name]
    here = torch.tensor(value, dtype=torch.float64, requires_grad=True)
    expected = psf(make(here))
    expected.square().sum().backward()
    with stand_in() as copies:
        given = asking(value)
        pupil = make(given)
        copies.to_host.clear()
        found = psf(pupil)
        assert copies.to_host == [np.size(value), 4 * PER_PSF, 4]
        copies.to_host.clear()
        found.square().sum().backward()
        assert copies.to_host == []
        assert isinstance(found, DeviceTensor)
        assert isinstance(given.grad, DeviceTensor)
        images, slopes = on_host(found), on_host(given.grad)
    np.testing.assert_allclose(images, on_host(expected), rtol=1e-4, atol=1e-5 * on_host(expected).max())
    largest = float(here.grad.abs().max())
    np.testing.assert_allclose(slopes, here.grad.numpy(), rtol=1e-5, atol=1e-5 * largest)
    assert largest > 0


@pytest.mark.parametrize("source", [0.1, np.geomspace(0.1, 1, 6)], ids=["one", "six"])
def test_the_number_of_copies_does_not_grow_with_the_stack(source):
    with stand_in() as copies:
        pupil = lens(height=asking(HEIGHTS))
        copies.to_host.clear()
        psf(pupil, [500e-9] * np.size(source), source)
        assert len(copies.to_host) == 3


def test_tensors_are_copied_together():
    with stand_in() as copies:
        parts = {"height": asking(HEIGHTS), "thin_lens_focal_length": asking(0.6e-3), "n": asking(1.5)}
        pupil, sources, angle = lens(**parts), asking([0.1, 0.2]), asking([0.01, 0.0])
        copies.to_host.clear()
        found = psf(pupil, source=sources, source_angle=angle)
        assert copies.to_host == [2, 2, 36 + 1 + 1, 4 * PER_PSF, 4]
        found.sum().backward()
        assert all(isinstance(part.grad, DeviceTensor) for part in (*parts.values(), sources, angle))


def test_distances_and_angles_have_the_gradients_of_the_processor():
    found = []
    for make in (lambda v: torch.tensor(v, dtype=torch.float64, requires_grad=True), asking):
        with stand_in():
            given = make([0.1, 0.2]), make([0.01, 0.0]), make(0.61e-3)
            images = psf(lens(), source=given[0], source_angle=given[1], sensor_distance=given[2])
            images.square().sum().backward()
            found.append([on_host(images), *(on_host(one.grad) for one in given)])
    for here, there in zip(*found, strict=True):
        np.testing.assert_allclose(there, here, rtol=1e-4, atol=1e-5 * np.abs(here).max())


def test_a_number_on_the_processor_may_accompany_tensors_of_the_device():
    with stand_in():
        focal = torch.tensor(0.6e-3, dtype=torch.float64, requires_grad=True)
        heights = asking(HEIGHTS)
        found = psf(lens(height=heights, thin_lens_focal_length=focal))
        found.square().sum().backward()
        assert isinstance(found, DeviceTensor)
        assert isinstance(heights.grad, DeviceTensor)
        assert not isinstance(focal.grad, DeviceTensor)


def test_pupils_without_gradients_are_computed_on_the_requested_device():
    expected = psf(lens(height=HEIGHTS))
    with stand_in() as copies:
        found = psf(lens(height=HEIGHTS), device=DEVICE)
        assert copies.to_host == [4 * PER_PSF, 4]
        np.testing.assert_allclose(on_host(found), expected.numpy(), rtol=1e-4, atol=1e-5 * on_host(expected).max())


def test_nothing_is_recorded_for_gradients_without_them():
    with stand_in() as copies:
        pupil = lens(height=asking(HEIGHTS))
        copies.to_host.clear()
        with torch.no_grad():
            found = psf(pupil)
        assert copies.to_host == [36, 4 * PER_PSF, 4]
        assert isinstance(found, DeviceTensor)
        assert not found.requires_grad


def test_means_over_pixels_stay_on_the_device():
    expected = psf(lens(height=HEIGHTS), pixel_means=True)
    with stand_in() as copies:
        pupil = lens(height=asking(HEIGHTS))
        copies.to_host.clear()
        found = psf(pupil, pixel_means=True)
        assert copies.to_host == [36, 4 * PER_PSF, 4]
        np.testing.assert_allclose(on_host(found), expected.numpy(), rtol=1e-4, atol=1e-5 * on_host(expected).max())


def test_other_methods_compute_on_the_processor_and_return_to_the_device():
    """PyTorch cannot compute derivatives with respect to the radius: Dr.Jit does, from copies of the tensors."""
    with stand_in() as copies:
        radius, heights = asking(40e-6), asking(HEIGHTS)
        found = psf([lens(aperture_radius=radius), lens(height=heights)], [500e-9], np.inf)
        found.square().sum().backward()
        assert isinstance(found, DeviceTensor)
        assert isinstance(radius.grad, DeviceTensor)
        assert max(copies.to_host) == 17 * 17
    assert found.shape == (2, 1, 17, 17)


def test_an_array_left_on_the_host_is_an_error():
    with stand_in(), mock.patch.object(window_check, "beside", lambda x, values: torch.from_numpy(values)):
        pupil = lens(height=asking(HEIGHTS))
        with pytest.raises(RuntimeError, match="same device"):
            psf(pupil)


def test_a_round_trip_is_recorded():
    summed = window_stack.window_field

    def there_and_back(light, *others):
        return summed(light.cpu().to(light.device), *others)

    with stand_in() as copies, mock.patch.object(window_stack, "window_field", there_and_back):
        pupil = lens(height=asking(HEIGHTS))
        copies.to_host.clear()
        psf(pupil)
    assert len(copies.to_host) == 3 + 2  # one for each wavelength


def test_operations_of_other_devices_agree_with_those_of_the_cpu():
    rng = np.random.default_rng(0)
    matrix = csr_matrix(rng.random((7, 5)) * (rng.random((7, 5)) < 0.5))
    numbers, sizes = rng.normal(size=5), rng.random(7)
    found = []
    for place in ("cpu", DEVICE):
        with stand_in():
            values = torch.tensor(numbers).to(place).requires_grad_()
            size = torch.tensor(sizes).to(place)
            waves = array_library.sparse_product(matrix, values)
            light = array_library.turned(size, waves, "float64")
            (light * 1j).real.sum().backward()
            found.append([on_host(waves), light.detach().cpu().numpy(), on_host(values.grad)])
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(found[0][1], sizes * np.exp(2j * np.pi * (matrix @ numbers)), rtol=1e-13)
