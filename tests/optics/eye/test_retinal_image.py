"""Convolution and receptor averages, against loops."""

import numpy as np
import pytest

from optics.eye.retinal_image import blur, centred, receptor_average, with_centre
from optics.numerics.precision import precision


def blurred(scene, kernel, shape=None):
    return blur([scene], [kernel], shape or scene.shape[1:], precision("float64")).numpy()


def averaged(image, samples):
    types = precision("float64")
    return receptor_average(types.Tensor(image), samples, types).numpy()


@pytest.mark.parametrize("shape", [(3, 5), (9, 7), (25, 3)])
def test_blur_is_a_convolution_with_darkness_around(shape):
    rng = np.random.default_rng(0)
    scene, kernel = rng.random((2, 12, 11)), rng.random((2, *shape))
    expected = np.zeros_like(scene)
    cy, cx = shape[0] // 2, shape[1] // 2
    for b, y, x, i, j in np.ndindex(*scene.shape, *shape):
        if 0 <= y - (i - cy) < 12 and 0 <= x - (j - cx) < 11:
            expected[b, y, x] += kernel[b, i, j] * scene[b, y - (i - cy), x - (j - cx)]
    np.testing.assert_allclose(blurred(scene, kernel), expected, rtol=1e-12, atol=1e-12)


def test_a_point_shows_the_kernel():
    kernel = np.random.default_rng(0).random((1, 5, 5))
    scene = np.zeros((1, 11, 11))
    scene[0, 5, 5] = 1
    np.testing.assert_allclose(blurred(scene, kernel)[0, 3:8, 3:8], kernel[0], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("shape", [(2, 1), (4, 5), (12, 11)])
@pytest.mark.parametrize("size", [(3, 5), (25, 41)])
def test_only_what_is_seen_is_computed(shape, size):
    """Scene and kernel are cut to the parts that contribute to the middle of the image. No light wraps around into
    it.
    """
    rng = np.random.default_rng(1)
    scene, kernel = rng.random((1, shape[0] + 8, shape[1] + 6)), rng.random((1, *size))
    whole = blurred(scene, kernel)
    np.testing.assert_allclose(blurred(scene, kernel, shape), whole[:, 4:-4, 3:-3], rtol=1e-12)


def test_scenes_with_kernels_of_their_own_add_up():
    rng = np.random.default_rng(2)
    scenes, kernels = rng.random((2, 3, 8, 9)), [rng.random((3, 5, 5)), rng.random((3, 7, 7))]
    together = blur(list(scenes), kernels, (8, 9), precision("float64")).numpy()
    apart = sum(blurred(scene, kernel) for scene, kernel in zip(scenes, kernels, strict=True))
    np.testing.assert_allclose(together, apart, rtol=1e-12)


def test_receptors_average_their_own_cells():
    image = np.arange(2 * 8 * 10, dtype=float).reshape(2, 8, 10)
    average = averaged(image, 2)
    assert average.shape == (2, 4, 5)
    assert average[1, 2, 3] == pytest.approx(image[1, 4:6, 6:8].mean())


@pytest.mark.parametrize("size", [(9, 12), (10, 11), (6, 12)])
def test_receptors_must_be_centred(size):
    with pytest.raises(ValueError, match="centred on the axis"):
        centred(np.zeros((1, *size)), (8, 10))


@pytest.mark.parametrize("size", [(5, 4), (4, 5), (4, 6), (5, 3)])
def test_each_even_side_of_a_kernel_is_extended(size):
    """Receptors that are not square can have kernels with an even number of cells along only one side."""
    kernel = np.random.default_rng(3).random((2, *size))
    odd = with_centre(precision("float64").Tensor(kernel)).numpy()
    assert odd.shape == (2, *(side + 1 - side % 2 for side in size))
    np.testing.assert_array_equal(odd[:, -size[0] :, -size[1] :], kernel)
    assert odd.sum() == pytest.approx(kernel.sum())
