"""The paraxial methods: the integrals of Fresnel and Fraunhofer, with their predicted errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.apertures.aperture import EDGE_REACH
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.pupil_edge import PupilEdge
from optics.methods.rays import MARGIN, Rays, brightness, disk_area, mismatch
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number
from optics.numerics.cost import CALL, ITEM_BYTES, PUPIL_SAMPLE
from optics.numerics.field import Field
from optics.numerics.fourier import dft2, predicted_bytes, predicted_seconds
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, precision

__all__ = ["ParaxialSampling", "fraunhofer", "fresnel", "paraxial_integral"]

RAYS, ENDS = 48, 24  # choice: numbers of ray origins and of hit points at which the neglected phase is evaluated
# Choice, in radii of a ray's first Fresnel zone: light from within this distance of the ray's origin adds up coherently
# at its hit point.
ZONES = 3.0
ROUNDING = 1e-15  # rounding error of sums of numbers near 1
MUCH = 0.7  # choice: above this error, the field is unrelated to the exact field


@dataclass(frozen=True)
class ParaxialSampling:
    """Samples of a pupil for a paraxial method.

    `model_error` is the relative L2 error of the intensity that the paraxial approximation causes. It is computed on
    first access, because its computation takes longer than the choice of the samples and the prediction of their cost.
    """

    method: str
    edge: PupilEdge
    pupil: Grid
    seconds: float
    bytes: float
    problem: Problem
    padding: float = 1.0

    @cached_property
    def model_error(self) -> float:
        return model_error(self.problem, self.method == "fresnel")

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        u = beam.behind(self.edge.aperture, self.pupil, precision(problem.dtype))
        curved = self.method == "fresnel"
        return paraxial_integral(u, beam.distance, problem.wavelength, problem.window, curved).intensity

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        `Sampling.plane` explains how the size of rounding errors follows from this width. The width is one period of
        the Fourier transform of the pupil's samples.
        """
        return problem.wavelength * problem.distance / self.pupil.dx

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.shape


def fresnel(problem: Problem) -> list[ParaxialSampling]:
    """Return a list with one sampling of Fresnel's integral (Goodman, Introduction to Fourier Optics, eq. 4-17).

    The list is empty if the pupil consists of pixels.
    """
    reach = (1 + EDGE_REACH) * problem.radius + problem.outermost
    excess = reach / problem.distance - reach / math.hypot(reach, problem.distance)
    turning = min(
        problem.turning + excess / problem.wavelength,
        problem.phase_band + reach / (problem.wavelength * problem.distance),
    )
    return _sampling("fresnel", problem, turning)


def fraunhofer(problem: Problem) -> list[ParaxialSampling]:
    """Return a list with one sampling of Fraunhofer's integral (Goodman, eq. 4-25), which omits the quadratic phase.

    The list is empty if the pupil consists of pixels.
    """
    return _sampling(
        "fraunhofer", problem, problem.phase_band + problem.outermost / (problem.wavelength * problem.distance)
    )


def _sampling(method: str, problem: Problem, turning: float) -> list[ParaxialSampling]:
    """Return a list with one sampling, for an integrand with frequencies up to `turning` [1/m].

    The list is empty if the pupil consists of pixels.
    """
    if problem.pixelated is not None:
        return []
    edge = problem.soft_edge(turning)
    pitch = 1 / (turning + edge.stopband)
    pupil = Grid.square(2 * math.ceil(edge.outermost / pitch) + 1, pitch)
    seconds = (
        CALL["fresnel"]
        + predicted_seconds(pupil.shape, 0.5, problem.window.shape)
        + pupil.shape[0] ** 2 * (PUPIL_SAMPLE + edge.seconds_per_point)
    )
    needed = predicted_bytes(pupil.shape, problem.window.shape, ITEM_BYTES[problem.dtype])
    return [ParaxialSampling(method, edge, pupil, seconds, needed, problem)]


