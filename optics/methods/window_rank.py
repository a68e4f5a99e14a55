"""Number of points (rank) between which the slow factor of the diffraction kernel is interpolated over a window.

The slow factor is the quotient of the diffraction kernel and a Fourier kernel. It varies slowly over the window, so it
is interpolated there. The rank is the number of interpolation points along an axis of the window. This module computes
it for coarse tolerances, from the rays that hit the window.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.light_stack import StackSlopes
from optics.methods.remaining_factor import RemainingFactor
from optics.methods.slow_factor import RANKS, cross_term
from optics.methods.window_geometry import WindowGeometry
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = [
    "DERIVATIVE_ERROR",
    "MOST_RANK",
    "PLACES",
    "RANK_OF_DISTANCE",
    "RANK_SHARE",
    "Derivatives",
    "WindowRays",
    "interpolation_errors",
    "window_ranks",
]

DERIVATIVE_ERROR = 3.0  # choice: bound on the error of derivatives, relative to the tolerance; see test_gradients.py
# Choices: part of the tolerance, or of DERIVATIVE_ERROR, that the rank may take, without and with `cross_term`. With
# this term, the remaining phase depends mostly on the position in the window alone.
RANK_SHARE, CROSSED_SHARE = 0.3, 0.9
PLACES = 6  # choice: number of places along a side of the window that determine the rank for derivatives
OUTSIDE = 1e-3  # choice: weight of rays that miss the window
MOST_RANK = 12  # choice: largest rank
RANK_OF_DISTANCE = 3  # least rank for derivatives by the distance, which are quadratic in the window's positions


@dataclass(frozen=True)
class Derivatives:
    """Requests for those derivatives of a PSF that require more samples than the PSF alone.

    moves: whether derivatives with respect to the distance of the window are requested.
    cells: number of intervals between the knots of an interpolated map (relief or wavefront), along a diameter of the
        pupil; 0 if no derivatives with respect to the samples of a map are requested.
    """

    moves: bool = False
    cells: int = 0


@dataclass(frozen=True, eq=False)
class WindowRays:
    """Some rays from each pupil, and where they hit a window.

    window: positions (u, v) [m] relative to the middle of the window, one for each ray, (beam, ray). Each is the point
        that the ray hits, moved outwards along both axes by the distance over which diffraction spreads the light.
        Positions outside the window are then moved to the nearest side of the window.
    weight: weights of the rays, with a mean of 1, (beam, ray). Rays that miss the window have a small weight.
    mean_sine: weighted root mean square of the x and y components of d, (beam,). For each ray, d is the unit vector
        from the middle of the window to the start of the ray in the pupil, minus the unit vector to the pupil's centre.
    """

    window: tuple[np.ndarray, np.ndarray]
    weight: np.ndarray
    mean_sine: np.ndarray

    @classmethod
    def from_slopes(cls, slopes: StackSlopes, geometry: WindowGeometry) -> WindowRays:
        """Return rays from points that are spread evenly over the disks of the pupils.

        Let L be the optical path from the source, through a point p of the pupil, to the middle of the window. To first
        order, the ray through p hits the window at D/n · ∇L relative to this middle. ∇L is the gradient of L with
        respect to p, D the distance from p to the middle, and n the refractive index behind the pupil.

        slopes: gradients of the optical paths behind the pupils.
        """
        half, planned = geometry.half, geometry.rays(slopes.across)
        blur, pairs = planned.blur, zip((slopes.along_x, slopes.along_y), planned.at, strict=True)
        u, v = (along[:, planned.some] * planned.scale + at for along, at in pairs)
        weight = np.where(np.maximum(np.abs(u), np.abs(v)) <= half + blur, 1.0, OUTSIDE)
        weight /= weight.mean(axis=1)[:, None]
        u, v = (np.clip(place + blur * np.sign(place), -half, half) for place in (u, v))
        return cls((u, v), weight, np.sqrt((weight * planned.sine2).mean(axis=1) / 2))


def window_ranks(
    geometry: WindowGeometry,
    factor: RemainingFactor,
    rays: WindowRays,
    tolerance: np.ndarray,
    derivatives: Derivatives | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of interpolation points that each PSF needs (the rank), and whether a formula replaces them.

    The slow factor is the quotient of the diffraction kernel and a Fourier kernel. It is interpolated between points of
    the window. The rank is the number of these points along an axis. It is 0 if more than MOST_RANK points are needed,
    and 1 if the formula `cross_term` replaces the interpolation. Both results have the shape (beam,).

    The interpolation is tested near the points where the rays hit the window, because the light arrives there.
    Derivatives describe changes of the pupil, which may send light to any point of the window. If derivatives are
    requested, the error is therefore also tested on average over the whole window.

    factor: the quotient F(u, v) / (F(u, 0) F(0, v)). F(u, v) is the slow factor at a position (u, v) relative to the
        middle of the window, for light from the points of the pupils where the rays start.
    tolerance: tolerances of the PSFs, (beam,).
    """
    half, path, directions = geometry.half, factor.path, factor.directions
    # The relative error of the intensity is twice that of the amplitude. A gradient contains the error of the amplitude
    # and that of its derivative, which are independent of each other.
    most, exact = RANK_SHARE * tolerance / 2, factor.at(rays.window)
    most_anywhere = RANK_SHARE * DERIVATIVE_ERROR * tolerance / math.sqrt(2)
    found, least = np.zeros(len(tolerance), int), RANK_OF_DISTANCE if derivatives and derivatives.moves else 1
    crossed = np.zeros(len(tolerance), bool)
    for rank in RANKS:
        if rank > MOST_RANK or found.all():
            break
        if rank < least:
            continue
        nodes = half * chebyshev_points(rank)
        fits = interpolation_errors(factor, rays.window, rays.weight, nodes, exact) < most
        if derivatives is not None and fits.any():
            fits &= _errors_anywhere(geometry, factor, nodes) < most_anywhere
        found[(found == 0) & fits] = rank
        if rank == 1 and derivatives is None and not found.all():
            a, b = cross_term(path, factor.samples, directions, rays.window)
            crossed = (found == 0) & (_rms(exact - 1 - a * b, rays.weight) < most * (CROSSED_SHARE / RANK_SHARE))
            found[crossed] = 1
    return found, crossed


