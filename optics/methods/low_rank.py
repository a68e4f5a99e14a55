"""The Rayleigh-Sommerfeld integral as a product of three matrices, two of which contain Fourier kernels.

The ratio of the diffraction kernel to a Fourier kernel varies slowly over the window. This slow factor has a low rank:
few points of the window are enough to interpolate it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optics.elements.beam import Beam
from optics.methods.carrier import on_window
from optics.methods.problem import Problem
from optics.methods.pupil_sampling import PupilSamples, samples_of
from optics.methods.sine_samples import sine_samples
from optics.methods.slow_factor import fourier_kernel, uniform_rank
from optics.methods.window_sampling import WindowSampling, window_sampling
from optics.numerics.autodiff import Array
from optics.numerics.cost import CALL, FOURIER_ENTRY, ITEM_BYTES, KERNEL_ENTRY, MATMUL_FLOPS
from optics.numerics.field import Field
from optics.numerics.grid import Grid, sample_positions
from optics.numerics.interpolation import chebyshev_points
from optics.numerics.matrices import complex_flops, complex_matmul
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["LowRankSampling", "low_rank"]

STEEPEST = 8.0  # choice, radius over distance: at larger ratios, a test of the rank at the rim is not sufficient
MOST_BYTES = 288_000_000  # choice, limited by memory: largest matrix between pupil and window, of which two exist


@dataclass(frozen=True)
class LowRankSampling:
    """Samples of the pupil, and the points of the window that are necessary to interpolate the slow factor.

    The slow factor is the ratio of the diffraction kernel to a Fourier kernel, and varies slowly over the window.

    rank: number of Chebyshev points along each axis of the window, between which the factor is interpolated.
    half_width: distance [m] from the window's centre, along each axis, within which these points lie.
    scale: distance c [m] in the Fourier kernel e^{-ik ξ·u/c} between points ξ of the pupil and u of the window. It is 1
        if the samples are evenly spaced in sines instead of positions. The kernel is then e^{-ik s·u}. The sines of a
        point are the x and y components of the unit vector from the window's centre to the point, and s is the
        difference between the sines of a sample and those of the pupil's centre.
    """

    pupil: PupilSamples
    rank: int
    half_width: float
    scale: float
    seconds: float
    bytes: float
    method: str = "low_rank"
    model_error: float = 0.0
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        return _low_rank(beam, problem, self, precision(problem.dtype)).intensity

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the complex amplitude U over the window, without the carrier e^{ikz} of a plane wave."""
        return on_window(_low_rank(beam, problem, self, precision(problem.dtype)), beam, problem)

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        The power of all rounding errors is a fraction of the power of the light. Their size in the window follows from
        this power and the width, see `Sampling.plane`. The width is one period of the Fourier transform of the pupil's
        samples. If their spacing varies, the period is that of their mean spacing.
        """
        return problem.wavelength * self.scale / float(np.diff(self.pupil.at).mean())

    @property
    def directions(self) -> np.ndarray:
        """Directions of the samples, the same along x and along y: the positions `pupil.at` divided by `scale`."""
        found: np.ndarray = self.pupil.at / self.scale
        return found

    @property
    def samples(self) -> tuple[int, int]:
        return len(self.pupil.at), len(self.pupil.at)


def low_rank(problem: Problem) -> Sequence[LowRankSampling | WindowSampling]:
    """Return a list with one sampling, which has the fewest samples of the pupil that meet the tolerance.

    The sampling also has the smallest rank that meets the tolerance. The rank is the number of points along each axis
    of the window between which the slow factor, the ratio of the diffraction kernel to a Fourier kernel, is
    interpolated. The samples resolve the combined phase of pupil and path. They are evenly spaced in sines, the x and y
    components of unit vectors from the window's centre to the samples. If this needs too many samples, they are evenly
    spaced in position. If the relief consists of pixels, the samples are quadrature nodes within the pixels.
    At coarse tolerances, the samples only resolve the light that reaches the window (`window_sampling`). The list is
    empty if the pupil's radius exceeds STEEPEST times the distance to the window, or if there would be too many samples
    or too large matrices.
    """
    coarse = window_sampling(problem)
    if coarse is not None:
        return [coarse]
    if problem.radius > STEEPEST * problem.distance:
        return []
    half = max(problem.window.own_half_width, problem.window.dx)
    if not problem.divided:
        sines = sine_samples(problem)
        found = None if sines is None else _sampling(problem, sines, half, 1.0)
        if found is not None:
            return [found]
    pupil = samples_of(problem)
    # The distance c lies between the distances to the window's centre and to its sides. The factor 0.6 is a choice.
    scale = math.hypot(problem.distance, 0.6 * half, *problem.window.centre)
    found = None if pupil is None else _sampling(problem, pupil, half, scale)
    return [] if found is None else [found]


def _sampling(problem: Problem, pupil: PupilSamples, half: float, scale: float) -> LowRankSampling | None:
    """Return a sampling with the given samples of the pupil; None if its matrix would be too large.

    Its rank, the number of interpolation points along each axis of the window, is the smallest that meets the
    tolerance.
    """
    entries = MOST_BYTES // np.dtype(precision(problem.dtype).complex_dtype).itemsize
    rank = uniform_rank(problem, pupil, half, scale, math.isqrt(entries) // len(pupil.at))
    if rank is None:
        return None
    inner = rank * len(pupil.at)
    height, width = problem.window.shape
    columns = width // 2 + 1
    flops = 2 * (complex_flops(inner * inner * columns // 2) + complex_flops(height * inner * columns))
    seconds = (
        CALL["low_rank"]
        + flops / MATMUL_FLOPS[problem.dtype]
        + inner * inner * KERNEL_ENTRY
        + pupil.seconds
        + inner * (height + columns) * FOURIER_ENTRY
    )
    item = ITEM_BYTES[problem.dtype]
    # Memory of the matrix between pupil and window, the pupil, the Fourier kernels (while computed), and the products.
    needed = 4 * item * inner * inner + 8 * item * len(pupil.at) ** 2 + 40 * inner * (height + columns)
    needed += 4 * item * columns * (inner + height)
    return LowRankSampling(pupil, rank, half, scale, seconds, needed)


def _low_rank(beam: Beam, problem: Problem, how: LowRankSampling, types: Precision) -> Field:
    """Return the field over the window, without the spherical phase e^{ik(ρ - z)} and the carrier e^{ikz}:

        U(x) = Σ_ab L_a(u) L_b(v) Σ_ξ P(ξ) G(ξ; x_a, y_b) e^{-ik s·(u, v)},
        G(ξ; x) = z/(λD²) (1/(kD) - i) e^{ik(D - ρ + s·(u, v))},   D = |(x - ξ, z)|, ρ = |(x, z)|.

    (u, v) is the position in the window relative to its centre. P is the light behind the pupil times the areas of the
    samples. s is the direction of a sample. If the samples are evenly spaced in sines (components of unit vectors from
    the window's centre), s contains these sines, minus those of the pupil's centre. Otherwise, s is ξ/c with the
    distance c = `how.scale`. G varies slowly with x, so the Lagrange polynomials L_a and L_b interpolate it between the
    points (x_a, y_b) of the window.

    For each axis, the double sum over interpolation points and samples is written as one sum, over all pairs that
    consist of an interpolation point and a sample. The field is then the product of three matrices, A_y W A_xᵀ.
    W contains P G, and A_x and A_y contain the remaining factors along their axis. A_x does not change if window and
    samples are both mirrored, so the matrices are split into even and odd parts along x. This halves the cost of the
    product with W.
    """
    window = problem.window
    nodes = how.half_width * chebyshev_points(how.rank)
    across_y, along_x = (
        fourier_kernel(at, how.directions, nodes, problem.wavelength, problem.dtype)
        for at in (sample_positions(window.shape[0], window.dx), np.arange(window.shape[1] // 2 + 1) * window.dx)
    )
    across_x = _halves(along_x)
    summed = [
        complex_matmul(_tensors(across_y, types), complex_matmul(inner, _tensors(across, types), transposed=True))
        for inner, across in zip(_kernel(beam, problem, how, types), across_x, strict=True)
    ]
    return _unfolded(summed, window, types)


def _halves(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the even and the odd part of a matrix, (A[x, j] ± A[x, -j]) / 2, for columns j ≥ 0 from the middle.

    The middle column is its own mirror image.
    """
    size = matrix.shape[1]
    ahead, behind = matrix[:, size // 2 :], matrix[:, : size - size // 2][:, ::-1]
    even, odd = (ahead + behind) / 2, (ahead - behind) / 2
    if size % 2:
        even[:, 0] /= 2
    return even, odd


def _unfolded(parts: list[tuple[Array, Array]], window: Grid, types: Precision) -> Field:
    """Return the field over the window from its even and odd parts along x."""
    import drjit as dr

    across = window.shape[1] // 2
    x, y = Grid(window.shape, 1.0).coordinates(types)
    place = types.Index((y + opaque(types, window.shape[0] // 2)) * opaque(types, across + 1) + abs(x))
    side = dr.select(x < 0, types.Float(-1), types.Float(1))
    even, odd = ([dr.gather(types.Float, part.array, place) for part in each] for each in parts)
    return Field(even[0] + side * odd[0], even[1] + side * odd[1], window, types)


def _kernel(beam: Beam, problem: Problem, how: LowRankSampling, types: Precision) -> list[tuple[Array, Array]]:
    """Return W[row, col] ± W[row, -col], the sum and the difference of a matrix W and its left-right mirror image.

    W contains the light P(ξ, η) at the samples of the pupil, times the slow factor G(ξ, η; x_a, y_b), the ratio of the
    diffraction kernel to a Fourier kernel (see `_low_rank`). Each row stands for a pair (b, η): an interpolation point
    y_b of the window, and the y coordinate η of a sample. Each column stands for a pair (a, ξ): an interpolation point
    x_a of the window, and the x coordinate ξ of a sample. Columns are counted from the middle column of W.

    Sum and difference are two tensors (row, column) each, the real and the imaginary part.
    """
    import drjit as dr

    u, size = how.pupil.field(beam, types).evaluated(), len(how.pupil.at) * how.rank
    shape = size, size - size // 2
    column, row = Grid(shape, 1.0).coordinates(types)  # counted from the middle
    column, row = column + opaque(types, shape[1] // 2), row + opaque(types, size // 2)
    right = column + opaque(types, size // 2)
    ahead = _entries(u, (right, row), beam, problem, how)
    behind = _entries(u, (opaque(types, size - 1) - right, row), beam, problem, how)
    parts = [ahead.re + behind.re, ahead.im + behind.im, ahead.re - behind.re, ahead.im - behind.im]
    dr.eval(parts)
    tensors = [types.Tensor(part, shape) for part in parts]
    return [(tensors[0], tensors[1]), (tensors[2], tensors[3])]


def _entries(u: Field, at: tuple[Array, Array], beam: Beam, problem: Problem, how: LowRankSampling) -> Field:
    """Return entries of the matrix W that `_kernel` defines.

    An entry is the light at a sample of the pupil times the slow factor, the ratio of the diffraction kernel to a
    Fourier kernel.

    at: indices (column, row) of the entries, as float64.
    """
    import drjit as dr

    types, n = u.types, len(how.pupil.at)
    size = n * how.rank
    grid = Grid((size, size - size // 2), 1.0)
    (a, i), (b, j) = (_split(index, n, types) for index in at)
    points = types.Float64(padded_for_packets(how.half_width * chebyshev_points(how.rank)))
    from_centre = [dr.gather(types.Float64, points, types.Index(index)) for index in (a, b)]
    x, y = (u + opaque(types, middle) for u, middle in zip(from_centre, problem.window.centre, strict=True))
    xi, eta = how.pupil.places(i, j, beam, types)
    z, wavelength = opaque(types, beam.distance), opaque(types, problem.wavelength)
    rho2 = x * x + y * y + z * z
    excess = xi * xi + eta * eta - 2 * (x * xi + y * eta)
    distance = dr.sqrt(rho2 + excess)
    # The Fourier kernel stays fixed if the radius, and with it the nodes, change. The slow factor contains the change.
    directions = types.Float64(padded_for_packets(how.directions))
    s, t = (dr.gather(types.Float64, directions, types.Index(index)) for index in (i, j))
    fixed = from_centre[0] * s + from_centre[1] * t
    waves = (excess / (distance + dr.sqrt(rho2)) + fixed) / wavelength
    slow = Field.from_waves(z / (wavelength * distance * distance), waves, grid, types)
    near = types.Float(wavelength / (2 * math.pi * distance))
    slow = slow * Field(near, types.Float(-1), grid, types)
    place = types.Index(j * opaque(types, n) + i)
    return slow * Field(dr.gather(types.Float, u.re, place), dr.gather(types.Float, u.im, place), grid, types)


def _split(index: Array, n: int, types: Precision) -> tuple[Array, Array]:
    """Return quotient and remainder of float64 indices divided by n."""
    import drjit as dr

    by = dr.opaque(types.Float64, n)
    quotient = dr.floor((index + 0.5) / by)
    return quotient, dr.fma(-quotient, by, index)


def _tensors(matrix: np.ndarray, types: Precision) -> tuple[Array, Array]:
    return (
        types.Tensor(padded_for_packets(matrix.real), matrix.shape),
        types.Tensor(padded_for_packets(matrix.imag), matrix.shape),
    )
