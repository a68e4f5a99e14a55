"""Five stages of an eye: sharpness increases in the expected order, at a tenth of the page's size."""

import numpy as np
import pytest

import experiments.five_eyes as five
from optics.numerics import backend

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def seen():
    """Views of black and white stripes through each stage, three stripes to a retina."""
    backend.require()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"FINE": 30, "COARSE": 15, "CELLS": 30}.items():
            patch.setattr(five, name, value)
        radiance = np.zeros((4, 120, 120))
        radiance[:, :, np.arange(120) % 10 < 5] = 0.8
        views = {stage.name: five.view(stage.pupil(), radiance) for stage in five.STAGES}
        return {**views, "perfect": five.view(None, radiance)}


def test_the_perfect_lens_is_its_own_measure(seen):
    assert seen["perfect"].psnr_db == np.inf
    assert seen["perfect"].ssim == pytest.approx(1)


def test_stages_get_sharper(seen):
    order = ("open", "cup", "unfocused lens", "focused lens")
    likeness = [seen[name].ssim for name in order]
    assert likeness == sorted(likeness)
    assert seen["pinhole"].ssim > seen["cup"].ssim + 0.1
    assert seen["focused lens"].strehl > 0.9
    assert seen["unfocused lens"].strehl < 0.1


def test_a_pinhole_drowns_in_noise_and_a_lens_does_not(seen):
    """Signals divided by a² have noise of σ / a²: 0.25 of white behind the pinhole, 0.02 behind the lens."""
    noise = five.NOISE / 0.11**2
    assert seen["pinhole"].noisy_psnr_db == pytest.approx(-20 * np.log10(noise), abs=2)
    assert seen["focused lens"].noisy_psnr_db > seen["pinhole"].noisy_psnr_db + 10