def _errors_anywhere(geometry: WindowGeometry, factor: RemainingFactor, nodes: np.ndarray) -> np.ndarray:
    """Return root mean square errors of interpolating `factor` between nodes, over the whole window, (beam,).

    The errors are computed at evenly spaced places, and not only where light arrives.
    """

    def computed() -> np.ndarray:
        side = geometry.half * ((np.arange(PLACES) + 0.5) * 2 / PLACES - 1)
        across, down = (at.reshape(1, -1, 1) for at in np.meshgrid(side, side))
        s, t = factor.directions
        anywhere = RemainingFactor(factor.path, factor.samples, (s[:, None, :], t[:, None, :]))
        place = across, down
        return interpolation_errors(anywhere, place, np.ones(1), nodes, anywhere.at(place))

    found: np.ndarray = geometry.known.get(("anywhere", factor, len(nodes)), computed)
    return found


def interpolation_errors(
    factor: RemainingFactor,
    place: tuple[np.ndarray, np.ndarray],
    weight: np.ndarray,
    nodes: np.ndarray,
    exact: np.ndarray,
) -> np.ndarray:
    """Return the weighted root mean square errors of interpolating a factor between nodes of the window, (beam,).

    factor: F(u, v) / (F(u, 0) F(0, v)), where F is the slow factor: the diffraction kernel divided by a Fourier kernel.
    place: positions (u, v) [m] relative to the middle of the window, at which the errors are computed.
    weight: weights of the positions, with a mean of 1.
    nodes: interpolation points along an axis [m], relative to the middle of the window.
    exact: values of `factor` at the positions.
    """
    (u, v), total = place, np.zeros(1)
    if len(nodes) == 1:
        return _rms(exact - 1, weight)
    for a, across in enumerate(lagrange_basis(u, nodes)):
        for b, down in enumerate(lagrange_basis(v, nodes)):
            node = np.full((1,) * exact.ndim, nodes[a]), np.full((1,) * exact.ndim, nodes[b])
            total = total + across * down * factor.at(node)
    return _rms(exact - total, weight)


def _rms(wrong: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the weighted root mean square of the absolute values of `wrong` (beam, ...) for each beam, (beam,)."""
    return np.asarray(np.sqrt((weight * np.square(np.abs(wrong))).mean(axis=tuple(range(1, wrong.ndim)))))
