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
from optics.numerics.matrices import complex_matmul
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["LowRankSampling", "low_rank"]

# Choice: ranks to try.
RANKS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24)
RANK_RIPPLE = 0.4  # choice: error of the rest at the pupil's rim, of the tolerance; test_low_rank.py
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
    flops = 8 * (inner * inner * width + height * inner * width)
    seconds = (
        CALL["low_rank"]
        + flops / MATMUL_FLOPS[problem.dtype]
        + inner * inner * KERNEL_ENTRY
        + pupil.seconds
        + inner * (height + width) * FOURIER_ENTRY
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
    """
    window = problem.window
    inner = _kernel(beam, problem, how, types)
    across_x = across_y = _fourier(window.shape[1], problem, how, types)
    if window.shape[0] != window.shape[1]:
        across_y = _fourier(window.shape[0], problem, how, types)
    re, im = complex_matmul(across_y, complex_matmul(inner, across_x, transposed=True))
    return Field(re.array, im.array, window, types)


def _kernel(beam: Beam, problem: Problem, how: LowRankSampling, types: Precision) -> tuple[Array, Array]:
    """W[(b, η), (a, ξ)] = P(ξ, η) G(ξ, η; x_a, y_b) as two tensors."""
    import drjit as dr

    n, rank = len(how.pupil.at), how.rank
    u = how.pupil.field(beam, types)
    dr.eval(u.re, u.im)
    column, row = Grid.square(n * rank, 1.0).coordinates(types)  # counted from the centre
    middle = dr.opaque(types.Float64, (n * rank) // 2)
    (a, i), (b, j) = (_split(place + middle, n, types) for place in (column, row))
    points = types.Float64(how.half_width * chebyshev_points(rank))
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
    slow = Field.from_waves(z / (wavelength * distance * distance), waves, Grid.square(n * rank, 1.0), types)
    near = types.Float(wavelength / (2 * math.pi * distance))
    slow = slow * Field(near, types.Float(-1), slow.grid, types)
    place = types.Index(j * dr.opaque(types.Float64, n) + i)
    whole = slow * Field(dr.gather(types.Float, u.re, place), dr.gather(types.Float, u.im, place), slow.grid, types)
    return types.Tensor(whole.re, slow.grid.shape), types.Tensor(whole.im, slow.grid.shape)


def _split(index: Array, n: int, types: Precision) -> tuple[Array, Array]:
    """Quotient and remainder of float64 indices by n."""
    import drjit as dr

    by = dr.opaque(types.Float64, n)
    quotient = dr.floor((index + 0.5) / by)
    return quotient, dr.fma(-quotient, by, index)


def _fourier(n: int, problem: Problem, how: LowRankSampling, types: Precision) -> tuple[Array, Array]:
    """A[x, (a, ξ)] = L_a(u) e^{-ik s u} as two tensors, at n samples of the window along an axis."""
    at = sample_positions(n, problem.window.dx)
    waves = np.outer(at, how.directions) / -problem.wavelength
    angle = (2 * np.pi * (waves - np.rint(waves))).astype(types.dtype)
    weight = lagrange_basis(at, how.half_width * chebyshev_points(how.rank)).T.astype(types.dtype)
    shape = len(at), weight.shape[1] * angle.shape[1]
    re, im = (weight[:, :, None] * part[:, None, :] for part in (np.cos(angle), np.sin(angle)))
    return types.Tensor(padded_for_packets(re), shape), types.Tensor(padded_for_packets(im), shape)
