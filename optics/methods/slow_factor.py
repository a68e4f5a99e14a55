"""The factor by which the diffraction kernel differs from a Fourier kernel. It varies slowly over the window.

A few Chebyshev points per axis of the window are enough to interpolate it. The number of points per axis is called the
rank of the factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.methods.diffraction_kernel import near_field
from optics.methods.problem import Problem
from optics.methods.pupil_sampling import PupilSamples
from optics.methods.sine_samples import SineSamples
from optics.methods.sine_stack import SineGeometry
from optics.numerics.array_library import turned
from optics.numerics.grid import Grid
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = [
    "RANKS",
    "Path",
    "cross_term",
    "fourier_kernel",
    "slow_factor",
    "slow_parts",
    "uniform_rank",
]

# Choice: ranks to try, in ascending order.
RANKS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24)
# Choice: allowed error of the slow factor at the pupil's rim, relative to the tolerance; see test_low_rank.py.
RANK_RIPPLE = 0.4
FEW_WAVES = 1000.0  # choice: number of waves of a path up to which float32 is sufficient
TRIED = 41  # choice: number of test positions along a line through the window


@dataclass(frozen=True)
class Path:
    """The geometry of a problem: the wavelength [m] in the medium, and the distance [m] and samples of the window.

    Wavelength and distance may be arrays (pupil,). All other arrays then have pupils as their first axis.
    """

    wavelength: float | np.ndarray
    distance: float | np.ndarray
    window: Grid

    @classmethod
    def from_problem(cls, problem: Problem) -> Path:
        return cls(problem.wavelength, problem.distance, problem.window)

    @property
    def key(self) -> tuple[bytes, bytes, Grid]:
        """Wavelength, distance and window in a form that can be hashed."""
        return np.asarray(self.wavelength).tobytes(), np.asarray(self.distance).tobytes(), self.window

    def short(self, steepest: float | np.ndarray) -> bool:
        """Return whether the lengths of paths differ by so few waves that float32 is precise enough.

        steepest: largest sine of the angle between the axis and the line from the window's centre to a sample of the
            pupil.
        """
        reach = steepest + np.hypot(*self.window.centre) / self.distance + self.window.half_diagonal / self.distance
        return bool(np.max(np.square(reach) * self.distance / self.wavelength) < FEW_WAVES)

    def rounded(self, dtype: str) -> Path:
        """Return the same path with numbers of another type."""
        wavelength, distance = (np.asarray(part, dtype) for part in (self.wavelength, self.distance))
        return Path(wavelength, distance, self.window)

    def numbers(self, axes: int) -> tuple[float | np.ndarray, float | np.ndarray]:
        """Return wavelength and distance in a shape that broadcasts with arrays (pupil, ...) that have `axes` axes."""
        wavelength, distance = (
            part.reshape(-1, *[1] * (axes - 1)) if isinstance(part, np.ndarray) else part
            for part in (self.wavelength, self.distance)
        )
        return wavelength, distance


def uniform_rank(problem: Problem, pupil: PupilSamples, half: float, scale: float, most: int) -> int | None:
    """Return the number of Chebyshev points per axis with which the slow factor can be interpolated in the window.

    The slow factor is the factor by which the diffraction kernel differs from a Fourier kernel. The result is None if
    more than `most` points are needed. Interpolation is tested along a few lines through the window, for
    light from points on the outer border of the pupil's soft edge.

    half: half the side [m] of the square around the window's centre in which the Chebyshev points lie.
    scale: distance c [m] in the Fourier kernel e^{-ik ξ·u/c}, where ξ is a point of the pupil and u a point of the
        window. `scale` is not used if `pupil` is a `SineSamples`, whose Fourier kernel depends on the direction from
        the window's centre to ξ instead of ξ/c.
    """
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None]
    rim = pupil.outermost * np.cos(angle), pupil.outermost * np.sin(angle)
    directions = pupil.directions(*rim) if isinstance(pupil, SineSamples) else (rim[0] / scale, rim[1] / scale)
    test, path = half * np.linspace(-1, 1, TRIED), Path.from_problem(problem)
    # If the window lies on the axis, x and y are equivalent, and so are both sides of the window.
    on_axis = problem.window.centre == (0.0, 0.0)
    lines = [(0, 0.0), (0, half)] if on_axis else [(k, side) for k in (0, 1) for side in (-half, 0, half)]

    def rest(at: np.ndarray) -> np.ndarray:
        """Return the slow factor along lines in the window, for light from points on the rim of the pupil.

        The slow factor is the factor by which the diffraction kernel differs from a Fourier kernel. The lines are
        parallel to x or y. at: positions [m] along each line. Shape: (line, rim point, position).
        """
        u, v = np.stack([_line(axis, at, across) for axis, across in lines], axis=1)[:, :, None, :]
        return slow_factor(path, rim, directions, (u, v))

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
    """Return weights for interpolation from `rank` Chebyshev points to the positions where it is tested.

    There are TRIED evenly spaced positions. Shape: (point, position).
    """
    return lagrange_basis(np.linspace(-1, 1, TRIED), chebyshev_points(rank))


def _line(along: int, at: np.ndarray, across: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (x, y) of a line along x (0) or y (1), relative to the window's centre.

    at: positions along the line.
    across: position of the line along the other axis.
    """
    beside = np.full_like(at, across)
    return (at, beside) if along == 0 else (beside, at)


