"""The Rayleigh-Sommerfeld integral as one matrix product: Fourier's kernel times a slow rest of low rank."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.carrier import on_window
from optics.methods.problem import Problem
from optics.methods.pupil_sampling import PupilSamples, samples_of
from optics.methods.sine_samples import SineSamples, sine_samples
from optics.numerics.autodiff import Array
from optics.numerics.cost import CALL, FOURIER_ENTRY, KERNEL_ENTRY, MATMUL_FLOPS
from optics.numerics.field import Field
from optics.numerics.grid import Grid, sample_positions
from optics.numerics.interpolation import chebyshev_points, lagrange_basis
from optics.numerics.matrices import complex_flops, complex_matmul
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["LowRankSampling", "low_rank"]

# Choice: ranks to try.
RANKS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24)
RANK_RIPPLE = 0.4  # choice: error of the rest at the pupil's rim, of the tolerance; test_low_rank.py
STEEPEST = 8.0  # choice, radii over distance: nearer, the rim on which ranks are tried tells too little
TRIED = 41  # choice: places along a line through the window
MOST_BYTES = 288_000_000  # choice, by memory: of the matrix between pupil and window; it takes twice that


@dataclass(frozen=True)
class LowRankSampling:
    """Pupil samples; `rank` Chebyshev points per axis of the window, `half_width` [m] about its centre, and the
    distance c [m] of Fourier's kernel e^{-ik ξ·u/c}, u the place in the window; 1 where samples are sines already."""

    pupil: PupilSamples
    rank: int
    half_width: float
    scale: float
    seconds: float
    method: str = "low_rank"
    model_error: float = 0.0
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """|U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""
        return _low_rank(beam, problem, self, precision(problem.dtype)).intensity

    def field(self, beam: Beam, problem: Problem) -> Field:
        """U over the window, less the carrier e^{ikz}."""
        return on_window(_low_rank(beam, problem, self, precision(problem.dtype)), beam, problem)

    def plane(self, problem: Problem) -> float:
        """Width [m] over which rounding spreads the pupil's light."""
        return problem.wavelength * self.scale / float(np.diff(self.pupil.at).mean())

    @property
    def directions(self) -> np.ndarray:
        """s of the samples along either axis."""
        found: np.ndarray = self.pupil.at / self.scale
        return found

    @property
    def samples(self) -> tuple[int, int]:
        return len(self.pupil.at), len(self.pupil.at)

    @property
    def largest(self) -> int:
        return len(self.pupil.at)  # whatever the rank: the matrix has a limit of its own


def low_rank(problem: Problem) -> list[LowRankSampling]:
    """As few pupil samples as the turns of pupil and path together allow, and the rank that the slow rest needs: with
    samples in sines, or where these crowd, on a grid of places; pixels have nodes of their own."""
    if problem.radius > STEEPEST * problem.distance:
        return []
    half = max(problem.window.own_half_width, problem.window.dx)
    if problem.pixelated is None:
        sines = sine_samples(problem)
        found = None if sines is None else _sampling(problem, sines, half, 1.0)
        if found is not None:
            return [found]
    pupil = samples_of(problem)
    # Fourier's kernel for a distance between that to the window's centre and that to its sides. Choice: where between.
    scale = math.hypot(problem.distance, 0.6 * half, *problem.window.centre)
    found = None if pupil is None else _sampling(problem, pupil, half, scale)
    return [] if found is None else [found]


