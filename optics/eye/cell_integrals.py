"""Integrals of sampled functions over the cells of a retina, the equal rectangles into which it is divided.

A matrix maps samples to the integrals of the spline through them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from optics.numerics.grid import sample_positions

__all__ = ["Tiles", "cell_integrals", "samples_per_cycle"]

DEGREE = 7
SHORT = 8 * DEGREE  # number of samples above which the middle ones lie far from both ends
# With 3.1 samples per cycle of the highest frequency, the error of integrals over cells of any size is 3e-5 of their
# root mean square. With more samples, it falls with the eighth power of the samples' distance. It grows tenfold when
# the number of samples per cycle is reduced by 0.425; see test_cell_integrals.py.
FINE, FINE_TOLERANCE, ORDER = 3.1, 1e-4, 8
FEWEST, PER_DECADE = 2.25, 0.425
# Over cells that are at least a cycle wide, most of the aliasing of coarser samples averages out. Each row (cycles,
# tolerance, fewer) states how many fewer samples per cycle are sufficient. It applies to cells of at least this number
# of cycles and to tolerances of at least this size. validation/optics/cell_samples.py prints the errors.
FEWER = ((2.0, 1e-2, 0.5), (1.0, 1e-3, 0.25))


def samples_per_cycle(tolerance: float, cycles: float = 0.0) -> float:
    """Return the number of samples of an image that are required per cycle of its highest spatial frequency.

    The integrals of the image over the cells of a retina are then accurate. Cells are the equal rectangles into which
    the retina is divided.

    tolerance: three times the error of the integrals, relative to their root mean square.
    cycles: width of a cell, in cycles of the highest frequency.
    """
    if tolerance <= FINE_TOLERANCE:
        return FINE * (FINE_TOLERANCE / tolerance) ** (1 / ORDER)
    fewer = next((fewer for least, loose, fewer in FEWER if cycles >= least and tolerance >= loose), 0.0)
    return max(FEWEST, FINE - PER_DECADE * math.log10(tolerance / FINE_TOLERANCE)) - fewer


@dataclass(frozen=True)
class Tiles:
    """A row of cells, the equal rectangles into which a retina is divided.

    count: number of cells.
    size: side of a cell along the row [m].
    from_cell: True if the source of the light is an area of the scene. The geometric image of this area is as large as
        a cell of the retina. False if the source is a single point.
    """

    count: int
    size: float
    from_cell: bool


@lru_cache(maxsize=16)
def cell_integrals(samples: int, pitch: float, tiles: Tiles) -> np.ndarray:
    """Return a matrix (cell, sample) that maps samples of a PSF along one axis to the PSF's integrals over cells.

    The integrand is the spline through the samples. The cells form a row that is centred on the middle sample.

    If tiles.from_cell is True, the source of the light is an area of the scene whose geometric image is as large as a
    cell. The integrals are then averaged over the points of this area. The PSF is thus convolved twice with the width
    of a cell.

    The spline's coefficients c solve C c = s, where s are the samples and C contains the B-splines at them. The
    integrals are Q c, where Q contains the B-splines' integrals over cells. The matrix is therefore Q C⁻¹.

    samples: number of samples.
    pitch: distance [m] between neighbouring samples.
    """
    x = sample_positions(samples, pitch)
    degree = min(DEGREE, (samples - 2) // 2 * 2 + 1)
    knots = _knots(x, degree)
    # With an odd number of samples, cells and samples are symmetric. One half of the rows then determines the other.
    own = (tiles.count + 1) // 2 if samples % 2 else tiles.count
    edges = (np.arange(own + 1 + tiles.from_cell) - (tiles.count + tiles.from_cell) / 2) * tiles.size
    inside = np.clip(edges, x[0], x[-1])
    primitive = _primitive(knots, degree, inside, 1)
    if tiles.from_cell:
        # Beyond the samples there is no light. The first integral is constant there, and the second one is linear.
        second = _primitive(knots, degree, inside, 2) + primitive * (edges - inside)[:, None]
        integrals = np.diff(second, 2, axis=0) / tiles.size
    else:
        integrals = np.diff(primitive, axis=0)
    found = _over_samples(integrals, degree)
    return np.concatenate([found, found[: tiles.count - own][::-1, ::-1]])


def _knots(x: np.ndarray, degree: int) -> np.ndarray:
    """Return the knots of the spline through samples at x: one per sample, except near the ends (not-a-knot)."""
    skipped = (degree + 1) // 2
    return np.concatenate([np.repeat(x[0], degree + 1), x[skipped:-skipped], np.repeat(x[-1], degree + 1)])


def _over_samples(integrals: np.ndarray, degree: int) -> np.ndarray:
    """Return the matrix Q C⁻¹ (cell, sample), which maps samples to the integrals of the spline through them.

    Each integral is over one cell. Cells are the equal rectangles into which the retina is divided. The spline is a sum
    of B-splines. C contains the values of the B-splines at the samples.

    integrals: Q, the integrals of the B-splines over the cells, array (cell, B-spline).
    """
    from scipy.linalg import solve_banded

    samples = integrals.shape[1]
    lower, upper, band = _collocation(min(samples, SHORT), degree)
    if samples > SHORT:  # far from both ends, all rows of C have the same entries
        inside = np.repeat(band[:, SHORT // 2 : SHORT // 2 + 1], samples - SHORT, axis=1)
        band = np.concatenate([band[:, : SHORT // 2], inside, band[:, SHORT // 2 :]], axis=1)
    found: np.ndarray = solve_banded((lower, upper), band, integrals.T, check_finite=False).T
    return found


@lru_cache(maxsize=64)
def _collocation(samples: int, degree: int) -> tuple[int, int, np.ndarray]:
    """Return the B-splines at the samples as a matrix C in band form, with its numbers of lower and upper diagonals.

    Every sample lies within the support of degree + 1 B-splines. C is the same for every pitch.
    """
    x, sample = np.arange(samples, dtype=float), np.arange(samples)[:, None]
    there = _bsplines(_knots(x, degree), degree, x)
    above = there.indices.reshape(samples, degree + 1) - sample
    lower, upper = int(above.max()), -int(above.min())
    band = np.zeros((lower + upper + 1, samples))
    band[upper + above, sample] = there.data.reshape(above.shape)
    return lower, upper, band


def _primitive(knots: np.ndarray, degree: int, at: np.ndarray, times: int) -> np.ndarray:
    """Return single or double integrals of B-splines from the first knot to each position, (position, B-spline).

    The integral of B_j, a B-spline of degree k and width w, is w/(k + 1) times a sum. The sum is that of all B-splines
    of degree k + 1 with index j or higher (de Boor, A Practical Guide to Splines, ch. X).
    """
    knots = np.concatenate([knots[:1]] * times + [knots] + [knots[-1:]] * times)
    found: np.ndarray = _bsplines(knots, degree + times, at).toarray()
    for k in reversed(range(degree, degree + times)):
        knots = knots[1:-1]
        width = (knots[k + 1 :] - knots[: -k - 1]) / (k + 1)
        found = np.cumsum(found[:, :0:-1], axis=1)[:, ::-1] * width
    return found


def _bsplines(knots: np.ndarray, degree: int, at: np.ndarray) -> Any:
    """Return the values of all B-splines at the positions `at`, as a sparse matrix (position, B-spline)."""
    from scipy.interpolate import BSpline

    return BSpline.design_matrix(at, knots, degree)
