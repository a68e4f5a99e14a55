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
from optics.numerics.autodiff import Array
from optics.numerics.cost import CALL, FOURIER_ENTRY, KERNEL_ENTRY, MATMUL_FLOPS
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.interpolation import chebyshev_points, lagrange_basis
from optics.numerics.matrices import complex_matmul
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["LowRankSampling", "low_rank"]

# Choice: ranks to try.
RANKS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24)
RANK_RIPPLE = 0.4  # choice: error of the rest at the pupil's rim, of the tolerance; test_low_rank.py
TRIED = 41  # choice: places along a line through the window
MOST_ENTRIES = 4_000_000  # choice, by memory: of the matrix between pupil and window
MOST_PIXEL_ENTRIES = 16_000_000  # for them only the direct sum is left


@dataclass(frozen=True)
class LowRankSampling:
    """Pupil samples; `rank` Chebyshev points per axis of the window, `half_width` [m] about its centre, and the
    distance c [m] of Fourier's kernel e^{-ik ξ·x/c}."""

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
        return problem.wavelength * problem.distance / float(np.diff(self.pupil.at).mean())

    @property
    def samples(self) -> tuple[int, int]:
        return len(self.pupil.at), len(self.pupil.at)

    @property
    def largest(self) -> int:
        return self.rank * len(self.pupil.at)


def low_rank(problem: Problem) -> list[LowRankSampling]:
    """As few pupil samples as the turns of pupil and path together allow, and the rank that the slow rest needs."""
    pupil = samples_of(problem)
    if pupil is None:
        return []
    half = max(problem.window.own_half_width, problem.window.dx)
    # Fourier's kernel for a distance between that to the window's centre and that to its sides. Choice: where between.
    scale = math.hypot(problem.distance, 0.6 * half, *problem.window.centre)
    most = math.isqrt(MOST_ENTRIES if problem.pixelated is None else MOST_PIXEL_ENTRIES) // len(pupil.at)
    rank = _rank(problem, pupil.outermost, half, scale, most)
    if rank is None:
        return []
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
    return [LowRankSampling(pupil, rank, half, scale, seconds)]


def _rank(problem: Problem, outermost: float, half: float, scale: float, most: int) -> int | None:
    """Chebyshev points along an axis that interpolate the slow rest, tried on the soft aperture's rim."""
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None]
    rim = outermost * np.cos(angle), outermost * np.sin(angle)
    test = half * np.linspace(-1, 1, TRIED)
    centre = problem.window.centre
    # On the axis both directions are alike, and so are both sides.
    places = [(0, 0.0), (0, half)] if centre == (0.0, 0.0) else [(k, side) for k in (0, 1) for side in (-half, 0, half)]
    exact = np.stack([_rest(problem, scale, rim, _line(centre, along, test, across)) for along, across in places])
    for rank in RANKS:
        if rank > most:
            return None
        points = half * chebyshev_points(rank)
        known = np.stack([_rest(problem, scale, rim, _line(centre, along, points, across)) for along, across in places])
        if np.abs(exact - known @ _between(rank)).max() < RANK_RIPPLE * problem.tolerance:
            return rank
    return None


@lru_cache(maxsize=len(RANKS))
def _between(rank: int) -> np.ndarray:
    """What each of so many Chebyshev points counts at the places that are tried, (point, place)."""
    return lagrange_basis(np.linspace(-1, 1, TRIED), chebyshev_points(rank))


def _line(centre: tuple[float, float], along: int, at: np.ndarray, across: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (x, y) of a line through the window, along x (0) or y (1)."""
    place = [centre[0] + 0 * at, centre[1] + 0 * at]
    place[along] = place[along] + at
    place[1 - along] = place[1 - along] + across
    return place[0], place[1]


def _rest(
    problem: Problem, scale: float, pupil: tuple[np.ndarray, np.ndarray], window: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """(z/D)² e^{ik(D - ρ + ξ·x/c)} between points of pupil and window."""
    (xi, eta), (x, y) = pupil, window
    z = problem.distance
    rho2 = x * x + y * y + z * z
    excess = xi**2 + eta**2 - 2 * (x * xi + y * eta)
    distance = np.sqrt(rho2 + excess)
    waves = (excess / (distance + np.sqrt(rho2)) + (x * xi + y * eta) / scale) / problem.wavelength
    return z * z / distance**2 * np.exp(2j * np.pi * waves)


def _low_rank(beam: Beam, problem: Problem, how: LowRankSampling, types: Precision) -> Field:
    """U(x) = Σ_ab L_a(x) L_b(y) Σ_ξ P(ξ) G(ξ; x_a, y_b) e^{-ik ξ·x/c}, up to a phase that intensity forgets:

        G(ξ; x) = z/(λD²) (1/(kD) - i) e^{ik(D - ρ + ξ·x/c)},   D = |(x - ξ, z)|, ρ = |(x, z)|,

    which varies slowly with x. Sums over a and ξ along one axis are one: A_y W A_xᵀ, two matrix products.
    """
    window = problem.window
    inner = _kernel(beam, problem, how, types)
    across_x = across_y = _fourier(window.x, window.centre[0], problem, how, types)
    if window.shape[0] != window.shape[1] or window.centre[0] != window.centre[1]:
        across_y = _fourier(window.y, window.centre[1], problem, how, types)
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
    x, y = (dr.gather(types.Float64, points, types.Index(index)) for index in (a, b))
    x, y = x + opaque(types, problem.window.centre[0]), y + opaque(types, problem.window.centre[1])
    xi, eta = (how.pupil.places(index, beam, types) for index in (i, j))
    z, wavelength = opaque(types, beam.distance), opaque(types, problem.wavelength)
    rho2 = x * x + y * y + z * z
    along = x * xi + y * eta
    excess = xi * xi + eta * eta - 2 * along
    distance = dr.sqrt(rho2 + excess)
    # Fourier's kernel stays where it is while nodes move with the radius; what they move by is the rest's.
    fixed = x * dr.detach(xi) + y * dr.detach(eta)
    waves = (excess / (distance + dr.sqrt(rho2)) + fixed * opaque(types, 1 / how.scale)) / wavelength
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


def _fourier(
    at: np.ndarray, middle: float, problem: Problem, how: LowRankSampling, types: Precision
) -> tuple[Array, Array]:
    """A[x, (a, ξ)] = L_a(x) e^{-ik ξ x/c} as two tensors."""
    waves = np.outer(at, how.pupil.at) / (-problem.wavelength * how.scale)
    angle = (2 * np.pi * (waves - np.rint(waves))).astype(types.dtype)
    weight = lagrange_basis(at - middle, how.half_width * chebyshev_points(how.rank)).T.astype(types.dtype)
    shape = len(at), weight.shape[1] * angle.shape[1]
    re, im = (weight[:, :, None] * part[:, None, :] for part in (np.cos(angle), np.sin(angle)))
    return types.Tensor(padded_for_packets(re), shape), types.Tensor(padded_for_packets(im), shape)