def _sampling(problem: Problem, pupil: PupilSamples, half: float, scale: float) -> LowRankSampling | None:
    entries = MOST_BYTES // np.dtype(precision(problem.dtype).complex_dtype).itemsize
    rank = _rank(problem, pupil, half, scale, math.isqrt(entries) // len(pupil.at))
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
    return LowRankSampling(pupil, rank, half, scale, seconds)


def _rank(problem: Problem, pupil: PupilSamples, half: float, scale: float, most: int) -> int | None:
    """Chebyshev points along an axis that interpolate the slow rest, tried on the soft aperture's rim."""
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None]
    rim = pupil.outermost * np.cos(angle), pupil.outermost * np.sin(angle)
    directions = pupil.directions(*rim) if isinstance(pupil, SineSamples) else (rim[0] / scale, rim[1] / scale)
    test = half * np.linspace(-1, 1, TRIED)
    # On the axis both directions are alike, and so are both sides.
    on_axis = problem.window.centre == (0.0, 0.0)
    lines = [(0, 0.0), (0, half)] if on_axis else [(k, side) for k in (0, 1) for side in (-half, 0, half)]

    def rest(at: np.ndarray) -> np.ndarray:
        """(line, place on the rim, place on the line)"""
        u, v = np.stack([_line(axis, at, across) for axis, across in lines], axis=1)[:, :, None, :]
        return _rest(problem, rim, directions, (u, v))

    exact = rest(test)
    for rank in RANKS:
        if rank > most:
            return None
        known = rest(half * chebyshev_points(rank))
        if np.abs(exact - known @ _between(rank)).max() < RANK_RIPPLE * problem.tolerance:
            return rank
    return None


@lru_cache(maxsize=len(RANKS))
def _between(rank: int) -> np.ndarray:
    """What each of so many Chebyshev points counts at the places that are tried, (point, place)."""
    return lagrange_basis(np.linspace(-1, 1, TRIED), chebyshev_points(rank))


