"""Quadrature nodes in the cells between the knots of spline maps, for derivatives with respect to the maps' samples.

In a cell, the integrand of a derivative is a wave (the light behind the pupil) times one cubic polynomial or two.
Let t in [-1, 1] be the position across the cell, and z the largest phase difference between the cell's middle and a
border. The wave then varies at most as fast as e^{izt}, whose Chebyshev coefficients have the modulus 2 |J_k(z)|. A
rule of n Gauss-Legendre nodes is exact for polynomials up to degree 2n - 1. If the edge of the aperture cuts a cell,
the nodes are those of a whole cell. Their weights are then exact up to degree n - 1 over the open part of the cell.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import count

import numpy as np

from optics.apertures.aperture import Aperture
from optics.apertures.pixelated import PixelatedAperture
from optics.elements.derivative_knots import DerivativeKnots

__all__ = ["NODES_PART", "derivative_cells"]

NODES_PART = 0.7  # choice: part of the tolerance that the nodes in the cells may use
MOST_NODES = 12  # choice: largest number of nodes along a cell; wider cells are divided
MOST_CELLS = 4096  # choice, limited by memory: largest number of cells along a side
# Chebyshev coefficients of a cubic spline through a single sample: root mean square over the cells between its knots,
# relative to the constant coefficient. test_gradients.py computes them.
SPLINE = (1.0, 0.970, 0.150, 0.076)
# Choices: the error of cut cells is T^CUT_POWER, where T is the sum of the coefficients from degree n on. The power
# lies between 1, for weights that are exact up to degree n - 1, and 2, for cells of which hardly anything is cut off.
# These sums are upper bounds, and actual errors are about REACHED times as large. test_gradients.py compares them with
# exact derivatives.
CUT_POWER, REACHED = 1.8, 0.1
WAVES = np.concatenate([[0.0], np.geomspace(0.01, 40.0, 120)])  # values of z in the table of `_tails`
DEGREES = 96  # number of degrees in this table; coefficients of higher degrees are negligible


def derivative_cells(
    opening: Aperture, knots: DerivativeKnots, cycles: np.ndarray, tolerance: float
) -> PixelatedAperture | None:
    """Return the opening, divided into cells with as few quadrature nodes per cell as accurate derivatives allow.

    These are derivatives of a random functional of the PSF with respect to all samples of maps, which are reliefs,
    wavefronts or masks. Their relative L2 error is at most NODES_PART times the tolerance. Cells are halved if they
    would need more than MOST_NODES nodes along a side. The result is None if more than MOST_CELLS cells along a side
    would be necessary.

    cycles: local frequencies [cycles per radius] of the integrand at points that are evenly spread over the opening.
    """
    for halvings in count():
        cells = _divided(opening, knots.borders, halvings)
        if cells.count > MOST_CELLS:
            return None
        errors = _errors(math.pi * cells.widest * cycles, knots.splines, cells.cut_share)
        enough = np.flatnonzero(errors <= NODES_PART * tolerance)
        if enough.size:
            return replace(cells, fixed=int(enough[0]) + 1)
    return None


@lru_cache(maxsize=64)
def _divided(opening: Aperture, borders: tuple[float, ...], halvings: int) -> PixelatedAperture:
    """Return the opening, divided into cells.

    Each interval between two borders is divided into 2^halvings equal parts, along both axes. These are the cells.
    """
    parts = 2**halvings
    places = np.interp(np.arange((len(borders) - 1) * parts + 1) / parts, np.arange(len(borders)), borders)
    return PixelatedAperture.between(opening, tuple(places.tolist()))


def _errors(z: np.ndarray, splines: int, cut_share: float) -> np.ndarray:
    """Return the relative error of derivatives for each number of quadrature nodes along a cell's side.

    Spline maps are reliefs, wavefronts or masks that splines interpolate between samples. The derivatives are those of
    a functional of the PSF with respect to the samples. Cells are the rectangles into which the knots of the splines
    divide the opening. The result is an array (number of nodes,), for numbers from 1 to MOST_NODES.

    z: half the phase [rad] that the light behind the pupil gains across a cell, at points that are evenly spread over
        the opening.
    splines: number of splines by which this light is multiplied in the integrand of a derivative.
    cut_share: fraction of the opening's area that lies in cells cut by the edge of the aperture.
    """
    place = np.searchsorted(WAVES, z)
    if place.max() >= len(WAVES):
        return np.full(MOST_NODES, np.inf)
    frequency = np.bincount(place, minlength=len(WAVES)) / len(z)
    squared = frequency @ np.square(_tails(splines))
    n = np.arange(1, MOST_NODES + 1)
    whole, cut = np.sqrt(squared[2 * n]), np.sqrt(cut_share * squared[n])
    found: np.ndarray = REACHED * (whole + cut**CUT_POWER)
    return found


@lru_cache(maxsize=2)
def _tails(splines: int) -> np.ndarray:
    """Return upper bounds on the sum of a wave's Chebyshev coefficients from each degree on, array (wave, degree).

    The wave e^{izt} is multiplied by splines. t in [-1, 1] is the position across a cell, a rectangle between knots of
    the splines. z is half the phase [rad] that the wave gains across the cell. The table WAVES contains the values of
    z, one for each wave.

    splines: number of splines by which the wave is multiplied.
    """
    from scipy.special import jv

    wave = 2 * np.abs(jv(np.arange(DEGREES), WAVES[:, None]))
    # Below the order z, the coefficients oscillate. Their envelope falls with the degree.
    found = np.minimum(np.maximum.accumulate(wave[:, ::-1], axis=1)[:, ::-1], 1.0)
    for _ in range(splines):
        found = np.stack([np.convolve(row, SPLINE) for row in found])
    tails: np.ndarray = np.cumsum(found[:, ::-1], axis=1)[:, ::-1]
    return tails
