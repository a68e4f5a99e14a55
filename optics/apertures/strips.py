"""Quadrature over the part of a rectangle that an outline encloses.

The rectangle is divided into panels, which are horizontal bands. Panels begin and end at the heights at which the
outline enters or leaves the rectangle, and at the heights of the corners, tops and bottoms of the outline. Within a
panel, nodes lie on horizontal chords that end exactly at the edge, so the quadrature converges spectrally.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import ceil, pi

import numpy as np

from optics.apertures.outline import Outline
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count

__all__ = ["strips"]

EDGE_DEGREE = 4  # choice: extra polynomial degree, in addition to the digits, for a curved edge
ROUNDING = 1e-12
TANGENT = 1e-7  # choice: tolerance within which positions of touching shapes coincide
STEEPNESS = 3.0  # choice: ratio of the lengths of successive panels near the top or bottom of a circle

Box = tuple[float, float, float, float]


def strips(
    outline: Outline, box: Box, cycles: float, digits: float, degree: int = 0
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield quadrature nodes over the part of a rectangle that an outline encloses, as arrays x, y and weights.

    The rectangle is cut into panels, which are horizontal bands. Each panel yields one set of nodes for each part of it
    that lies inside the outline. The nodes suit integrands that are a wave of `cycles` cycles per unit of length, times
    a polynomial of the given degree in x and in y. Integrals have an error of at most 10^-digits times the area.

    box: the rectangle (left, right, bottom, top).
    """
    left, right, bottom, top = box
    within = np.concatenate([outline.turning, outline.heights(left), outline.heights(right)])
    ends = np.unique([bottom, top, *within[(within > bottom) & (within < top)]])
    for low, high in pairwise(_graded(ends, outline.tangent)):
        if high - low < ROUNDING:
            continue
        # Along a slanted edge, nodes shift from row to row. This shift adds cycles to the wave.
        inner = low + (high - low) * np.array([1e-6, 1 - 1e-6])
        slide = np.abs(np.diff(np.clip(outline.crossings(inner), left, right), axis=0)).max(initial=0.0)
        turns = cycles * float(np.hypot(slide, high - low))
        y, weight = _panel(low, high, outline.tangent, turns, digits, 2 * degree + EDGE_DEGREE + ceil(digits))
        sides = np.clip(outline.crossings(y), left, right)
        if sides.shape[1] % 2 and high - low < TANGENT:
            continue  # the panel is empty, due to rounding at shapes that touch
        for start, end in zip(sides.T[::2], sides.T[1::2], strict=True):
            if not (end > start).any():
                continue
            u, across = gauss_legendre(gauss_legendre_count(cycles * float((end - start).max()), digits + 0.3, degree))
            x = start[:, None] + (end - start)[:, None] * u
            size = (weight * (end - start))[:, None] * across
            yield x.ravel(), np.broadcast_to(y[:, None], x.shape).ravel(), size.ravel()


def _graded(ends: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Return the heights of the borders of the panels, the horizontal bands into which a rectangle is divided.

    Borders are added to the given ones, to make the panels thinner towards the top and the bottom of a circle. There,
    the length of a horizontal chord changes like a square root of the height, which polynomials do not approximate.

    ends: ascending heights of the given borders.
    tangent: heights of the tops and bottoms of the circles to which arcs of the outline belong.
    """
    more = []
    for at in tangent:
        for low, high in pairwise(ends):
            gap = max(low - at, at - high)
            if ROUNDING < gap < high - low:
                distances = gap * STEEPNESS ** np.arange(
                    1, 1 + ceil(np.log((gap + high - low) / gap) / np.log(STEEPNESS))
                )
                places = at + distances if at < low else at - distances
                more.append(places[(places > low) & (places < high)])
    return np.unique(np.concatenate([ends, *more]))


def _panel(
    low: float, high: float, tangent: np.ndarray, cycles: float, digits: float, degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights and weights of the quadrature nodes in a panel, the horizontal band from `low` to `high`.

    At a circle's top or bottom, the length of a horizontal chord changes like a square root of the height. If the panel
    begins or ends there, the nodes are placed along a new variable u, with the height low + (high - low) sin²(πu/2).
    The chord's length is a smooth function of u.

    tangent: heights of the tops and bottoms of circles.
    cycles: cycles of the integrand between `low` and `high`.
    """
    span = high - low
    touching = any(abs(end - at) < ROUNDING for at in tangent for end in (low, high))
    slower = pi / 2 if touching else 1.0
    u, weight = gauss_legendre(gauss_legendre_count(slower * cycles, digits + 0.3, ceil(slower * degree)))
    if not touching:
        return low + span * u, span * weight
    return low + span * np.sin(pi * u / 2) ** 2, span * weight * np.sin(pi * u) * pi / 2
