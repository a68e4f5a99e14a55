"""Measures of an eye in white daylight. Bands are weighted by the mean sensitivity of the eye's channels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

import optics
from evolve.config.run_config import EyeConfig
from evolve.genome.phenotype import Phenotype
from optics.eye.summary import daylight_psf, noise_of

__all__ = ["WhiteLight", "eye_image_quality", "white_strehl"]


@dataclass(frozen=True)
class WhiteLight:
    """An eye, its PSF in each band (`psf`) and in white daylight (`white`), its MTF, image quality and contrast.

    Raises:
        optics.AccuracyError: the PSF or a measure cannot be computed accurately enough. `from_eye` computes the PSF.
            The MTF and the measures are computed when they are first read.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """

    eye: optics.Eye
    psf: optics.PSFResult
    white: optics.PSFResult

    @classmethod
    def from_eye(cls, eye: optics.Eye) -> WhiteLight:
        psf = eye.psf()
        return cls(eye, psf, daylight_psf(eye, psf))

    @property
    def per_degree(self) -> float:
        """Distance on the retina per degree near the axis [m]."""
        return self.eye.sensor_distance * np.pi / 180

    @property
    def nyquist(self) -> float:
        """Nyquist frequency of the receptors [1/m]."""
        return 1 / (2 * self.eye.receptor_pitch)

    @cached_property
    def mtf(self) -> optics.MTF:
        return optics.mtf(self.white)

    @cached_property
    def image_quality(self) -> float:
        """`optics.image_quality` up to the Nyquist frequency of the receptors, in [0, 1]."""
        light = self.eye.white_signal
        return float(optics.image_quality(self.mtf, self.nyquist, light, noise_of(self.eye, light))[0])

    @cached_property
    def contrast(self) -> float:
        """MTF at half the Nyquist frequency of the receptors."""
        return float(self.mtf.profile(np.array([self.nyquist / 2]))[0, 0])


def white_strehl(eye: optics.Eye, psf: optics.PSFResult) -> float:
    """Return the Strehl ratio in white daylight; NaN if the PSF's maximum is inaccurate or lies outside the window.

    The reference is the PSF of the same aperture in white daylight, without aberrations at any wavelength. Maxima of
    such PSFs are proportional to 1/λ², so the maximum of the reference exceeds that of a PSF at the mean wavelength.

    psf: PSF of the eye in each band
    """
    try:
        return float(optics.strehl_ratio(daylight_psf(eye, psf))[0])
    except optics.AccuracyError:
        return math.nan


def eye_image_quality(phenotype: Phenotype, config: EyeConfig, medium: str = "air") -> float:
    """Return `optics.image_quality` of the phenotype's camera eye in white daylight, in [0, 1].

    The quality is averaged over frequencies up to the Nyquist frequency of the receptors. A perfect lens has contrast 1
    at all frequencies.

    medium: medium of the run's worlds: "air", "clear_ocean", "coastal_water" or "fog"

    Raises:
        optics.AccuracyError: the PSF cannot be computed accurately enough.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    eye = phenotype.eye(config, medium)
    assert isinstance(eye, optics.Eye)
    if eye.pupil is None:
        return max(1 - noise_of(eye, eye.white_signal), 0.0)
    return WhiteLight.from_eye(eye).image_quality