def slow_factor(
    path: Path,
    pupil: tuple[np.ndarray, np.ndarray],
    directions: tuple[np.ndarray, np.ndarray],
    window: tuple[np.ndarray, np.ndarray],
    dtype: str = "float64",
) -> np.ndarray:
    """Return the slow factor (z/D)² (1 + i/(kD)) e^{ik(D - ρ + u·s)} between points ξ of the pupil and u of the window.

    D is the distance from ξ to u, and ρ the distance from the pupil's centre to u. z is the distance between the planes
    of pupil and window, and k the wave number. All arrays are broadcast.

    pupil: points ξ (x, y) [m].
    directions: x and y components of the vector s for each point ξ. The slow factor is a correction to the Fourier
        kernel e^{-ik s·u}.
    window: points u (x, y) [m], relative to the window's centre.
    dtype: type to which the phase is rounded after whole waves are subtracted, "float32" or "float64".
    """
    return np.asarray(turned(*slow_parts(path, pupil, directions, window), dtype))


def slow_parts(
    path: Path,
    pupil: tuple[np.ndarray, np.ndarray],
    directions: tuple[np.ndarray, np.ndarray],
    window: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return amplitude and phase [waves] of the slow factor, the ratio of the diffraction kernel to a Fourier kernel.

    The function `slow_factor` explains the arguments and gives the formula.
    """
    (xi, eta), (u, v), (s, t) = pupil, window, directions
    x, y = u + path.window.centre[0], v + path.window.centre[1]
    wavelength, z = path.numbers(max(part.ndim for part in (xi, eta, x, y)))
    rho2 = x * x + y * y + z * z
    excess = xi * xi + eta * eta - 2 * (x * xi + y * eta)
    distance2 = rho2 + excess
    distance = np.sqrt(distance2)
    excess /= distance + np.sqrt(rho2)
    excess += u * s + v * t
    excess /= wavelength
    size, waves = near_field(wavelength, distance)
    excess += waves
    return z * z / distance2 * size, excess


def cross_term(
    path: Path,
    samples: SineGeometry,
    directions: tuple[np.ndarray, np.ndarray],
    window: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return a and b, where 1 + a b approximates the part of the slow factor that depends on both x and y.

    The slow factor is the factor by which the diffraction kernel differs from a Fourier kernel. F(u, v) is the slow
    factor divided by its value at the middle of the window. The quotient F(u, v) / (F(u, 0) F(0, v)) would be 1 if F
    were a function of x times a function of y. It is about 1 + a b. The product a b is the term -ik (u s) (v t)/D in
    the exponent of F, where k = 2π/λ, and 1/D is the mean inverse distance over the pupil. Because a depends on u and
    s, and b on v and t, the term needs only one further matrix along each axis, as large as the Fourier kernel there.

    directions: s and t, the x and y components of the unit vectors from the window's centre to samples of the pupil,
        minus those of the unit vector to the pupil's centre. Their last two axes broadcast with those of `window`.
    window: u and v, positions along x and y relative to the middle of the window [m].
    """
    (s, t), (u, v) = directions, window
    wavelength, z = path.numbers(s.ndim)
    cosine = np.sqrt(np.maximum(1 - 2 * np.square(samples.elsewhere), 0)).reshape(-1, *[1] * (s.ndim - 1))
    return u * s * (cosine * (-2j * np.pi) / (wavelength * z)), v * t


def fourier_kernel(
    at: np.ndarray, directions: np.ndarray, nodes: np.ndarray, wavelength: float | np.ndarray, dtype: str
) -> np.ndarray:
    """Return A[u, (a, s)] = L_a(u) e^{-ik s u} along one axis, complex (position, node · sample).

    L_a are the Lagrange polynomials of the interpolation points.

    at: positions u [m] relative to the window's centre.
    directions: directions s of the samples.
    nodes: interpolation points [m].
    dtype: "float32" or "float64".
    """
    waves = np.outer(at, directions) / -wavelength
    angle = (2 * np.pi * (waves - np.rint(waves))).astype(dtype)
    weight = lagrange_basis(at, nodes).T.astype(dtype)
    found: np.ndarray = weight[:, :, None] * (np.cos(angle) + 1j * np.sin(angle))[:, None, :]
    return found.reshape(len(at), -1)
