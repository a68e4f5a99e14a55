"""Rows and columns in which the check computes PSFs: their probabilities, and equal results of NumPy and PyTorch."""

from dataclasses import fields

import numpy as np
import pytest
import torch

from optics.methods.window_crossings import ACROSS, SHARES, WindowCrossings
from tests.optics.stand_in_device import DEVICE, stand_in

RNG = np.random.default_rng(0)
SHAPES = (3, 21, 21), (2, 15, 24), (2, 7, 7), (1, 6, 30)


def chances(image):
    """The probabilities of all rows of one image, from their definition."""
    root, bright = np.sqrt(image).sum(1), np.square(image).sum(1)
    near = np.convolve(bright, np.ones(3))[1:-1]
    near[[0, -1]] = bright[[0, -1]]
    found = np.full(len(image), SHARES[0] / len(image))
    found += SHARES[1] * root / root.sum() + SHARES[2] * near / near.sum()
    found[[0, -1]] += SHARES[3] / 2
    return found


@pytest.mark.parametrize("shape", SHAPES)
def test_the_check_compares_samples_of_the_psf(shape):
    images = RNG.random(shape)
    found = WindowCrossings.from_images(images)
    for place, image in enumerate(images):
        np.testing.assert_array_equal(found.images[place], image[np.ix_(found.rows[place], found.columns[place])])
    np.testing.assert_allclose(found.total, np.square(images).sum((1, 2)))
    assert found.rows.shape[1] == min(ACROSS, shape[1])
    assert found.columns.shape[1] == min(ACROSS, shape[2])


def test_rows_are_drawn_at_even_steps_of_their_chances():
    image = RNG.random((21, 30))
    found, chance = WindowCrossings.from_images(image[None]), chances(image)
    levels = chance.cumsum()
    steps = (np.arange(ACROSS) + 0.5) / ACROSS * levels[-1]
    np.testing.assert_array_equal(found.rows[0], np.searchsorted(levels, steps))
    across = chances(image.T)
    np.testing.assert_allclose(found.chance[0], np.outer(chance[found.rows[0]], across[found.columns[0]]))


def test_a_dark_psf_does_not_affect_others():
    images = np.stack([np.zeros((21, 21)), RNG.random((21, 21))])
    both, one = WindowCrossings.from_images(images), WindowCrossings.from_images(images[1:])
    for part in fields(WindowCrossings):
        np.testing.assert_array_equal(getattr(both, part.name)[1], getattr(one, part.name)[0])
    assert both.total[0] == 0


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_tensors_of_another_device_give_the_results_of_numpy(shape, dtype):
    images = RNG.random(shape).astype(dtype)
    images[-1] *= 0 if len(images) > 1 else 1
    expected = WindowCrossings.from_images(images)
    with stand_in() as copies:
        found = WindowCrossings.from_images(torch.from_numpy(images).to(DEVICE))
        assert copies.to_host == [expected.rows.size + expected.columns.size]
        for part in fields(WindowCrossings):
            own = getattr(found, part.name)
            own = own if isinstance(own, np.ndarray) else own.cpu().numpy()
            np.testing.assert_allclose(own, getattr(expected, part.name), rtol=1e-6)


def test_a_part_has_the_crossings_of_its_psfs():
    found = WindowCrossings.from_images(RNG.random((3, 21, 21)))
    part = found.part(slice(1, 3))
    np.testing.assert_array_equal(part.rows, found.rows[1:])
    np.testing.assert_array_equal(part.images, found.images[1:])
