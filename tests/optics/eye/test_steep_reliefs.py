"""Kernels of eyes whose relief sends much of its light past the retina."""

from dataclasses import replace

import numpy as np
import pytest

from optics import AccuracyError, Eye, GaussianMask, Pupil


@pytest.fixture(scope="module")
def eye() -> Eye:
    """An eye with a relief whose slopes exceed those of grazing light tenfold."""
    heights = 100e-6 * np.random.default_rng(0).random((8, 8))
    return Eye(Pupil(8e-6, height=heights), (3, 4), 60.0, sensor_width=60e-6, bands=1)


def test_kernel_contains_the_light_within_a_retina_of_the_image(eye):
    """A finer calculation, with other samples of the pupil, finds the same kernel."""
    kernel = eye.kernel(4)
    side = max(eye.resolution) * 4
    assert all(side <= cells // 2 <= side + 1 for cells in kernel.shape[1:])
    assert 1e-4 < kernel.sum() < 0.5
    finer = replace(eye, tolerance=1e-3).kernel(4)
    assert np.linalg.norm(finer - kernel) < eye.tolerance * np.linalg.norm(finer)


def test_psf_covers_the_same_window(eye):
    result = eye.psf()
    assert result.plans[0].method == "angular_spectrum"
    assert result.power[0] == pytest.approx(eye.kernel(4).sum(), rel=0.02)


def test_steep_reliefs_behind_masks_are_refused(eye):
    with pytest.raises(AccuracyError, match="most_seconds"):
        replace(eye, pupil=replace(eye.pupil, mask=GaussianMask(10e-6))).kernel(4)
