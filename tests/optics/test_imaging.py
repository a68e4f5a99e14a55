"""Convolution and receptor averages, against loops."""

import numpy as np
import pytest

from optics.imaging import blur, receptor_average


@pytest.mark.parametrize("shape", [(3, 5), (9, 7), (25, 3)])
def test_blur_is_a_convolution_with_darkness_around(shape):
    rng = np.random.default_rng(0)
    scene, kernel = rng.random((2, 12, 11)), rng.random((2, *shape))
    expected = np.zeros_like(scene)
    cy, cx = shape[0] // 2, shape[1] // 2
    for b, y, x, i, j in np.ndindex(*scene.shape, *shape):
        if 0 <= y - (i - cy) < 12 and 0 <= x - (j - cx) < 11:
            expected[b, y, x] += kernel[b, i, j] * scene[b, y - (i - cy), x - (j - cx)]
    np.testing.assert_allclose(blur(scene, kernel), expected, rtol=1e-5)


def test_a_point_shows_the_kernel():
    kernel = np.random.default_rng(0).random((1, 5, 5))
    scene = np.zeros((1, 11, 11))
    scene[0, 5, 5] = 1
    np.testing.assert_allclose(blur(scene, kernel)[0, 3:8, 3:8], kernel[0], rtol=1e-5)


def test_receptors_average_their_own_cells():
    image = np.arange(2 * 10 * 12, dtype=float).reshape(2, 10, 12)
    average = receptor_average(image, (4, 5), 2)  # margins of one cell
    assert average.shape == (2, 4, 5)
    assert average[1, 2, 3] == image[1, 5:7, 7:9].mean()


@pytest.mark.parametrize("size", [(9, 12), (10, 11), (6, 12)])
def test_receptors_must_be_centred(size):
    with pytest.raises(ValueError, match="centred on the axis"):
        receptor_average(np.zeros((1, *size)), (4, 5), 2)