def _line(along: int, at: np.ndarray, across: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (x, y) of a line through the window, along x (0) or y (1), from its centre."""
    beside = np.full_like(at, across)
    return (at, beside) if along == 0 else (beside, at)


def _rest(
    problem: Problem,
    pupil: tuple[np.ndarray, np.ndarray],
    directions: tuple[np.ndarray, np.ndarray],
    window: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """(z/D)² e^{ik(D - ρ + u·s)} between points ξ of the pupil and u of the window, s those of Fourier's kernel."""
    (xi, eta), (u, v), (s, t) = pupil, window, directions
    x, y = u + problem.window.centre[0], v + problem.window.centre[1]
    z = problem.distance
    rho2 = x * x + y * y + z * z
    excess = xi**2 + eta**2 - 2 * (x * xi + y * eta)
    distance = np.sqrt(rho2 + excess)
    waves = (excess / (distance + np.sqrt(rho2)) + u * s + v * t) / problem.wavelength
    return z * z / distance**2 * np.exp(2j * np.pi * waves)


def _low_rank(beam: Beam, problem: Problem, how: LowRankSampling, types: Precision) -> Field:
    """U(x) = Σ_ab L_a(u) L_b(v) Σ_ξ P(ξ) G(ξ; x_a, y_b) e^{-ik s·u}, up to a phase that intensity forgets:

        G(ξ; x) = z/(λD²) (1/(kD) - i) e^{ik(D - ρ + s·u)},   D = |(x - ξ, z)|, ρ = |(x, z)|,

    which varies slowly with x; u is the place in the window, from its centre, and s = ξ/c or the sines of the samples.
    Sums over a and ξ along one axis are one: A_y W A_xᵀ, two matrix products.
    Along x both are kept as what is even and what is odd about the middle, with half of the first one's products:
    A_x stays what it is where window and samples are both mirrored.
    """
    window = problem.window
    across_y = _fourier(sample_positions(window.shape[0], window.dx), problem, how)
    across_x = _halves(_fourier(np.arange(window.shape[1] // 2 + 1) * window.dx, problem, how))
    summed = [
        complex_matmul(_tensors(across_y, types), complex_matmul(inner, _tensors(across, types), transposed=True))
        for inner, across in zip(_kernel(beam, problem, how, types), across_x, strict=True)
    ]
    return _unfolded(summed, window, types)


def _halves(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A[x, j] ± A[x, -j]) / 2 for samples j from the middle on; that in the middle is its own mirror image."""
    size = matrix.shape[1]
    ahead, behind = matrix[:, size // 2 :], matrix[:, : size - size // 2][:, ::-1]
    even, odd = (ahead + behind) / 2, (ahead - behind) / 2
    if size % 2:
        even[:, 0] /= 2
    return even, odd


def _unfolded(parts: list[tuple[Array, Array]], window: Grid, types: Precision) -> Field:
    """Over the window, of what is even and what is odd along x."""
    import drjit as dr

    across = window.shape[1] // 2
    x, y = Grid(window.shape, 1.0).coordinates(types)
    place = types.Index((y + opaque(types, window.shape[0] // 2)) * opaque(types, across + 1) + abs(x))
    side = dr.select(x < 0, types.Float(-1), types.Float(1))
    even, odd = ([dr.gather(types.Float, part.array, place) for part in each] for each in parts)
    return Field(even[0] + side * odd[0], even[1] + side * odd[1], window, types)


def _kernel(beam: Beam, problem: Problem, how: LowRankSampling, types: Precision) -> list[tuple[Array, Array]]:
    """W[(b, η), (a, ξ)] ± W[(b, η), -(a, ξ)], W = P(ξ, η) G(ξ, η; x_a, y_b), for (a, ξ) from the middle on: each as
    two tensors."""
    import drjit as dr

    u, size = how.pupil.field(beam, types).evaluated(), len(how.pupil.at) * how.rank
    shape = size, size - size // 2
    column, row = Grid(shape, 1.0).coordinates(types)  # counted from the centre
    column, row = column + opaque(types, shape[1] // 2), row + opaque(types, size // 2)
    right = column + opaque(types, size // 2)
    ahead = _entries(u, (right, row), beam, problem, how)
    behind = _entries(u, (opaque(types, size - 1) - right, row), beam, problem, how)
    parts = [ahead.re + behind.re, ahead.im + behind.im, ahead.re - behind.re, ahead.im - behind.im]
    dr.eval(parts)
    tensors = [types.Tensor(part, shape) for part in parts]
    return [(tensors[0], tensors[1]), (tensors[2], tensors[3])]


def _entries(u: Field, at: tuple[Array, Array], beam: Beam, problem: Problem, how: LowRankSampling) -> Field:
    """W at columns and rows, float64 indices, half as many columns as rows."""
    import drjit as dr

    types, n = u.types, len(how.pupil.at)
    size = n * how.rank
    grid = Grid((size, size - size // 2), 1.0)
    (a, i), (b, j) = (_split(index, n, types) for index in at)
    points = types.Float64(how.half_width * chebyshev_points(how.rank))
    from_centre = [dr.gather(types.Float64, points, types.Index(index)) for index in (a, b)]
    x, y = (u + opaque(types, middle) for u, middle in zip(from_centre, problem.window.centre, strict=True))
    xi, eta = how.pupil.places(i, j, beam, types)
    z, wavelength = opaque(types, beam.distance), opaque(types, problem.wavelength)
    rho2 = x * x + y * y + z * z
    excess = xi * xi + eta * eta - 2 * (x * xi + y * eta)
    distance = dr.sqrt(rho2 + excess)
    # Fourier's kernel stays where it is while nodes move with the radius; what they move by is the rest's.
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
    """Quotient and remainder of float64 indices by n."""
    import drjit as dr

    by = dr.opaque(types.Float64, n)
    quotient = dr.floor((index + 0.5) / by)
    return quotient, dr.fma(-quotient, by, index)


def _fourier(at: np.ndarray, problem: Problem, how: LowRankSampling) -> np.ndarray:
    """A[x, (a, ξ)] = L_a(u) e^{-ik s u} at places u along an axis [m], from the window's centre."""
    waves = np.outer(at, how.directions) / -problem.wavelength
    angle = (2 * np.pi * (waves - np.rint(waves))).astype(problem.dtype)
    weight = lagrange_basis(at, how.half_width * chebyshev_points(how.rank)).T.astype(problem.dtype)
    found: np.ndarray = weight[:, :, None] * (np.cos(angle) + 1j * np.sin(angle))[:, None, :]
    return found.reshape(len(at), -1)


def _tensors(matrix: np.ndarray, types: Precision) -> tuple[Array, Array]:
    return (
        types.Tensor(padded_for_packets(matrix.real), matrix.shape),
        types.Tensor(padded_for_packets(matrix.imag), matrix.shape),
    )
