"""Derivatives of an eye's signals, forward and backward, against central differences."""

import math

import numpy as np
import pytest

from optics import BSplineRelief, Eye, Pupil, image_quality

S, STEP = 2, 2e-3
RELIEF = np.random.default_rng(4).random((4, 4)) * 8e-6
# Parameters by name, each in units of a typical size: derivatives are per unit.
START = {"radius": 1.0, "relief": 1.0, "n": 1.0, "z": 1.0, "fov": 1.0}


def types():
    from optics.numerics.precision import precision

    return precision("float64")


def eye_of(radius, relief, n, fov):
    """Return an eye. Control point i of its relief is multiplied by 1 + (relief - 1) (1 + (i mod 3))."""
    pattern = 1 + np.arange(16) % 3
    if isinstance(relief, float):
        points = RELIEF * (1 + (relief - 1) * pattern.reshape(4, 4))
    else:
        points = types().Tensor64(
            types().Float64(RELIEF.ravel()) * (1 + (relief - 1) * types().Float64(pattern)), (4, 4)
        )
    pupil = Pupil(radius * 15e-6, BSplineRelief(points), n=n * 1.5, thin_lens_focal_length=250e-6)
    return Eye(pupil, (3, 5), fov * 45.0, bands=1, tolerance=1e-5, dtype="float64")


def seen(radius, relief, n, z, fov):
    """Return the sum of the signals of a random scene, with random weights."""
    rng = np.random.default_rng(5)
    eye = eye_of(radius, relief, n, fov)
    signal = eye.see(rng.random((1, 12, 14)), S, z=z * 2e-3)
    weights = rng.standard_normal(signal.shape)
    if isinstance(signal, np.ndarray):
        return float(np.sum(weights * signal))
    import drjit as dr

    return dr.sum(signal.array * types().Float64(weights.ravel()))


def difference(name):
    """Return the central difference with Richardson's extrapolation, with an error of O(STEP⁴)."""
    at = [seen(**START | {name: 1 + k * STEP}) for k in (-2, -1, 1, 2)]
    return (8 * (at[2] - at[1]) - (at[3] - at[0])) / (12 * STEP)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("name", START)
def test_see_follows_central_differences(name):
    import drjit as dr

    value = types().Float64(1.0)
    dr.enable_grad(value)
    result = seen(**START | {name: value})
    dr.forward(value, flags=dr.ADFlag.ClearInterior)
    forward = dr.grad(result)[0]
    dr.set_grad(value, 0)
    dr.backward(seen(**START | {name: value}))
    backward = dr.grad(value)[0]
    expected = difference(name)
    assert abs(expected) > 1e-4
    # Another fov moves the PSF's samples, too: the differences contain the error of the splines between them.
    assert forward == pytest.approx(expected, rel=5e-4 if name == "fov" else 1e-4)
    assert backward == pytest.approx(forward, rel=1e-9)


@pytest.mark.slow
def test_kernel_follows_central_differences():
    """The derivative of every cell of the kernel by the object's distance agrees."""
    import drjit as dr

    z = types().Float64(2e-3)
    dr.enable_grad(z)
    eye = eye_of(1.0, 1.0, 1.0, 1.0)
    kernel = eye.kernel(S, z)
    assert kernel.shape == eye.kernel(S, 2e-3).shape
    dr.forward(z)
    found = dr.grad(kernel).numpy()
    at = [eye.kernel(S, 2e-3 * (1 + k * STEP)) for k in (-2, -1, 1, 2)]
    expected = (8 * (at[2] - at[1]) - (at[3] - at[0])) / (12 * STEP * 2e-3)
    assert np.linalg.norm(found - expected) < 1e-4 * np.linalg.norm(expected)


@pytest.mark.slow
def test_image_quality_follows_the_aperture_through_the_throughput():
    """A wider pupil is brighter at a fixed noise floor: the derivative of quality includes that of a²."""
    import drjit as dr

    def quality(radius):
        eye = eye_of(radius, 1.0, 1.0, 1.0)
        return image_quality(eye.psf(), 1 / (2 * eye.receptor_pitch), eye.throughput, 1e-3)

    radius = types().Float64(1.0)
    dr.enable_grad(radius)
    result = quality(radius)
    dr.forward(radius)
    expected = (quality(1 + STEP) - quality(1 - STEP)) / (2 * STEP)
    # The window follows the radius, and so do the frequencies between which the MTF is interpolated: 3e-3. Without the
    # throughput's part, 2 quality / radius, the derivative would be less than half as large.
    found = dr.grad(result).numpy()
    np.testing.assert_allclose(found, expected, rtol=6e-3)
    assert (2 * quality(1.0) > found / 2).all()


def test_noise_carries_no_derivative_and_is_the_same():
    import drjit as dr

    radius = types().Float64(15e-6)
    dr.enable_grad(radius)
    scene = np.random.default_rng(1).random((4, 30, 30))
    differentiable, plain = (
        Eye(Pupil(r, thin_lens_focal_length=240e-6)).see(scene, S, np.random.default_rng(2)) for r in (radius, 15e-6)
    )
    np.testing.assert_allclose(differentiable.numpy(), plain, atol=1e-6)
    quiet = Eye(Pupil(radius, thin_lens_focal_length=240e-6)).see(scene, S)
    dr.forward(radius, flags=dr.ADFlag.ClearInterior)
    np.testing.assert_allclose(dr.grad(differentiable).numpy(), dr.grad(quiet).numpy(), rtol=1e-5)


def test_a_plain_eye_gives_arrays():
    eye = eye_of(1.0, 1.0, 1.0, 1.0)
    assert isinstance(eye.kernel(S), np.ndarray)
    assert isinstance(eye.see(np.zeros((1, 6, 10)), S), np.ndarray)
    assert isinstance(eye.throughput, float)
    assert math.isclose(eye.throughput, 0.15**2)


def test_off_the_axis_the_field_of_view_carries_no_derivatives():
    import drjit as dr

    fov = types().Float64(40.0)
    dr.enable_grad(fov)
    with pytest.raises(ValueError, match=r"fov_deg is a Dr\.Jit array: must be a number off the axis"):
        Eye(Pupil(20e-6), (5, 5), fov_deg=fov).kernel(S, direction_deg=(5.0, 0.0))
