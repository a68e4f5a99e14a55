"""Figure of an animal's eyes: fields of view, relief of the pupil, and PSF."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle, Wedge

import optics
from evolve.analysis.white_light import WhiteLight
from evolve.config.run_config import EyeConfig
from evolve.genome.phenotype import Phenotype
from evolve.report.eye_figures import DECADES, middle_of_psf, relief_heights
from evolve.report.facet_figures import white_acceptance
from sim.eyes.compound_eye import CompoundEye

__all__ = ["eye_picture"]


def eye_picture(phenotype: Phenotype, config: EyeConfig, medium: str = "air") -> Figure:
    """Draw the fields of view around the head, the relief of the pupil [µm], and the PSF in white daylight.

    The PSF is drawn on a logarithmic scale, with the outline of a receptor. For a perfect lens, only the fields of view
    are drawn. For compound eyes, the acceptance function is drawn instead of relief and PSF.

    phenotype: animal whose eyes are drawn
    config: settings of the eyes in the animal's run
    medium: medium of the run's worlds: "air", "clear_ocean", "coastal_water" or "fog"

    Raises:
        optics.AccuracyError: the PSF cannot be computed accurately enough.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    eye = phenotype.eye(config, medium)
    count = 2 if isinstance(eye, CompoundEye) else 1 if eye.pupil is None else 3
    figure, panels = pyplot.subplots(1, count, squeeze=False, layout="constrained")
    figure.set_size_inches(3.6 * panels.size, 3.4)
    _head(panels[0, 0], phenotype, config)
    if isinstance(eye, CompoundEye):
        _acceptance(panels[0, 1], eye)
    elif eye.pupil is not None:
        _relief(panels[0, 1], eye.pupil)
        _psf(panels[0, 2], eye)
    return figure


def _head(axes: Axes, phenotype: Phenotype, config: EyeConfig) -> None:
    """Draw the fields of view, seen from above. The animal's heading points upwards."""
    half = phenotype.fov_deg / 2
    for azimuth in np.degrees(phenotype.eyes(config).azimuths()):
        towards = 90 + azimuth
        axes.add_patch(Wedge((0, 0), 3, towards - half, towards + half, alpha=0.25))
        place = np.array([np.cos(np.radians(towards)), np.sin(np.radians(towards))])
        axes.add_patch(Circle(tuple(place), 0.18, color="0.1"))
    axes.add_patch(Circle((0, 0), 1, fc="0.85", ec="0.3"))
    axes.set(xlim=(-3.1, 3.1), ylim=(-3.1, 3.1), aspect="equal", xticks=[], yticks=[])
    axes.set_title(f"{phenotype.n_eyes} eyes of {phenotype.fov_deg:.0f}°, from above")


def _acceptance(axes: Axes, eye: CompoundEye) -> None:
    angles, white = white_acceptance(eye)
    edge = float(angles[-1])
    picture = axes.imshow(white, extent=(-edge, edge, -edge, edge), origin="lower", vmin=0)
    axes.set(title="acceptance function", xlabel="right [°]", ylabel="up [°]")
    _bar(axes, picture, "acceptance / maximum")


def _relief(axes: Axes, pupil: optics.Pupil) -> None:
    heights, inside = relief_heights(pupil)
    radius = 1e6 * pupil.aperture_radius
    shown = np.where(inside, 1e6 * heights, np.nan)
    picture = axes.imshow(shown, extent=(-radius, radius, -radius, radius), origin="lower")
    axes.set(title="relief of the pupil", xlabel="x [µm]", ylabel="y [µm]")
    _bar(axes, picture, "height [µm]")


def _psf(axes: Axes, eye: optics.Eye) -> None:
    light = WhiteLight.from_eye(eye)
    picture, half = middle_of_psf(light)
    peak, edge, pitch = picture.max() / 1e12, 1e6 * half, 1e6 * eye.receptor_pitch
    floor = peak * 10.0**-DECADES
    norm = LogNorm(floor, peak)
    image = axes.imshow(np.maximum(picture / 1e12, floor), extent=(-edge, edge, -edge, edge), origin="lower", norm=norm)
    axes.add_patch(Rectangle((-pitch / 2, -pitch / 2), pitch, pitch, fill=False, ec="white"))
    axes.set(title="point spread function", xlabel="x on the retina [µm]", xlim=(-edge, edge), ylim=(-edge, edge))
    _bar(axes, image, "PSF [1/µm²]")


def _bar(axes: Axes, picture: Any, label: str) -> None:
    pyplot.colorbar(picture, ax=axes, shrink=0.8, label=label)
