"""A picture held against the direct sum at a few of its points: the error that no prediction can hide."""

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

# Choice, over the estimate's own spread: 40 points see the root mean square within a factor of about two. What is said
# then bounds the error: tests/optics/point_spread/test_robustness.py holds it to that.
CAUTION = 3.5


DIGITS_STEP = 0.25  # choice: few different rules of nodes, so that they are found again


@dataclass(frozen=True)
class Effort:
    """How much a check may take; all are choices.

    points: looked at; points_along_radius: of a symmetric picture, which is the same all around.
    fewest: with fewer, the estimate is worth nothing.
    spare_digits: that the direct sum is better than the picture is asked to be: the first that can be afforded.
    share: of the time that the picture took; seconds: that any check may take.
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
    """The reference at so many points: nodes for `cycles` turns per radius, good to `digits`."""

    points: int
    cycles: float
    digits: float


def spot_check(beam: Beam, problem: Problem, image: np.ndarray, seconds: float) -> float | None:
    """Relative L2 error of the intensity over the window, from the direct sum at points drawn as `_chances` says;
    None where that would cost too much.

    image: flat, |U|² / (pupil area); seconds: what it took. Σ (δI)² is estimated by Σ (δI_k)² / (n p_k).
    """
    if problem.reach is not None:
        return None  # the picture is not meant to be right everywhere
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
    if squared > 0.01 * total:  # choice, a tenth: then it is an approximation, perhaps much brighter than the truth
        total = min(total, float(np.mean(np.square(exact) / chance)))
    rounding = max(FLOAT_NOISE["float64"], float(np.finfo(precision(problem.dtype).dtype).eps))
    # The direct sum's own error: 10^-digits of the amplitude that nodes could add up to, twice that of the intensity.
    return CAUTION * math.sqrt(squared / total) + rounding + 2 * 10.0 ** (darkness - reference.digits)


def _darkness(beam: Beam, problem: Problem, mean: float) -> float:
    """Digits by which the window's amplitude, its root mean square PSF `mean`, falls short of all light in phase.

    Nodes err in proportion to the light of the whole aperture of area A. In phase that makes U = A/(λz), and a PSF
    U²/A = A/(λz)²; amplitudes are roots, hence half the digits.
    """
    in_phase = beam.pupil.area / (problem.wavelength * problem.distance) ** 2
    return max(0.0, 0.5 * math.log10(in_phase / mean))


def _affordable(problem: Problem, darkness: float, seconds: float, samples: int) -> _DirectSum:
    """As many points and digits as the picture's time allows."""
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
    """Flat indices of the points to look at, and the chance with which each was drawn.

    They are drawn evenly along the sum of all chances: none that is likely is left out.
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
    """The PSF at the points drawn, by the direct sum in float64."""
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


KINDS = 6  # of points, as `_chances` counts them


def _chances(bright: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """With which each point is drawn, flat: a sixth each evenly, in proportion to the intensity, to its square, to the
    nearness of a side, of a corner, and to the intensity near sides and corners.

    An even error of the amplitude weighs as the intensity's root: the second sixth sees it where a focus leaves the
    others blind. A focus of one sample has its errors beside it: the square is spread over its neighbours. Phases turn
    fastest at the sides and the corners: a quadrature fails there first, and within a few samples; of a slit's light
    few places at the sides have any, and errors are where there is light.
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
    """Flat indices by their distance from the axis: evenly drawn from those, no ring that counts is left out."""
    radii = np.add.outer(np.square(window.y), np.square(window.x)).ravel()
    return np.argsort(np.round(radii / window.dx**2, 6), kind="stable")  # rounded: one ring stays one


# Choice: u² to this power, u in [-1, 1] across the window, is half at 1 - |u| = ln 2 / 24, a seventieth of its width.
STEEP = 12


@lru_cache(maxsize=16)
def _fixed_chances(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The nearness of sides and corners, flat; and the sum of the three chances that do not depend on the picture."""
    height, width = shape
    y, x = (np.square(np.linspace(-1, 1, n)) if n > 1 else np.ones(1) for n in shape)
    # Each pair of sides has its share, however short: half of it the outermost samples alone.
    sides = np.zeros(shape)
    for steepness in (STEEP, math.inf):
        across, along = x**steepness, y**steepness
        sides += across[None, :] / (across.sum() * height) + along[:, None] / (along.sum() * width)
    corners = (np.add.outer(y, x) / 2) ** STEEP
    rim = sides.ravel() / 4 + corners.ravel() / corners.sum()
    return rim, 1 / rim.size + rim
