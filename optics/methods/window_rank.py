"""The rank of the slow factor for samples that follow from the light in a window, at coarse tolerances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.light_stack import LightStack
from optics.methods.sine_stack import SineGeometry
from optics.methods.slow_factor import RANKS, Path, cross_term, remaining_factor
from optics.numerics.grid import Grid
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = ["DERIVATIVE_ERROR", "Derivatives", "WindowRays", "window_ranks"]

DERIVATIVE_ERROR = 3.0  # choice: bound on the error of derivatives, relative to the tolerance; see test_gradients.py
# Choices: part of the tolerance, or of DERIVATIVE_ERROR, that the rank may take, without and with `cross_term`. With
# this term, the remaining phase depends mostly on the position in the window alone.
RANK_SHARE, CROSSED_SHARE = 0.3, 0.9
RAYS, PLACES = 100, 6  # choices: numbers of rays, and of places along a side of the window, that determine the rank
BLUR = 1.2  # choice, in λz/2R: distance from the end points of rays at which diffraction spreads their light
OUTSIDE = 1e-3  # choice: weight of rays that miss the window
MOST_RANK = 12  # choice: largest rank
RANK_OF_DISTANCE = 3  # least rank for derivatives by the distance, which are quadratic in the window's positions


@dataclass(frozen=True)
class Derivatives:
    """Additional needs of a PSF whose derivatives are requested.

    moves: whether derivatives with respect to the distance are requested.
    cells: cells between the knots of maps, across the pupil; 0 if no derivatives with respect to samples are requested.
    """

    moves: bool = False
    cells: int = 0


@dataclass(frozen=True, eq=False)
class WindowRays:
    """Some rays from each pupil, and where they hit a window.

    directions: sines (s, t) of the lines from the middle of the window, relative to those of the pupil's centre,
        (beam, ray).
    window: positions (u, v) [m] relative to the middle of the window, (beam, ray). They are the hit points of the rays,
        moved outwards by the width of diffraction and, if they then lie outside the window, to its nearest side.
    weight: weights of the rays, with a mean of 1, (beam, ray).
    """

    directions: tuple[np.ndarray, np.ndarray]
    window: tuple[np.ndarray, np.ndarray]
    weight: np.ndarray

    @classmethod
    def from_stack(cls, stack: LightStack, window: Grid) -> WindowRays:
        """Return rays from points that are spread evenly over the disks.

        To first order, a ray hits the window at D/n times the slope of its path to the middle of the window, where D is
        the distance from the ray's point of the pupil to this middle.
        """
        slopes, half = stack.slopes, max(window.own_half_width, window.dx)
        some = slice(None, None, max(1, len(slopes.x) // RAYS))
        radius, index = stack.radius[:, None], stack.index[:, None]
        dx, dy = radius * slopes.x[some] - window.centre[0], radius * slopes.y[some] - window.centre[1]
        length = np.sqrt(dx * dx + dy * dy + np.square(stack.distance)[:, None])
        u, v = slopes.along_x[:, some] * length / index + dx, slopes.along_y[:, some] * length / index + dy
        blur = BLUR * (stack.wavelength * stack.distance / (2 * stack.radius))[:, None]
        weight = np.where(np.maximum(np.abs(u), np.abs(v)) <= half + blur, 1.0, OUTSIDE)
        weight /= weight.mean(axis=1)[:, None]
        at = (np.clip(place + blur * np.sign(place), -half, half) for place in (u, v))
        middle = np.sqrt(np.square(stack.distance) + window.centre[0] ** 2 + window.centre[1] ** 2)[:, None]
        directions = dx / length + window.centre[0] / middle, dy / length + window.centre[1] / middle
        return cls(directions, tuple(at), weight)

    @property
    def mean_sine(self) -> np.ndarray:
        """Root mean square of the sines along an axis, (beam,)."""
        s, t = self.directions
        return np.asarray(np.sqrt((self.weight * (s * s + t * t)).mean(axis=1) / 2))


def window_ranks(
    stack: LightStack,
    geometry: SineGeometry,
    rays: WindowRays,
    window: Grid,
    tolerance: np.ndarray,
    derivatives: Derivatives | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the necessary ranks, (beam,), and whether `cross_term` is necessary. A rank that is too large is 0.

    The rank is sufficient at the end points of rays, around which the light arrives. If derivatives are requested,
    light may move anywhere. The rank is then also sufficient on average over the whole window.

    tolerance: tolerances, (beam,).
    """
    half, path = max(window.own_half_width, window.dx), Path(stack.wavelength, stack.distance, window)
    # The relative error of the intensity is twice that of the amplitude. A gradient contains the error of the amplitude
    # and that of its derivative, which are independent of each other.
    tests = [(rays.directions, rays.window, rays.weight, RANK_SHARE * tolerance / 2)]
    if derivatives is not None:
        side = half * ((np.arange(PLACES) + 0.5) * 2 / PLACES - 1)
        across, down = (at.reshape(1, -1, 1) for at in np.meshgrid(side, side))
        s, t = rays.directions
        most = RANK_SHARE * DERIVATIVE_ERROR * tolerance / math.sqrt(2)
        tests.append(((s[:, None, :], t[:, None, :]), (across, down), np.ones(1), most))
    exact = [remaining_factor(path, geometry, directions, at) for directions, at, *_ in tests]
    found, least = np.zeros(len(tolerance), int), RANK_OF_DISTANCE if derivatives and derivatives.moves else 1
    crossed = np.zeros(len(tolerance), bool)
    for rank in RANKS:
        if rank > MOST_RANK or found.all():
            break
        if rank < least:
            continue
        nodes = half * chebyshev_points(rank)
        fits = [_errors(path, geometry, nodes, test, whole) < test[3] for test, whole in zip(tests, exact, strict=True)]
        found[(found == 0) & np.all(fits, axis=0)] = rank
        if rank == 1 and derivatives is None and not found.all():
            a, b = cross_term(path, geometry, rays.directions, rays.window)
            crossed = (found == 0) & (
                _rms(exact[0] - 1 - a * b, rays.weight) < tests[0][3] * (CROSSED_SHARE / RANK_SHARE)
            )
            found[crossed] = 1
    return found, crossed


def _errors(
    path: Path,
    geometry: SineGeometry,
    nodes: np.ndarray,
    at: tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray],
    exact: np.ndarray,
) -> np.ndarray:
    """Return the root mean square errors of the slow factor that is interpolated from nodes of the window, (beam,).

    at: directions of points of the pupils, positions (u, v) [m] relative to the middle of the window, and weights.
    exact: the slow factor at these points and positions.
    """
    (directions, (u, v), weight, _), total = at, np.zeros(1)
    if len(nodes) == 1:
        return _rms(exact - 1, weight)
    for a, across in enumerate(lagrange_basis(u, nodes)):
        for b, down in enumerate(lagrange_basis(v, nodes)):
            place = np.full((1,) * exact.ndim, nodes[a]), np.full((1,) * exact.ndim, nodes[b])
            total = total + across * down * remaining_factor(path, geometry, directions, place)
    return _rms(exact - total, weight)


def _rms(wrong: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the weighted root mean square of the absolute values, (beam,)."""
    return np.asarray(np.sqrt((weight * np.square(np.abs(wrong))).mean(axis=tuple(range(1, wrong.ndim)))))
