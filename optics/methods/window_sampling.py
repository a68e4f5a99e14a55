"""The method "low_rank" at coarse tolerances: as few samples of the pupil as the light in the window needs.

Samples at the pitch Δs, in sines, repeat the image with the period λ/Δs. The period must be at least half the width of
the window, plus the distance from the middle within which nearly all light arrives. Light that the edge of the pupil
diffracts spreads further. A soft edge keeps the copies of this light out of the window. The soft edge only changes
light far from the geometrical rays of the edge, where there is little light.

The period and the softness follow from estimates. Every PSF is therefore compared with a sum over finer samples in a
few rows and columns (`window_check`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from optics.apertures.aperture import EDGE_REACH
from optics.apertures.soft_edge import SoftEdge
from optics.elements.beam import Beam
from optics.elements.wavefront import Zernike
from optics.methods.carrier import on_window
from optics.methods.problem import Problem
from optics.methods.pupil_edge import PupilEdge
from optics.methods.sine_samples import SineSamples, evenly_in_sines
from optics.methods.slow_factor import Path, axis_factor, fourier_kernel, slow_factor
from optics.methods.window_check import window_errors
from optics.methods.window_rank import window_rank
from optics.methods.window_sums import WindowSums, intensity_of, recorded_field
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.grid import sample_positions
from optics.numerics.interpolation import chebyshev_points
from optics.numerics.precision import padded_for_packets, precision

__all__ = ["TIGHTEST", "WindowSampling", "window_sampling"]

TIGHTEST = 3e-4  # choice: smallest tolerance at which this way of sampling saves time
# Choices for the soft edge: ripple of its spectrum, of the samples and of the finer samples of the check, and width of
# the passband relative to that of the whole spectrum.
RIPPLES, PASSBAND = (0.03, 0.0075), 0.35
# Choices for the number of samples, at a tolerance of 0.01: neglected fraction of the light; cycles per radius for the
# edge; additional cycles for the edge, per cycle of the rays near it; exponent of the tolerance for the edge.
NEGLECTED, EDGE_CYCLES, RIM_CYCLES, EXPONENT = 3e-4, 4.0, 3.0, -0.4
RIM = 0.85  # choice, radii: rays farther out count as rays of the edge
CELL_CYCLES = 0.375  # choice: cycles per cell between knots, for derivatives with respect to samples of maps
DERIVATIVE_PART = 0.2  # choice: tolerance of the edge if the PSF carries derivatives, relative to that of the PSF
# Choices: steps per octave to which the sampling density and the sharpness of the edge are rounded, so that similar
# PSFs share arrays and tables.
STEPS, EDGES = 4, 8
FINER, SHIFT = 2.0 ** (1 / 3), (math.sqrt(5) - 1) / 2  # choices for the finer samples of the check, see `window_check`
# Time [s]: per PSF, per sample of the pupil, per entry of the slow factor, and per multiplication.
PER_PSF, PER_SAMPLE, PER_ENTRY, PER_PRODUCT = 8e-4, 4e-8, 3e-8, 2.5e-10
MOST_ENTRIES = 4e6  # choice, limited by memory: largest number of entries of the slow factor


@dataclass(frozen=True)
class WindowSampling:
    """Samples of the pupil, finer samples for the check, and the rank of the slow factor over the window.

    half_width: distance [m] from the middle of the window within which the interpolation points lie.
    """

    pupil: SineSamples
    finer: SineSamples
    rank: int
    half_width: float
    seconds: float
    bytes: float
    method: str = "low_rank"
    model_error: float = 0.0
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity |U|² over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        if problem.differentiated:
            return self._recorded(beam, problem).intensity
        return precision(problem.dtype).Float(padded_for_packets(self.plain_intensity(beam, problem)))

    def plain_intensity(self, beam: Beam, problem: Problem) -> np.ndarray:
        """Return the result of `intensity` as a NumPy array without derivatives."""
        return intensity_of(self._field(beam, problem)).ravel()

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the complex amplitude U over the window, without the carrier e^{ikz}."""
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
        """Return the arrays of the sums. The wavelength may be longer than the one that determined the samples."""
        return _window_sums(self.pupil, self.rank, self.half_width, path, dtype)

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are spread, see `Sampling.plane`."""
        return problem.wavelength / self.pupil.grid.dx

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.grid.shape

    def error(self, beam: Beam, problem: Problem, image: np.ndarray) -> float | None:
        """Return the relative L2 error of the intensity over the window, see `window_errors`; None without light.

        image: |U|² over the window, divided by the area of the pupil [1/m²], flat.
        """
        light, seen = self.finer.light(beam, problem.dtype), image.reshape(1, *problem.window.shape)
        error = window_errors(self.finer, Path.from_problem(problem), light[None], seen * beam.pupil.area)
        return float(error[0]) if error[0] >= 0 else None


def window_sampling(problem: Problem) -> WindowSampling | None:
    """Return the samples for a coarse tolerance. The result is None if the method is not suitable."""
    fine = problem.tolerance < TIGHTEST or problem.reach is not None or math.isfinite(problem.widest_band)
    if fine or problem.all_light or problem.pixelated is not None:
        return None
    half = max(problem.window.own_half_width, problem.window.dx)
    density = 2.0 ** (math.ceil(STEPS * math.log2(_density(problem, half)) - 1e-9) / STEPS)
    pupil, finer = (
        _samples(problem, half, each, ripple, shift)
        for each, ripple, shift in zip((density, FINER * density), RIPPLES, (0.0, SHIFT), strict=True)
    )
    if pupil is None or finer is None:
        return None
    rank = window_rank(problem, pupil, half)
    across, (height, width) = len(pupil.at), problem.window.shape
    if rank is None or (rank * across) ** 2 > MOST_ENTRIES or len(finer.at) ** 2 > MOST_ENTRIES:
        return None
    inner = rank * across
    products = inner * inner * width + height * inner * width
    samples = across**2 + len(finer.at) ** 2
    entries = 0 if rank == 1 else inner * inner
    seconds = PER_PSF + samples * PER_SAMPLE + entries * PER_ENTRY + products * PER_PRODUCT
    size = 16 * (4 * inner * inner + inner * (height + 2 * width) + samples)
    return WindowSampling(pupil, finer, rank, half, seconds, size)


def _density(problem: Problem, half: float) -> float:
    """Return the number of samples per radius, which is also the number of cycles per radius that they resolve."""
    radius, tolerance = problem.radius, problem.tolerance
    along, outward = problem.sampled_slopes.to_window(problem.distance, problem.window.centre, problem.medium_n)
    cycles = np.sort(along) * radius / (problem.wavelength * problem.medium_n)
    neglected = NEGLECTED * min(tolerance / 0.01, 1.0) ** 2
    reach = float(cycles[max(0, math.ceil(len(cycles) * (1 - neglected)) - 1)])
    rim = float(np.median(along[outward > RIM])) * radius / (problem.wavelength * problem.medium_n)
    window = half * radius / (problem.wavelength * problem.distance)
    cells = 0.0 if problem.knots is None else (len(problem.knots.borders) - 1) * CELL_CYCLES
    sharp = EDGE_CYCLES + RIM_CYCLES * rim
    if problem.differentiated:
        wavefront = problem.light.pupil.wavefront
        # High modes grow outside the circle, so that their derivatives need a sharper edge.
        sharp = sharp * DERIVATIVE_PART**EXPONENT + (wavefront.order if isinstance(wavefront, Zernike) else 0)
    edge = (sharp + cells) * (tolerance / 0.01) ** EXPONENT
    # The soft edge must not extend beyond EDGE_REACH, and its width is inversely proportional to the stopband.
    widest = SoftEdge(PASSBAND, 1.0, RIPPLES[1]).reach / EDGE_REACH * 2.0 ** (1 / EDGES)
    return max(window + reach + edge + problem.mask_detail * radius, widest + window / 2)


def _samples(problem: Problem, half: float, density: float, ripple: float, shift: float) -> SineSamples | None:
    """Return samples with a soft edge, which is as sharp as the density allows."""
    window = half * problem.radius / (problem.wavelength * problem.distance)
    stopband = max(density - window / 2, density / 2)
    stopband = 2.0 ** (math.floor(EDGES * math.log2(stopband)) / EDGES)
    edge = PupilEdge(problem.aperture.with_edge(PASSBAND * stopband, stopband, ripple), problem.radius)
    return evenly_in_sines(problem, edge, density / problem.radius, shift)


@lru_cache(maxsize=64)
def _window_sums(pupil: SineSamples, rank: int, half: float, path: Path, dtype: str) -> WindowSums:
    complex_dtype, nodes = precision(dtype).complex_dtype, half * chebyshev_points(rank)
    column, row = pupil.at[None, :], pupil.at[:, None]
    u, v = nodes[None, :, None, None], nodes[:, None, None, None]
    x, y = u + path.window.centre[0], v + path.window.centre[1]
    (xi, eta), z = pupil.points, path.distance
    distance = np.sqrt((x - xi) ** 2 + (y - eta) ** 2 + z * z)
    near = path.wavelength / (2 * np.pi * distance) - 1j
    kernel = slow_factor(path, (xi, eta), (column, row), (u, v)) * near / (path.wavelength * z)
    kernel = kernel / (axis_factor(path, pupil, 0, column, u) * axis_factor(path, pupil, 1, row, v))

    def by_distance() -> np.ndarray:
        """Return the derivative of the kernel z/(λD²) (1/(kD) - i) e^{ik(D - ρ)} with respect to the distance z."""
        turns = 2j * np.pi / path.wavelength * (z / distance - z / np.sqrt(x * x + y * y + z * z))
        near_by = -(near.real * z / distance**2) / near
        return np.asarray(kernel * (1 / z - 2 * z / distance**2 + turns + near_by), complex_dtype)

    def along(axis: int) -> np.ndarray:
        place = sample_positions(path.window.shape[1 - axis], path.window.dx)
        factor = axis_factor(path, pupil, axis, pupil.at, place[:, None]).astype(complex_dtype)
        return fourier_kernel(place, pupil.at, nodes, path.wavelength, dtype) * np.tile(factor, rank)

    return WindowSums(kernel.astype(complex_dtype), along(1), along(0), by_distance)