def model_error(problem: Problem, curved: bool) -> float:
    """Return the relative L2 error of an intensity that is computed with the paraxial kernel.

    The ratio of the paraxial kernel to the exact kernel for light from ξ to x is

        q = (D/z)² e^{-ik(D - z - d²/2z)},   d = |x - ξ|,   D = √(d² + z²).

    Fraunhofer's integral also omits the term ξ² of d². The error is the deviation of q from a constant phase factor,
    averaged over points x at and near the hit points of rays. A phase that is common to all light at x causes no error.
    For each x, only points ξ count whose light adds up coherently there. They lie in a few Fresnel zones around the
    ray's origin, or in the whole aperture if several rays may hit the same point. If there are no rays, or if the pupil
    has a mask, the error cannot be predicted and counts as 1.

    curved: True for Fresnel's integral, False for Fraunhofer's.
    """
    rays = problem.rays
    if rays is None or len(rays) == 0 or problem.masked:
        return 1.0
    some, ends = rays.some(RAYS), rays.some(ENDS)
    x, y = _places(problem, ends)
    d2 = (x[:, None] - some.x) ** 2 + (y[:, None] - some.y) ** 2
    z = problem.distance
    root = np.sqrt(d2 + z * z)
    waves = d2 * d2 / (2 * z * (root + z) ** 2)  # d²/2z - (D - z)
    if not curved:
        waves = waves - (some.x**2 + some.y**2) / (2 * z)
    size, angle = np.square(root / z), 2 * np.pi / problem.wavelength * waves
    zone = math.inf if rays.folded else ZONES * np.sqrt(problem.wavelength * z / np.maximum(ends.least, 1e-12))[:, None]
    apart2 = (ends.x[:, None] - some.x) ** 2 + (ends.y[:, None] - some.y) ** 2
    nearest = apart2 == apart2.min(axis=1, keepdims=True)
    near = np.tile((apart2 <= np.square(zone)) | nearest, (len(x) // len(ends), 1))
    count, size = near.sum(axis=1), size * near
    re, im = ((size * part).sum(axis=1) for part in (np.cos(angle), np.sin(angle)))
    # Mean of |q - q₀|², where q₀ is the nearest number of modulus 1: 1 - 2|Σ q| / n + Σ |q|² / n. Adding ROUNDING keeps
    # it above rounding errors.
    squared = 1 + (np.square(size).sum(axis=1) - 2 * np.hypot(re, im)) / count
    error = 2 * math.sqrt(np.maximum(squared, 0).mean() + ROUNDING)
    return MARGIN * error if error < MUCH or curved else _misplaced(problem)


def _misplaced(problem: Problem) -> float:
    """Return the relative L2 error of a PSF from Fraunhofer's integral that hardly overlaps the exact PSF.

    For example, a pupil without a lens casts a wide shadow, but the integral yields a small spot. The error follows
    from the brightness of the integral's PSF, relative to that of the exact PSF.
    """
    rays, cell = problem.rays, problem.window.dx**2
    assert rays is not None
    diffracted = math.pi * (problem.wavelength * problem.distance / (2 * problem.radius)) ** 2
    area = disk_area(rays.to_x - rays.x, rays.to_y - rays.y)
    return mismatch(brightness(area + diffracted, cell), brightness(rays.image_area + diffracted, cell))


def _places(problem: Problem, ends: Rays) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of the window at which the error is evaluated.

    They are the hit points of rays, and points one diffraction width away from these. Points outside the window are
    moved to its rim.
    """
    width = 0.6 * problem.wavelength * problem.distance / problem.radius  # close to Airy's first dark ring at 0.61
    window = problem.window
    x = np.concatenate([ends.to_x + step * width for step in (0, 1, 0, -1, 0)])
    y = np.concatenate([ends.to_y + step * width for step in (0, 0, 1, 0, -1)])
    return np.clip(x, window.x[0], window.x[-1]), np.clip(y, window.y[0], window.y[-1])


def paraxial_integral(
    u: Field,
    distance: Scalar,
    wavelength: float,
    window: Grid,
    curved: bool = True,
    onto_window: Callable[[Field, Scalar], Field] | None = None,
) -> Field:
    """Return the field over the window at `distance`, without a phase that does not affect the intensity:

    U(x) = 1/(iλz) ∫ u(ξ) e^{iπξ²/λz} e^{-2πi x·ξ/λz} dξ (Goodman, Introduction to Fourier Optics, eq. 4-17). The
    integral is one Fourier sum with an arbitrary output pitch.

    wavelength: wavelength [m] in the medium.
    curved: False replaces the quadratic phase factor by 1 (eq. 4-25).
    onto_window: function that computes the Fourier sum from a field and a period (None: `fourier.dft2`).
    """
    types, grid = u.types, u.grid
    scale = opaque(types, distance) * opaque(types, wavelength)
    if curved:
        x, y = grid.coordinates(types)
        u = u * Field.from_waves(1.0, (x * x + y * y) * (0.5 / scale), grid, types)
    period = (scale if is_differentiable(distance) else wavelength * number(distance)) / (grid.dx * window.dx)
    if onto_window is None:
        found = dft2(u, period, window.shape, -1, window.dx, window.centre)
    else:
        found = onto_window(u, period)
    return found.scaled(grid.dx**2 / scale)
