"""A picture held against the direct sum at a few of its points: the error that no prediction can hide."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import MOST_DIGITS, PAIRS_PER_SECOND, direct_sum, node_count, turns
from optics.numerics.accuracy import FLOAT_NOISE
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

__all__ = ["CAUTION", "spot_check"]

POINTS = 40
ALONG_A_RADIUS = 20  # of a symmetric picture
KINDS = 5  # of points: see `_chances`
# Of the estimate's own spread: a sample of 40 points sees the root mean square within a factor of about two.
CAUTION = 3.5
# Power that falls to half within a thirtieth of the window from its sides.
STEEP = 12
# Digits that the check is better than the picture is asked to be: the more of them it can afford.
SPARE_DIGITS = (7.0, 4.0)
# A check may cost this share of the picture it checks, or this many seconds.
SHARE, SECONDS = 0.3, 3e-3


def spot_check(beam: Beam, problem: Problem, image: np.ndarray, seconds: float) -> float | None:
    """Relative L2 error of the intensity over the window, from the direct sum at points drawn as `_chances` says;
    None where that would cost too much.

    image: flat, |U|² / (pupil area); seconds: what it took. Σ (δI)² is estimated by Σ (δI_k)² / (n p_k).
    """
    import drjit as dr

    if problem.reach is not None:
        return None  # the picture is not meant to be right everywhere
    total = float(np.sum(np.square(image, dtype=np.float64)))
    if total == 0:
        return None
    # Nodes err in proportion to the light of the whole aperture, and a window may be far darker.
    coherent = beam.pupil.area / (problem.wavelength * problem.distance) ** 2
    darkness = max(0.0, 0.5 * math.log10(coherent / math.sqrt(total / image.size)))
    affordable = max(SHARE * seconds, SECONDS) * PAIRS_PER_SECOND
    wanted = min(ALONG_A_RADIUS if problem.symmetric else POINTS, image.size)
    for spare in SPARE_DIGITS:
        digits = min(spare - math.log10(problem.tolerance) + darkness, MOST_DIGITS)
        cycles = turns(problem, digits)
        nodes = node_count(problem.aperture, cycles, digits) / (2 if problem.symmetric else 1)
        points = int(min(wanted, affordable / nodes))
        if points == wanted:
            break
    if points < min(8, image.size):
        return None
    chance = _chances(image.astype(np.float64), problem.window.shape)
    if points == image.size:
        chance = np.full(points, 1 / points)  # every point once
    rungs = (np.arange(points) + 0.5) / points
    order = _by_radius(problem.window) if problem.symmetric else np.arange(image.size)
    drawn = order[np.searchsorted(np.cumsum(chance[order]), rungs).clip(max=image.size - 1)]
    row, column = np.divmod(drawn, problem.window.shape[1])
    types = precision("float64")
    x, y = problem.window.x[column], problem.window.y[row]
    if problem.symmetric:
        x, y = np.hypot(x, y), np.zeros_like(y)
    rule = problem.aperture, cycles, digits, problem.symmetric
    with dr.suspend_grad():
        field = direct_sum(beam, rule, types.Float64(x), types.Float64(y), types)
        exact = field.intensity.numpy() / beam.pupil.area
    squared = float(np.mean(np.square(image[drawn] - exact) / chance[drawn]))
    if squared > 0.01 * total:  # an approximation, perhaps much brighter than the truth
        total = min(total, float(np.mean(np.square(exact) / chance[drawn])))
    rounding = max(FLOAT_NOISE["float64"], float(np.finfo(precision(problem.dtype).dtype).eps))
    return CAUTION * math.sqrt(squared / total) + rounding + 2 * 10.0 ** (darkness - digits)


def _chances(bright: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """With which each point is drawn, flat: a fifth each evenly, in proportion to the intensity, to its square, to the
    nearness of a side, and of a corner.

    An even error of the amplitude weighs as the intensity's root: the second fifth sees it where a focus leaves the
    others blind. A focus of one sample has its errors beside it: the square is spread over its neighbours. Phases turn
    fastest at the sides and the corners: a quadrature fails there first, and within a few samples.
    """
    height, width = shape
    squares = np.zeros((height + 2, width + 2))
    squares[1:-1, 1:-1] = np.square(bright).reshape(shape)
    rows = squares[:-2] + squares[1:-1] + squares[2:]
    near = (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]).ravel()
    return _fixed_chances(shape) + bright / (KINDS * bright.sum()) + near / (KINDS * near.sum())


@lru_cache(maxsize=16)
def _by_radius(window: Grid) -> np.ndarray:
    """Flat indices by their distance from the axis: evenly drawn from those, no ring that counts is left out."""
    radii = np.add.outer(np.square(window.y), np.square(window.x)).ravel()
    return np.argsort(np.round(radii / window.dx**2, 6), kind="stable")


@lru_cache(maxsize=16)
def _fixed_chances(shape: tuple[int, int]) -> np.ndarray:
    """Those that do not depend on the picture, flat."""
    y, x = (np.square(np.linspace(-1, 1, n)) if n > 1 else np.ones(1) for n in shape)
    sides, corners = np.maximum.outer(y, x).ravel() ** STEEP, (np.add.outer(y, x).ravel() / 2) ** STEEP
    return (1 / sides.size + sides / sides.sum() + corners / corners.sum()) / KINDS
