"""Integrals over a retina's cells of what is known at samples: of the spline through them, as a matrix."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from optics.numerics.grid import Grid

__all__ = ["Tiles", "cell_integrals", "samples_per_cycle"]

DEGREE = 7
SHORT = 8 * DEGREE  # samples, of which the middle ones lie far from both ends
# Of the spline through 3.1 samples per cycle of the highest frequency, over tiles of any size, the error is 3e-5 of
# the integrals' root mean square, and it falls with the eighth power of the samples' distance. With fewer it grows by
# ten for every 0.425; test_cell_integrals.py.
FINE, FINE_TOLERANCE, ORDER = 3.1, 1e-4, 8
FEWEST, PER_DECADE = 2.25, 0.425
# Cells of whole cycles average away most of what fewer samples fold onto other frequencies: (cycles, tolerance, fewer),
# of which each holds from the first two on. validation/optics/cell_samples.py has the errors.
FEWER = ((2.0, 1e-2, 0.5), (1.0, 1e-3, 0.25))


def samples_per_cycle(tolerance: float, cycles: float = 0.0) -> float:
    """Of the highest frequency, so that integrals over cells of so many cycles err by no more than a third of the
    tolerance."""
    if tolerance <= FINE_TOLERANCE:
        return FINE * (FINE_TOLERANCE / tolerance) ** (1 / ORDER)
    fewer = next((fewer for least, loose, fewer in FEWER if cycles >= least and tolerance >= loose), 0.0)
    return max(FEWEST, FINE - PER_DECADE * math.log10(tolerance / FINE_TOLERANCE)) - fewer


@dataclass(frozen=True)
class Tiles:
    """Cells in a row, their size [m], and whether light comes from all over a cell of that size or from a point."""

    count: int
    size: float
    from_cell: bool


@lru_cache(maxsize=16)
def cell_integrals(samples: int, pitch: float, tiles: Tiles) -> np.ndarray:
    """(cell, sample): integrals over tiles around the middle of the spline through the samples, one axis. From a cell:
    means over sources all over it, PSF ⊗ cell ⊗ cell.

    A spline's coefficients c solve C c = s, C its B-splines at the samples; if tiles hold Q c, the matrix is Q C⁻¹.
    """
    grid = Grid((1, samples), pitch)
    degree = min(DEGREE, (samples - 2) // 2 * 2 + 1)
    knots = _knots(grid.x, degree)
    # An odd number of samples lies alike on both sides, and so do all tiles: half of them tell the others.
    own = (tiles.count + 1) // 2 if samples % 2 else tiles.count
    edges = (np.arange(own + 1 + tiles.from_cell) - (tiles.count + tiles.from_cell) / 2) * tiles.size
    inside = np.clip(edges, grid.x[0], grid.x[-1])
    primitive = _primitive(knots, degree, inside, 1)
    if tiles.from_cell:
        # Beyond the samples is no light: there the primitive stays what it is, and its own rises in a straight line.
        second = _primitive(knots, degree, inside, 2) + primitive * (edges - inside)[:, None]
        held = np.diff(second, 2, axis=0) / tiles.size
    else:
        held = np.diff(primitive, axis=0)
    found = _over_samples(held, degree)
    return np.concatenate([found, found[: tiles.count - own][::-1, ::-1]])


def _knots(x: np.ndarray, degree: int) -> np.ndarray:
    """Of the spline through samples at x: one at each but the first and last few, between which it does not change."""
    skipped = (degree + 1) // 2
    return np.concatenate([np.repeat(x[0], degree + 1), x[skipped:-skipped], np.repeat(x[-1], degree + 1)])


def _over_samples(held: np.ndarray, degree: int) -> np.ndarray:
    """Q C⁻¹ of Q = held."""
    from scipy.linalg import solve_banded

    samples = held.shape[1]
    lower, upper, band = _collocation(min(samples, SHORT), degree)
    if samples > SHORT:  # far from both ends all samples lie alike under their B-splines
        inside = np.repeat(band[:, SHORT // 2 : SHORT // 2 + 1], samples - SHORT, axis=1)
        band = np.concatenate([band[:, : SHORT // 2], inside, band[:, SHORT // 2 :]], axis=1)
    found: np.ndarray = solve_banded((lower, upper), band, held.T, check_finite=False).T
    return found


@lru_cache(maxsize=64)
def _collocation(samples: int, degree: int) -> tuple[int, int, np.ndarray]:
    """C, of samples at any pitch, as a band: every sample lies under degree + 1 B-splines. Its sides, its diagonals."""
    x, sample = np.arange(samples, dtype=float), np.arange(samples)[:, None]
    there = _bsplines(_knots(x, degree), degree, x)
    above = there.indices.reshape(samples, degree + 1) - sample
    lower, upper = int(above.max()), -int(above.min())
    band = np.zeros((lower + upper + 1, samples))
    band[upper + above, sample] = there.data.reshape(above.shape)
    return lower, upper, band


def _primitive(knots: np.ndarray, degree: int, at: np.ndarray, times: int) -> np.ndarray:
    """(place, B-spline): integrals of B-splines from the first knot on, once or twice: B_j's is that of all later ones
    of the next degree, times a share of its width (de Boor, A Practical Guide to Splines, ch. X)."""
    knots = np.concatenate([knots[:1]] * times + [knots] + [knots[-1:]] * times)
    found: np.ndarray = _bsplines(knots, degree + times, at).toarray()
    for k in reversed(range(degree, degree + times)):
        knots = knots[1:-1]
        width = (knots[k + 1 :] - knots[: -k - 1]) / (k + 1)
        found = np.cumsum(found[:, :0:-1], axis=1)[:, ::-1] * width
    return found


def _bsplines(knots: np.ndarray, degree: int, at: np.ndarray) -> Any:
    """(place, B-spline), sparse."""
    from scipy.interpolate import BSpline

    return BSpline.design_matrix(at, knots, degree)
