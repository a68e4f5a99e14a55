"""Comparison of a PSF with the direct sum at a few of its points, which finds errors that predictions miss."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import MOST_DIGITS, direct_sum, node_count, turns
from optics.numerics.accuracy import FLOAT_NOISE
from optics.numerics.cost import PAIRS_PER_SECOND
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.quadrature import stepped_up

__all__ = ["CAUTION", "spot_check"]

# Choice, to cover the spread of the estimate: 40 points give the root mean square within a factor of about two. With
# this factor, the stated error bounds the true error: tests/optics/point_spread/test_robustness.py checks this.
CAUTION = 3.5


DIGITS_STEP = 0.25  # choice: step of the digits of a rule, so that cached rules are used


@dataclass(frozen=True)
class Effort:
    """Limits on the effort of a check; all are choices.

    points: number of points; points_along_radius: number of points of a rotationally symmetric PSF.
    fewest: with fewer points, the estimate is useless.
    spare_digits: additional digits of the direct sum relative to the requested accuracy; the first affordable value is
        used.
    share: fraction of the time of the PSF; seconds: time that any check may take.
    """

    points: int = 40
    points_along_radius: int = 20
    fewest: int = 8
    spare_digits: tuple[float, ...] = (7.0, 4.0)
    share: float = 0.3
    seconds: float = 3e-3


EFFORT = Effort()


@dataclass(frozen=True)
class _DirectSum:
    """The reference at a number of points.

    Its nodes are for `cycles` cycles per radius and accurate to `digits`.
    """

    points: int
    cycles: float
    digits: float


def spot_check(beam: Beam, problem: Problem, image: np.ndarray, seconds: float) -> float | None:
    """Return the relative L2 error of the intensity over the window, estimated from the direct sum.

    The points are drawn with the probabilities of `_chances`. None if the check would be too expensive.

    image: flat, |U|² / (pupil area); seconds: time of its computation. Σ (δI)² is estimated by Σ (δI_k)² / (n p_k).
    """
    if problem.reach is not None:
        return None  # such a PSF is not accurate everywhere by design
    total = float(np.sum(np.square(image, dtype=np.float64)))
    if total == 0:
        return None
    darkness = _darkness(beam, problem, math.sqrt(total / image.size))
    reference = _affordable(problem, darkness, seconds, image.size)
    if reference.points < min(EFFORT.fewest, image.size):
        return None
    drawn, chance = _drawn(problem, image, reference.points)
    exact = _exact(beam, problem, reference, drawn)
    squared = float(np.mean(np.square(image[drawn] - exact) / chance))
    # Choice, an error of a tenth: the PSF is then an approximation and may be much brighter than the exact one.
    if squared > 0.01 * total:
        total = min(total, float(np.mean(np.square(exact) / chance)))
    rounding = max(FLOAT_NOISE["float64"], float(np.finfo(precision(problem.dtype).dtype).eps))
    # The error of the direct sum itself: 10^-digits of the amplitude that nodes could add up to, and twice that for the
    # intensity.
    return CAUTION * math.sqrt(squared / total) + rounding + 2 * 10.0 ** (darkness - reference.digits)


def _darkness(beam: Beam, problem: Problem, mean: float) -> float:
    """Return the digits by which the window's amplitude is below that of all light in phase.

    mean: root mean square of the PSF over the window. The error of the nodes is proportional to the light of the whole
        aperture of area A. In phase this light gives U = A/(λz) and a PSF of U²/A = A/(λz)². Amplitudes are square
        roots, hence half the digits.
    """
    in_phase = beam.pupil.area / (problem.wavelength * problem.distance) ** 2
    return max(0.0, 0.5 * math.log10(in_phase / mean))


def _affordable(problem: Problem, darkness: float, seconds: float, samples: int) -> _DirectSum:
    """Return the direct sum with the points and digits that the time of the PSF allows."""
    pairs = max(EFFORT.share * seconds, EFFORT.seconds) * PAIRS_PER_SECOND
    wanted = min(EFFORT.points_along_radius if problem.symmetric else EFFORT.points, samples)
    for spare in EFFORT.spare_digits:
        wished = spare - math.log10(problem.tolerance) + darkness
        digits = min(math.ceil(wished / DIGITS_STEP) * DIGITS_STEP, MOST_DIGITS)
        cycles = stepped_up(turns(problem, digits))
        nodes = node_count(problem.aperture, cycles, digits) / (2 if problem.symmetric else 1)
        found = _DirectSum(int(min(wanted, pairs / nodes)), cycles, digits)
        if found.points == wanted:
            break
    return found


def _drawn(problem: Problem, image: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the flat indices of the points to compare, and the probability with which each was drawn.

    They are drawn evenly along the cumulative probability, so that no likely point is omitted.
    """
    if points == image.size:
        chance = np.full(points, 1 / points)  # every point once
    else:
        chance = _chances(image.astype(np.float64), problem.window.shape)
    order = _by_radius(problem.window) if problem.symmetric else np.arange(image.size)
    levels = (np.arange(points) + 0.5) / points
    drawn = order[np.searchsorted(np.cumsum(chance[order]), levels).clip(max=image.size - 1)]
    return drawn, chance[drawn]


