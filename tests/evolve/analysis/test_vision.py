"""Signals of eyes compared with a perfect lens: measures by their definitions, and lower values for worse eyes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from evolve.analysis.vision import ssim, vision
from evolve.config.assemble import assemble
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from optics.numerics import backend

FOCUS = ["genome.doe_11.start=0.931"]  # the preset starts out of focus
CONFIG = assemble("detection", "quick", assignments=FOCUS)


@pytest.fixture(scope="module")
def eye():
    backend.require()
    return develop(Genotype(CONFIG.genome).start, CONFIG)


def test_ssim_by_its_equation():
    """The case is one window over the whole image (Wang et al. 2004, eq. 13)."""
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 1, 7, 7))
    (mu, nu), cov = (a.mean(), b.mean()), np.cov(a.ravel(), b.ravel())
    c1, c2 = 0.01**2, 0.03**2
    expected = (2 * mu * nu + c1) * (2 * cov[0, 1] + c2)
    expected /= (mu**2 + nu**2 + c1) * (cov[0, 0] + cov[1, 1] + c2)
    assert ssim(a, b) == pytest.approx(expected)
    assert ssim(a, a) == pytest.approx(1.0)


def test_ssim_as_scikit_image_computes_it():
    rng = np.random.default_rng(1)
    for shape in ((2, 3, 7, 9), (4, 5, 6), (12, 15)):
        a, b = rng.random((2, *shape)).astype(np.float32)
        window = 5 if 5 in shape else 7
        pairs = zip(a.reshape(-1, *shape[-2:]), b.reshape(-1, *shape[-2:]), strict=True)
        expected = [
            structural_similarity(x.astype(float), y.astype(float), win_size=window, data_range=1) for x, y in pairs
        ]
        assert ssim(a, b) == pytest.approx(np.mean(expected), rel=1e-12)


def test_ssim_of_a_line_of_receptors_is_no_number():
    assert math.isnan(ssim(np.zeros((3, 2, 8)), np.zeros((3, 2, 8))))
    assert ssim(np.zeros((3, 4, 5)), np.zeros((3, 4, 5))) == 1.0, "a window of 3 for a side of 4"


def test_perfect_lens_sees_itself(eye):
    perfect = replace(eye, relative_aperture=None, relief=None, refractive_index=None)
    seen = vision(perfect, CONFIG)
    assert (seen.image_quality, seen.contrast, seen.psnr_db) == (1 - CONFIG.eye.noise_sigma, 1.0, math.inf)
    assert seen.ssim == pytest.approx(1.0)


def test_defocus_is_seen_by_every_measure(eye):
    sharp = vision(eye, CONFIG)
    blurred = vision(replace(eye, relief=(0.5,) * 16), CONFIG)
    assert sharp.image_quality > blurred.image_quality
    assert sharp.contrast > blurred.contrast + 0.1
    assert sharp.psnr_db > blurred.psnr_db + 3
    assert sharp.ssim > blurred.ssim + 0.1


@pytest.mark.slow
def test_scenes_are_always_the_same(eye):
    assert vision(eye, CONFIG) == vision(eye, CONFIG)
