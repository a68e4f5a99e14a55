"""The method "low_rank" for a single PSF at coarse tolerances.

The pupil has only as many samples as the light that reaches the window requires. `window_plan` chooses their number and
the number of interpolation points in the window (the rank). Both numbers are estimates. Every PSF is therefore checked
in a few rows and columns of the window, where it is compared with a sum over finer samples of the pupil
(`window_check`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.axis_kernel import axis_factor
from optics.methods.carrier import on_window
from optics.methods.pixel_nodes import WindowSamples, pixel_plan
from optics.methods.problem import Problem
from optics.methods.pupil_edge import PupilEdge
from optics.methods.sine_samples import SineSamples
from optics.methods.sine_stack import SineStack
from optics.methods.single_stack import single_stack
from optics.methods.slow_factor import Path, fourier_kernel, slow_factor
from optics.methods.window_images import window_image_errors, window_images
from optics.methods.window_plan import TIGHTEST, WindowPlan
from optics.methods.window_rank import Derivatives
from optics.methods.window_sums import WindowSums, recorded_field
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.grid import Grid, sample_positions
from optics.numerics.interpolation import chebyshev_points
from optics.numerics.precision import padded_for_packets, precision

__all__ = ["WindowSampling", "window_sampling"]

CROSSED_RANK = 3  # Rank 2 is less accurate than `cross_term`.


@dataclass(frozen=True)
class WindowSampling:
    """Samples of the pupil, from which a PSF over a window is summed, and finer samples that check the result.

    The diffraction kernel of the sum is a Fourier kernel times a factor that varies slowly over the window, the slow
    factor.

    rank: number of interpolation points of the slow factor along an axis of the window.
    crossed: True if `plain_intensity` computes the slow factor by a formula (`cross_term`) instead of interpolation.
        This formula is not used for the complex field or for intensities with derivatives. For these, the slow factor
        is interpolated, with a rank of at least CROSSED_RANK.
    half_width: distance [m] from the middle of the window within which the interpolation points lie.
    """

    pupil: WindowSamples
    finer: WindowSamples
    rank: int
    crossed: bool
    half_width: float
    seconds: float
    bytes: float
    method: str = "low_rank"
    model_error: float = 0.0
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        if problem.differentiated:
            return self._recorded(beam, problem).intensity
        return precision(problem.dtype).Float(padded_for_packets(self.plain_intensity(beam, problem)))

    def plain_intensity(self, beam: Beam, problem: Problem) -> np.ndarray:
        """Return the result of `intensity` as a NumPy array without derivatives."""
        samples = single_stack(self.pupil)
        return window_images(problem.stack, samples, self.rank, self.crossed, problem.window, problem.dtype).ravel()

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the complex amplitude U over the window, without the carrier e^{ikz} of a plane wave."""
        if problem.differentiated:
            return on_window(self._recorded(beam, problem), beam, problem)
        u = Field.from_numpy(self._field(beam, problem), problem.window.dx, precision(problem.dtype))
        return on_window(replace(u, grid=problem.window), beam, problem)

    def _field(self, beam: Beam, problem: Problem) -> np.ndarray:
        sums = self.sums(Path.from_problem(problem), problem.dtype)
        return sums.field(self.pupil.light(beam, problem.dtype))

    def _recorded(self, beam: Beam, problem: Problem) -> Field:
        light = self.pupil.field(beam, precision(problem.dtype))
        sums = self.sums(Path.from_problem(problem), problem.dtype)
        return recorded_field(light, beam.distance, sums, problem.window)

    def sums(self, path: Path, dtype: str) -> WindowSums:
        """Return the matrices with which `WindowSums` computes the field over the window from the light of the pupil.

        path: wavelength, distance and window. The wavelength may be longer than the one that determined the samples.
        dtype: "float32" or "float64".
        """
        return _window_sums(
            self.pupil, max(self.rank, CROSSED_RANK) if self.crossed else self.rank, self.half_width, path, dtype
        )

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        The intensity of the rounding errors is estimated from this width, see `Sampling.plane`.
        """
        return problem.wavelength / self.pupil.grid.dx

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.grid.shape

    def error(self, beam: Beam, problem: Problem, image: np.ndarray) -> float | None:
        """Return the relative L2 error of the intensity over the window, see `window_errors`; None without light.

        image: |U|² over the window, divided by the area of the pupil [1/m²], flat.
        """
        seen = image.reshape(1, *problem.window.shape) * image.dtype.type(beam.pupil.area)
        [error] = window_image_errors(problem.stack, single_stack(self.finer), seen, problem.window, problem.tolerance)
        return float(error) if error >= 0 else None


def window_sampling(problem: Problem) -> WindowSampling | None:
    """Return the samples with which the method "low_rank" computes a PSF at a coarse tolerance.

    The result is None if the tolerance is below TIGHTEST, or if the problem does not permit this way of sampling.
    """
    fine = problem.tolerance < TIGHTEST or problem.reach is not None or math.isfinite(problem.widest_band)
    if fine or problem.all_light:
        return None
    if problem.pixelated is not None:
        pixels = pixel_plan(problem)
        return None if pixels is None else WindowSampling(*pixels[:3], False, *pixels[3:])
    needs = None
    if problem.differentiated:
        needs = Derivatives(problem.moves, 0 if problem.knots is None else len(problem.knots.borders) - 1)
    plan = WindowPlan(problem.stack, problem.window, np.array([problem.tolerance]), needs)
    if not plan.counts[0]:
        return None
    edges, rank = (plan.edges.edges[0], plan.edges.finer_edges[0]), (int(plan.ranks[0]), bool(plan.crossed[0]))
    key = "sampling", int(plan.counts[0]), *rank, *edges, plan.elsewhere.tobytes()

    def computed() -> WindowSampling:
        pupil, finer = (_single(samples) for samples in plan.samples(np.array([0])))
        costs = float(plan.seconds[0]), float(plan.bytes[0])
        return WindowSampling(pupil, finer, *rank, plan.geometry.half, *costs)

    found: WindowSampling = plan.geometry.known.get(key, computed)
    return found


def _single(stack: SineStack) -> SineSamples:
    """Return the samples of a single pupil, given a stack that contains only this pupil."""
    edge, pitch = PupilEdge(stack.edges[0], float(stack.radius[0])), float(stack.pitch[0])
    count = stack.at.shape[1]
    shift = float(stack.at[0, count // 2])
    grid = Grid((count, count), pitch, (shift, shift))
    return SineSamples(
        edge, grid, stack.centre, *(float(part[0]) for part in (stack.distance, stack.steepest, stack.elsewhere))
    )


@lru_cache(maxsize=64)
def _window_sums(pupil: WindowSamples, rank: int, half: float, path: Path, dtype: str) -> WindowSums:
    complex_dtype, nodes = precision(dtype).complex_dtype, half * chebyshev_points(rank)
    column, row = pupil.at[None, :], pupil.at[:, None]
    u, v = nodes[None, :, None, None], nodes[:, None, None, None]
    x, y = u + path.window.centre[0], v + path.window.centre[1]
    (xi, eta), z = pupil.points, path.distance
    distance = np.sqrt((x - xi) ** 2 + (y - eta) ** 2 + z * z)
    near = path.wavelength / (2 * np.pi * distance) - 1j
    kernel = slow_factor(path, (xi, eta), (column, row), (u, v)) * (-1j / (path.wavelength * z))
    kernel = kernel / (axis_factor(path, pupil, 0, column, u) * axis_factor(path, pupil, 1, row, v))

    def by_distance() -> np.ndarray:
        """Return the derivative of the kernel z/(λD²) (1/(kD) - i) e^{ik(D - ρ)} with respect to the distance z.

        D and ρ are the distances of a point of the window from a sample of the pupil and from the pupil's centre.
        """
        turns = 2j * np.pi / path.wavelength * (z / distance - z / np.sqrt(x * x + y * y + z * z))
        near_by = -(near.real * z / distance**2) / near
        return np.asarray(kernel * (1 / z - 2 * z / distance**2 + turns + near_by), complex_dtype)

    def along(axis: int) -> np.ndarray:
        place = sample_positions(path.window.shape[1 - axis], path.window.dx)
        factor = axis_factor(path, pupil, axis, pupil.at[None, :], place[:, None]).astype(complex_dtype)
        return fourier_kernel(place, pupil.at, nodes, path.wavelength, dtype) * np.tile(factor, rank)

    return WindowSums(kernel.astype(complex_dtype), along(1), along(0), by_distance)
