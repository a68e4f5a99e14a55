"""The error of a PSF from few samples of the pupil, by a sum over other samples in a few rows and columns.

The other samples are finer, their grid is shifted by a fraction of the pitch that is not a simple ratio, and their edge
is sharper. The comparison therefore shows light that the samples alias, detail that they miss, and the softness of the
edge. It also shows the error of the rank, because the slow factor is interpolated over the pupil, and not over the
window. The sum has an error of its own, which is at most half of the error that it finds.
"""

from __future__ import annotations

import math
from bisect import bisect
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.sine_samples import SineSamples
from optics.methods.slow_factor import Path, slow_factor
from optics.methods.window_sums import intensity_of
from optics.numerics.interpolation import chebyshev_points, lagrange_basis
from optics.numerics.precision import precision

__all__ = ["window_error"]

CAUTION = 3.5  # choice: safety factor on the estimated error; see test_window_sampling.py
ACROSS = 16  # choice: number of rows and of columns in which the check computes the PSF
SHARES = (0.3, 0.3, 0.3, 0.1)  # choices: weights of the probabilities with which these are drawn, see `_drawn`
INTERPOLATED = 2e-4  # choice: error of the interpolated kernel of the check
# Choices: numbers of interpolation points across the pupil, and phases [rad] up to which the earlier ones may suffice.
ORDERS, PHASES = (3, 5, 7, 9, 12, 16), (0.1, 0.6, 1.5, 3.0, 6.0)


def window_error(samples: SineSamples, beam: Beam, problem: Problem, image: np.ndarray) -> float | None:
    """Return the relative L2 error of the intensity over the window, estimated in a few rows and columns.

    The result is None for a window without light.

    samples: samples of the pupil for the comparison.
    image: |U|² over the window, divided by the area of the pupil, flat.
    """
    window = problem.window
    image = image.reshape(window.shape)
    total = float(np.vdot(image, image))
    if not total > 0:
        return None
    rows, columns, chance = _drawn(image)
    u, v = ((at - n // 2) * window.dx for at, n in zip((columns, rows), window.shape[::-1], strict=True))
    light = samples.light(beam, problem.dtype)
    exact = _at_points(samples, Path.from_problem(problem), light, u, v) / beam.pupil.area
    squared = float(np.mean(np.square(image[np.ix_(rows, columns)] - exact) / chance))
    if squared > 0.01 * total:  # choice: the PSF may be too bright, and errors are relative to the exact one
        total = min(total, float(np.mean(np.square(exact) / chance)))
    rounding = float(np.finfo(precision(problem.dtype).dtype).eps)
    return CAUTION * math.sqrt(squared / total) + rounding


def _at_points(samples: SineSamples, path: Path, light: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return |U|² in columns u and rows v [m], relative to the middle of the window, (v, u).

    The slow factor is interpolated from a few points (ξ_a, η_b) of the pupil, with weights L_a and L_b:

        U(u, v) = Σ_ba G(ξ_a, η_b; u, v)/G(ξ_a, η_b; 0, 0) Σ_ηξ L_b e^{-ik v t} P G(ξ, η; 0, 0) L_a e^{-ik u s}.
    """
    size, real = len(samples.at), light.real.dtype
    nodes, ratio = _ratios(samples, path, u, v)
    weight = lagrange_basis(samples.at, nodes).astype(real)
    across, down = ((_turned(path, part, samples.at, real)[:, None, :] * weight).reshape(-1, size) for part in (u, v))
    sums = down @ (light * _in_middle(samples, path).astype(light.dtype)) @ across.T
    found = (ratio * sums.reshape(len(v), len(nodes), len(u), len(nodes)).swapaxes(1, 2)).sum((2, 3))
    x, y = u + path.window.centre[0], v[:, None] + path.window.centre[1]
    near = 1 + (path.wavelength / (2 * np.pi)) ** 2 / (x * x + y * y + path.distance**2)
    return intensity_of(found) * near / (path.wavelength * path.distance) ** 2


@lru_cache(maxsize=64)
def _in_middle(samples: SineSamples, path: Path) -> np.ndarray:
    """Return the slow factor of all samples for the middle of the window, (y, x)."""
    middle = np.zeros(1), np.zeros(1)
    return slow_factor(path, samples.points, (samples.at[None, :], samples.at[:, None]), middle)


def _turned(path: Path, place: np.ndarray, sines: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Return e^{-ik u s}, (place, sine)."""
    waves = np.outer(place, sines / -path.wavelength)
    angle = ((waves - np.rint(waves)) * (2 * np.pi)).astype(dtype)
    found = np.empty(angle.shape, np.result_type(dtype, np.complex64))
    found.real, found.imag = np.cos(angle), np.sin(angle)
    return found


def _ratios(samples: SineSamples, path: Path, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return interpolation points in sines, and the slow factor there relative to the middle, (v, u, b, a).

    The interpolation is compared with the factor at the rim, for the outermost columns and rows. It starts with a
    number of points that is usually sufficient for the phase there.
    """

    def ratio(directions: tuple[np.ndarray, np.ndarray], u: np.ndarray, v: np.ndarray) -> np.ndarray:
        points, place = samples.points_at(*directions), (u[None, :, None, None], v[:, None, None, None])
        middle = slow_factor(path, points, directions, (np.zeros(1), np.zeros(1)))
        found: np.ndarray = slow_factor(path, points, directions, place) / middle
        return found

    angle = 2 * np.pi * np.arange(12) / 12
    rim = samples.directions(samples.outermost * np.cos(angle), samples.outermost * np.sin(angle))
    ends = u[[0, -1]], v[[0, -1]]
    exact = ratio(rim, *ends)[:, :, 0]
    phase = float(np.abs(np.angle(exact)).max())
    for order in ORDERS[bisect(PHASES, phase) :]:
        nodes = (at := samples.at[[0, -1]]).mean() + (at[1] - at[0]) / 2 * chebyshev_points(order)
        across, down = np.meshgrid(nodes, nodes)
        weight = lagrange_basis(rim[1], nodes)[:, None] * lagrange_basis(rim[0], nodes)
        if np.abs(np.tensordot(ratio((across, down), *ends), weight, 2) - exact).max() < INTERPOLATED:
            break
    return nodes, ratio((across, down), u, v)


def _drawn(image: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rows and columns of a grid of samples, and the probability with which each sample was drawn.

    Rows and columns are drawn at even steps of their cumulative probabilities. If the amplitude has the same error
    everywhere, the error of the intensity is proportional to the square root of the intensity. Other errors are next to
    the brightest samples, or at the sides of the window, where phases change fastest.
    """
    found = []
    for along in (1, 0):
        root = np.sqrt(image).sum(axis=along, dtype=np.float64)
        bright = np.square(image).sum(axis=along, dtype=np.float64)
        bright[1:-1] = bright[:-2] + bright[1:-1] + bright[2:]
        sides = np.zeros(len(root))
        sides[[0, -1]] = 0.5
        shares = np.full(len(root), 1 / len(root)), root / root.sum(), bright / bright.sum(), sides
        chance = np.tensordot(SHARES, shares, 1)
        count = min(ACROSS, len(root))
        if count == len(root):
            found.append((np.arange(count), np.full(count, 1 / count)))
            continue
        levels = np.cumsum(chance)
        place = np.searchsorted(levels, (np.arange(count) + 0.5) / count * levels[-1]).clip(max=len(root) - 1)
        found.append((place, chance[place]))
    (rows, down), (columns, across) = found
    return rows, columns, np.outer(down, across)
