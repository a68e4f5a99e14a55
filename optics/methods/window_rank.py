"""The rank of the slow factor for samples that follow from the light in a window, at coarse tolerances."""

from __future__ import annotations

import math

import numpy as np

from optics.methods.problem import Problem
from optics.methods.sine_samples import SineSamples
from optics.methods.slow_factor import RANKS, Path, remaining_factor
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = ["DERIVATIVE_ERROR", "window_rank"]

DERIVATIVE_ERROR = 3.0  # choice: bound on the error of derivatives, relative to the tolerance; see test_gradients.py
RANK_SHARE = 0.3  # choice: part of the allowed errors that the choice of the rank may cause
RAYS, PLACES = 40, 6  # choices: numbers of rays, and of places along a side of the window, that determine the rank
BLUR = 1.2  # choice, in λz/2R: distance from the end points of rays at which diffraction spreads their light
MOST_RANK = 12  # choice: largest rank
RANK_OF_DISTANCE = 3  # least rank for derivatives by the distance, which are quadratic in the window's positions


def window_rank(problem: Problem, samples: SineSamples, half: float) -> int | None:
    """Return the necessary rank; None if it exceeds MOST_RANK.

    The rank is sufficient at the end points of rays, around which the light arrives. If derivatives are requested,
    light may move anywhere. The rank is then also sufficient on average over the whole window.

    half: distance [m] from the middle of the window within which the interpolation points lie.
    """
    xi, eta, u, v = problem.sampled_slopes.end_points(problem.distance, problem.window.centre, problem.medium_n, RAYS)
    blur = BLUR * problem.wavelength * problem.distance / (2 * problem.radius)
    u, v = (np.clip(at + blur * np.sign(at), -half, half) for at in (u, v))
    # The relative error of the intensity is twice that of the amplitude. A gradient contains the error of the amplitude
    # and that of its derivative, which are independent of each other.
    allowed = [((u, v), RANK_SHARE * problem.tolerance / 2)]
    if problem.differentiated:
        side = half * ((np.arange(PLACES) + 0.5) * 2 / PLACES - 1)
        across, down = (at.reshape(-1, 1) for at in np.meshgrid(side, side))
        allowed.append(((across, down), RANK_SHARE * DERIVATIVE_ERROR * problem.tolerance / math.sqrt(2)))
    for rank in RANKS:
        if rank > MOST_RANK:
            return None
        if problem.moves and rank < RANK_OF_DISTANCE:
            continue
        if all(_error(problem, samples, half * chebyshev_points(rank), (xi, eta), at) < most for at, most in allowed):
            return rank
    return None


def _error(
    problem: Problem,
    samples: SineSamples,
    nodes: np.ndarray,
    points: tuple[np.ndarray, np.ndarray],
    window: tuple[np.ndarray, np.ndarray],
) -> float:
    """Return the root mean square error of the slow factor (without axis factors) interpolated from nodes.

    nodes: positions [m] of the nodes along either axis, relative to the middle of the window.
    points: points (x, y) [m] of the pupil.
    window: positions (u, v) [m] relative to the middle of the window, which broadcast with the points.
    """
    path, directions = Path.from_problem(problem), samples.directions(*points)
    (u, v), total = window, 0.0
    for a, across in enumerate(lagrange_basis(u, nodes)):
        for b, down in enumerate(lagrange_basis(v, nodes)):
            place = np.full(1, nodes[a]), np.full(1, nodes[b])
            total = total + across * down * remaining_factor(path, samples, directions, place)
    exact = remaining_factor(path, samples, directions, window)
    return math.sqrt(float(np.mean(np.square(np.abs(exact - total)))))
