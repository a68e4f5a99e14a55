"""Power and blur of a relief as a lens."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

import optics
from evolve.config.run_config import EyeConfig
from evolve.genome.anatomy import retina_width
from evolve.genome.phenotype import Phenotype
from evolve.report.eye_figures import relief_heights
from optics.eye.geometry import focal_length

__all__ = ["blur", "paraboloid", "power", "relief_of"]


def power(animal: Phenotype, config: EyeConfig) -> float:
    """Return the power of an eye's glass relative to the power that focuses distant objects on its retina.

    1 is in focus, 0 means no lens, and a negative power diverges light. The power of a perfect lens is NaN.

    A relief has the power of the paraboloid nearest to it over the pupil's disk (least squares: Zernike defocus). If
    the optical path falls by d from the centre to the rim at the radius R, the power is P = 2 d / R² (paraxial;
    Goodman, Introduction to Fourier Optics, §5.1). The retina of width L is at f = L / (2 tan(fov/2)), so that P f = d
    / (a² L tan(fov/2) / 4) with the relative aperture a = 2R / L.
    """
    if animal.relief is None or animal.relative_aperture is None or animal.refractive_index is None:
        return math.nan
    heights = np.array(animal.relief)
    fall = float(_fall(math.isqrt(heights.size)) @ (heights - heights[0]))  # exactly 0 for flat glass
    way = (animal.refractive_index - 1) * config.relief_height * fall + 0.0  # no -0
    width = retina_width(animal.resolution[1], config)
    return 4 * way / (animal.relative_aperture**2 * width * math.tan(math.radians(animal.fov_deg) / 2))


def blur(animal: Phenotype, config: EyeConfig) -> float:
    """Return the blur of a distant point in receptors: the root mean square distance of rays from their centroid.

    A ray through the pupil at r reaches the retina at r + f (n - 1) grad h (paraxial; Goodman, §5.1), where f is the
    distance from pupil to retina, n the refractive index, and h the relief's height. Diffraction is ignored. Without
    glass, the result is the blur of the pinhole. For a perfect lens, it is NaN.
    """
    if animal.relief is None or animal.relative_aperture is None or animal.refractive_index is None:
        return math.nan
    heights, width = np.array(animal.relief), retina_width(animal.resolution[1], config)
    radius, places, slopes = animal.relative_aperture * width / 2, *_slopes(math.isqrt(heights.size))
    bend = (animal.refractive_index - 1) * config.relief_height / radius
    landed = radius * places + focal_length(width, animal.fov_deg) * bend * np.tensordot(heights, slopes, 1)
    spread = ((landed - landed.mean(axis=0)) ** 2).sum(axis=1).mean()
    return math.sqrt(spread) * animal.resolution[1] / width


def paraboloid(
    power: float, relative_aperture: float, fov_deg: float, index: float, eye: EyeConfig
) -> tuple[float, ...]:
    """Return the sixteen heights in [0, 1] of a paraboloid of glass with this power; the lowest height is 0.

    Raises:
        ValueError: the glass exceeds the maximum height of reliefs.
    """
    radius = relative_aperture * eye.sensor_width / 2
    curvature = power / ((index - 1) * focal_length(eye.sensor_width, fov_deg))
    points = optics.BSplineRelief.paraboloid(0.0, curvature, radius).control_points
    heights = (np.array(points) - np.min(points)) / eye.relief_height
    if heights.max() > 1:
        raise ValueError(
            f"glass of power {power:g} behind a = {relative_aperture:g} is {heights.max():.2f} of the height"
        )
    return tuple(heights.ravel().tolist())


def relief_of(heights: NDArray[np.float64]) -> optics.BSplineRelief | NDArray[np.float64]:
    """Return a pupil's relief from N² heights: a bicubic patch for 4 x 4 heights, otherwise an array of heights."""
    side = math.isqrt(heights.size)
    return optics.BSplineRelief(heights.reshape(side, side)) if side == 4 else heights.reshape(side, side)


@cache
def _fall(side: int) -> NDArray[np.float64]:
    """Return the fall of the nearest paraboloid from centre to rim, per unit of each height of a relief.

    A relief is linear in its heights, so that their contributions add up.
    """
    reliefs = [relief_heights(optics.Pupil(1.0, relief_of(gene))) for gene in np.eye(side * side)]
    inside = reliefs[0][1]
    centre = (np.array(inside.shape) - 1) / 2
    away = (np.argwhere(inside) - centre) / (np.array(inside.shape) / 2)
    terms = np.stack([np.ones(len(away)), (away**2).sum(axis=1)], axis=1)
    found: NDArray[np.float64] = -(np.linalg.pinv(terms) @ np.stack([h[inside] for h, _ in reliefs], axis=1))[1]
    return found


@cache
def _slopes(side: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points in a pupil of radius 1, (n, 2), and the slopes there per unit of each height, (side², n, 2)."""
    reliefs = [relief_heights(optics.Pupil(1.0, relief_of(gene))) for gene in np.eye(side * side)]
    inside, pixels = reliefs[0][1], len(reliefs[0][1])
    places = (np.argwhere(inside) + 0.5) * 2 / pixels - 1
    slopes = [np.stack(np.gradient(heights, 2 / pixels, edge_order=2), axis=-1)[inside] for heights, _ in reliefs]
    return places, np.array(slopes)
