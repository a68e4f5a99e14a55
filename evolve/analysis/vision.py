"""Image quality and contrast of an animal's eyes, and comparison of their images with a perfect lens's images."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import optics
import sim
from evolve.analysis.statistics import eye_image_quality, polychromatic, psnr
from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from sim.envs.prepared_task import PreparedTask
from sim.tasks.simulation import Simulation

__all__ = ["Vision", "ssim", "vision"]

SCENES = 16  # starts of episodes, the same for all eyes
RAYS = 16  # per receptor
WINDOW = 7  # width of the structural similarity's window, in receptors
Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Vision:
    """Four measures of an eye; NaN for a measure that is undefined.

    image_quality: area of the MTF above the noise, times throughput, in [0, 1]: `optics.image_quality`
    contrast: MTF in white daylight at half the receptors' Nyquist frequency
    psnr_db: peak signal-to-noise ratio of the image, scaled to the brightness of a perfect lens's image, to that image
    ssim: structural similarity of the same images, in [-1, 1]; NaN for retinas narrower than three receptors
    """

    image_quality: float
    contrast: float
    psnr_db: float
    ssim: float


def vision(animal: Phenotype, config: RunConfig) -> Vision:
    """Return the measures of an animal's eyes in the run's task; all NaN if their optics cannot be computed."""
    eyes = animal.eyes(config.eye)
    try:
        quality, contrast = eye_image_quality(animal, config.eye), _contrast(eyes.eye())
        seen, perfect = seen_and_perfect(animal, config)
    except optics.AccuracyError:
        return Vision(math.nan, math.nan, math.nan, math.nan)
    gain = 1 / float(eyes.eye().white_signal)
    return Vision(quality, contrast, psnr(seen, perfect, gain), ssim(gain * seen, perfect))


def seen_and_perfect(animal: Phenotype, config: RunConfig) -> tuple[Floats, Floats]:
    """Return the signals of an animal's eyes without noise, with its own optics and behind a perfect lens.

    Both are (scene, eye, channel, height, width). The scenes are the same for all eyes of a task.
    """
    eyes, task = animal.eyes(config.eye), animal_task(animal, config)
    if (light := task.compared_light) is None:
        fidelity = replace(PreparedTask(task).fidelity, rays_per_receptor=RAYS)
    else:
        fidelity = sim.Fidelity(RAYS, eyes.bands, light=light)
    perfect = animal_task(animal, config, eyes=replace(eyes, optics=None, waveguide=None, pupil_turned=False))
    with closing(Simulation(task, SCENES, 0)) as worlds:
        worlds.reset()
        poses = worlds.poses()
        seen, sharp = (PreparedTask(each, fidelity).renderer(worlds).signals(poses) for each in (task, perfect))
    return np.asarray(seen), np.asarray(sharp)


def ssim(signals: Floats, reference: Floats) -> float:
    """Return the mean structural similarity (Wang et al. 2004, by scikit-image) of images (…, height, width).

    Values range from 0 to 1.
    The window is 7 receptors wide, or the width of a narrower retina. The result is NaN below 3 receptors.
    """
    from skimage.metrics import structural_similarity

    side = min(WINDOW, *signals.shape[-2:])
    window = side - (side + 1) % 2
    if window < 3:
        return math.nan
    pairs = zip(*(a.reshape(-1, *a.shape[-2:]).astype(np.float64) for a in (signals, reference)), strict=True)
    return float(np.mean([structural_similarity(a, b, win_size=window, data_range=1.0) for a, b in pairs]))


def _contrast(eye: optics.Eye) -> float:
    """Return the MTF at half the Nyquist frequency; 1 behind a perfect lens."""
    if eye.pupil is None:
        return 1.0
    white = polychromatic(eye, eye.psf())
    return float(optics.mtf(white).profile(np.array([1 / (4 * eye.receptor_pitch)]))[0, 0])