def _exact(beam: Beam, problem: Problem, reference: _DirectSum, drawn: np.ndarray) -> np.ndarray:
    """Return the PSF at the drawn points, by the direct sum in float64."""
    import drjit as dr

    row, column = np.divmod(drawn, problem.window.shape[1])
    types = precision("float64")
    x, y = problem.window.x[column], problem.window.y[row]
    if problem.symmetric:
        x, y = np.hypot(x, y), np.zeros_like(y)
    rule = problem.aperture, reference.cycles, reference.digits, problem.symmetric
    with dr.suspend_grad():
        field = direct_sum(beam, rule, types.Float64(x), types.Float64(y), types)
        exact: np.ndarray = field.intensity.numpy() / beam.pupil.area
    return exact


KINDS = 6  # kinds of points in `_chances`


def _chances(bright: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the probability with which each point is drawn, flat.

    It is the sum of six equal parts: even; in proportion to the intensity; to its square; to the nearness of a side; to
    the nearness of a corner; and to the intensity near sides and corners.

    An even error of the amplitude has an effect proportional to the root of the intensity. The second part detects it
    if a focus hides it from the others. A focus of one sample has its errors next to it, so the square is spread over
    its neighbours. Phases change fastest at sides and corners. Quadratures fail there first, and within a few samples.
    The light of a slit reaches few places at the sides, and errors occur in bright places.
    """
    height, width = shape
    squares = np.zeros((height + 2, width + 2))
    squares[1:-1, 1:-1] = np.square(bright).reshape(shape)
    rows = squares[:-2] + squares[1:-1] + squares[2:]
    near = (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]).ravel()
    rim, fixed = _fixed_chances(shape)
    lit = bright * rim
    found = fixed + bright / bright.sum() + near / near.sum()
    return (found + lit / lit.sum() if lit.any() else found + fixed / 3) / KINDS


@lru_cache(maxsize=16)
def _by_radius(window: Grid) -> np.ndarray:
    """Return flat indices in order of the distance from the axis.

    If points are drawn evenly from these, no important ring is omitted.
    """
    radii = np.add.outer(np.square(window.y), np.square(window.x)).ravel()
    # Rounded so that equal radii are not split by rounding errors.
    return np.argsort(np.round(radii / window.dx**2, 6), kind="stable")


# Choice: exponent of u², with u in [-1, 1] across the window. The power is one half at 1 - |u| = ln 2 / 24, a
# seventieth of the window's width.
STEEP = 12


@lru_cache(maxsize=16)
def _fixed_chances(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearness of sides and corners, flat, and the sum of the three parts that do not depend on the PSF."""
    height, width = shape
    y, x = (np.square(np.linspace(-1, 1, n)) if n > 1 else np.ones(1) for n in shape)
    # Each pair of sides has equal weight, regardless of its length. Half of it belongs to the outermost samples alone.
    sides = np.zeros(shape)
    for steepness in (STEEP, math.inf):
        across, along = x**steepness, y**steepness
        sides += across[None, :] / (across.sum() * height) + along[:, None] / (along.sum() * width)
    corners = (np.add.outer(y, x) / 2) ** STEEP
    rim = sides.ravel() / 4 + corners.ravel() / corners.sum()
    return rim, 1 / rim.size + rim
