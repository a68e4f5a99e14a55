"""Image quality and contrast of an animal's eyes, and comparison of its images with those of a perfect lens."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

import optics
import sim
from evolve.analysis.statistics import psnr
from evolve.analysis.white_light import WhiteLight, eye_image_quality
from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from sim.envs.prepared_task import PreparedTask
from sim.tasks.simulation import Simulation

__all__ = ["Vision", "ssim", "vision"]

SCENES = 16  # number of scenes; they are starts of episodes, and the same for all eyes
RAYS = 16  # number of rays per receptor
WINDOW = 7  # [receptors] width of the window in which structural similarity is computed
Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Vision:
    """Four measures of an eye. A measure that is undefined is NaN.

    image_quality: area of the MTF above the noise floor, times throughput, in [0, 1]; see `optics.image_quality`
    contrast: MTF in white daylight at half the receptors' Nyquist frequency
    psnr_db: peak signal-to-noise ratio of the eye's image, relative to the image of a perfect lens [dB]. The eye's
        image is first scaled to the same brightness
    ssim: structural similarity of the same two images, in [-1, 1]; NaN if a retina has fewer than three rows or columns
        of receptors
    """

    image_quality: float
    contrast: float
    psnr_db: float
    ssim: float


UNDEFINED = Vision(math.nan, math.nan, math.nan, math.nan)


def vision(animal: Phenotype, config: RunConfig) -> Vision:
    """Return four measures of an animal's eyes: image quality, contrast, PSNR and structural similarity.

    `Vision` defines these measures. The last two compare images of scenes in the run's task. All four are NaN for
    compound eyes, and if the PSF cannot be computed accurately enough.

    Raises:
        ConfigError: the user task was not named when the run was opened, or its module cannot be executed.
        ValueError: the user task's animal cannot have these eyes; see `evolve.learning.animal_task.with_phenotype`.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    medium = config.world.medium
    eye = animal.eye(config.eye, medium)
    if not isinstance(eye, optics.Eye):
        return UNDEFINED
    try:
        if eye.pupil is None:
            quality, contrast = eye_image_quality(animal, config.eye, medium), 1.0
        else:
            light = WhiteLight.from_eye(eye)
            quality, contrast = light.image_quality, light.contrast
        seen, perfect = seen_and_perfect(animal, config)
    except optics.AccuracyError:
        return UNDEFINED
    gain = 1 / float(eye.white_signal)
    return Vision(quality, contrast, psnr(seen, perfect, gain), ssim(gain * seen, perfect))


def seen_and_perfect(animal: Phenotype, config: RunConfig) -> tuple[Floats, Floats]:
    """Return noise-free signals of an animal's eyes twice: with their own optics, and behind a perfect lens.

    Both arrays are (scene, eye, channel, height, width). The scenes are the same for all animals in a task.

    Raises:
        ConfigError: see `vision`.
        ValueError: see `vision`.
        optics.AccuracyError: the PSF cannot be computed accurately enough.
        optics.BackendError: see `vision`.
    """
    eyes, task = animal.eyes(config.eye), animal_task(animal, config)
    if (light := task.compared_light) is None:
        fidelity = replace(PreparedTask(task).fidelity, rays_per_receptor=RAYS)
    else:
        fidelity = sim.Fidelity(RAYS, eyes.bands, light=light)
    perfect = animal_task(animal, config, eyes=eyes.with_perfect_lens())
    with closing(Simulation(task, SCENES, 0)) as worlds:
        worlds.reset()
        poses = worlds.poses()
        seen, sharp = (PreparedTask(each, fidelity).renderer(worlds).signals(poses) for each in (task, perfect))
    return np.asarray(seen), np.asarray(sharp)


def ssim(signals: Floats, reference: Floats) -> float:
    """Return the mean structural similarity of images (…, height, width).

    The measure is equation 13 of Wang et al. (2004), with equal weights in a square window and sample variances.
    Signals must range from 0 to 1. The window is 7 receptors wide and high. If a retina has fewer rows or columns, the
    window's side is the largest odd number of receptors that fits. The result is NaN if this number is less than 3.

    signals, reference: images of the same shape
    """
    side = min(WINDOW, *signals.shape[-2:])
    window = side - (side + 1) % 2
    if window < 3:
        return math.nan
    x, y = signals.astype(np.float64), reference.astype(np.float64)
    sample = window**2 / (window**2 - 1)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        edge = window // 2  # windows reach beyond the image there
        means: NDArray[np.float64] = uniform_filter(values, window, axes=(-2, -1))
        return means[..., edge:-edge, edge:-edge]

    mean_x, mean_y = mean(x), mean(y)
    variances = sample * (mean(x * x) - mean_x**2 + mean(y * y) - mean_y**2)
    covariance = sample * (mean(x * y) - mean_x * mean_y)
    c1, c2 = 0.01**2, 0.03**2
    similarity = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    return float(np.mean(similarity / ((mean_x**2 + mean_y**2 + c1) * (variances + c2))))
