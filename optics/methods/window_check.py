"""The error of a PSF from few samples of the pupil, by a sum over other samples in a few rows and columns.

The other samples are finer, and their edge is sharper. Their grid is shifted by a fraction of the pitch that is not a
simple ratio. The comparison therefore shows the errors due to aliased light, to detail between the samples, and to the
soft edge. It also shows the error due to the rank, because the check interpolates the slow factor over the pupil
instead of the window. The error of the sum itself is at most half of the error that it finds.
"""

from __future__ import annotations

from bisect import bisect
from functools import lru_cache

import numpy as np

from optics.methods.sine_samples import SineSamples
from optics.methods.slow_factor import Path, slow_factor
from optics.methods.window_sums import intensity_of
from optics.numerics.array_library import turned
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = ["window_errors"]

CAUTION = 3.5  # choice: safety factor on the estimated error; see test_window_sampling.py
ACROSS = 16  # choice: number of rows and of columns in which the check computes the PSF
SHARES = (0.3, 0.3, 0.3, 0.1)  # choices: weights of the four distributions of rows and columns, see `_drawn`
INTERPOLATED = 2e-4  # choice: allowed error of the slow factor that the check interpolates
# Choices: numbers of interpolation points across the pupil, and phases [rad] at which each but the last is too small.
ORDERS, PHASES = (3, 5, 7, 9, 12, 16), (0.1, 0.6, 1.5, 3.0, 6.0)


def window_errors(samples: SineSamples, path: Path, light: np.ndarray, images: np.ndarray) -> np.ndarray:
    """Return the relative L2 errors of intensities over a window, estimated in a few rows and columns, (stack,).

    The result is NaN for a window without light.

    samples: samples of the pupil for the comparison.
    light: light behind the pupil at these samples, times their areas, (stack, y, x), complex.
    images: |U|² over the window, (stack, y, x).
    """
    window = path.window
    total = np.square(images, dtype=np.float64).sum((1, 2))
    dark = ~(total > 0)
    if dark.all():
        return np.full(len(images), np.nan)
    if dark.any():
        found = np.full(len(images), np.nan)
        found[~dark] = window_errors(samples, path, light[~dark], images[~dark])
        return found
    rows, columns, chance = _drawn(images)
    u, v = ((at - n // 2) * window.dx for at, n in zip((columns, rows), window.shape[::-1], strict=True))
    exact = _at_points(samples, path, light, u, v)
    drawn = images[np.arange(len(images))[:, None, None], rows[:, :, None], columns[:, None, :]]
    squared = np.mean(np.square(drawn - exact) / chance, (1, 2))
    # choice: with an error above a tenth, the PSF may be too bright, so the error is relative to the darker of the two
    bright = np.minimum(total, np.mean(np.square(exact) / chance, (1, 2)))
    total = np.where(squared > 0.01 * total, bright, total)
    rounding = float(np.finfo(light.real.dtype).eps)
    return np.asarray(CAUTION * np.sqrt(squared / total) + rounding)


def _at_points(samples: SineSamples, path: Path, light: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return |U|² in columns u and rows v [m], relative to the middle of the window, (stack, v, u).

    The slow factor G is interpolated from a few points (ξ_a, η_b) of the pupil, with weights L_a and L_b. P is the
    light behind the pupil, and s and t are the sines of its rays:

        U(u, v) = Σ_ba G(ξ_a, η_b; u, v)/G(ξ_a, η_b; 0, 0) Σ_ηξ L_b e^{-ik v t} P G(ξ, η; 0, 0) L_a e^{-ik u s}.
    """
    nodes, ratio = _ratios(samples, path, u, v, str(light.real.dtype))
    weight = lagrange_basis(samples.at, nodes).astype(light.real.dtype)
    across, down = (_interpolated_kernel(path, part, samples.at, weight) for part in (u, v))
    sums = down @ (light * _in_middle(samples, path).astype(light.dtype)) @ across.swapaxes(1, 2)
    split = sums.reshape(len(v), v.shape[1], len(nodes), u.shape[1], len(nodes))
    found = np.einsum("nvuba,nvbua->nvu", ratio, split)
    x, y = u[:, None, :] + path.window.centre[0], v[:, :, None] + path.window.centre[1]
    near = 1 + (path.wavelength / (2 * np.pi)) ** 2 / (x * x + y * y + path.distance**2)
    return np.asarray(intensity_of(found) * near / (path.wavelength * path.distance) ** 2)


@lru_cache(maxsize=64)
def _in_middle(samples: SineSamples, path: Path) -> np.ndarray:
    """Return the slow factor between all samples and the middle of the window, complex (y, x)."""
    middle = np.zeros(1), np.zeros(1)
    return slow_factor(path, samples.points, (samples.at[None, :], samples.at[:, None]), middle)


def _interpolated_kernel(path: Path, place: np.ndarray, sines: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the Fourier kernel times the interpolation weights, L_a(s) e^{-ik u s}, (stack, place · a, sine)."""
    kernel = turned(1.0, place[..., None] * (sines / -path.wavelength), str(weight.dtype))
    return np.asarray((kernel[:, :, None, :] * weight).reshape(len(place), -1, len(sines)))


def _ratios(
    samples: SineSamples, path: Path, u: np.ndarray, v: np.ndarray, dtype: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return interpolation points in sines, and the slow factor G(·; u, v)/G(·; 0, 0) there, (stack, v, u, b, a).

    The number of points is increased until the interpolated factor equals the exact one, up to an error of
    INTERPOLATED, on the pupil's rim and for the outermost columns and rows. The first number is usually sufficient for
    the largest phase of the factor there.
    """

    def ratio(directions: tuple[np.ndarray, np.ndarray], u: np.ndarray, v: np.ndarray) -> np.ndarray:
        points = samples.points_at(*directions)
        place = u[:, None, :, None, None], v[:, :, None, None, None]
        middle = slow_factor(path, points, directions, (np.zeros(1), np.zeros(1)))
        found: np.ndarray = slow_factor(path, points, directions, place, dtype) * (1 / middle).astype(kind)
        return found

    angle, kind = 2 * np.pi * np.arange(12) / 12, np.result_type(dtype, np.complex64)
    rim = samples.directions(samples.outermost * np.cos(angle), samples.outermost * np.sin(angle))
    ends = [np.array([[part.min(), part.max()]]) for part in (u, v)]
    exact = ratio(rim, *ends)[..., 0, :]
    phase = float(np.abs(np.angle(exact)).max())
    for order in ORDERS[bisect(PHASES, phase) :]:
        nodes = (at := samples.at[[0, -1]]).mean() + (at[1] - at[0]) / 2 * chebyshev_points(order)
        across, down = np.meshgrid(nodes, nodes)
        weight = lagrange_basis(rim[1], nodes)[:, None] * lagrange_basis(rim[0], nodes)
        if np.abs(np.tensordot(ratio((across, down), *ends), weight, 2) - exact).max() < INTERPOLATED:
            break
    return nodes, ratio((across, down), u, v)


def _drawn(images: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns of each PSF, and the probability with which each of their crossings is drawn.

    Rows and columns are drawn at even steps of their cumulative probabilities. These are a mixture of four
    distributions. The first is uniform. The second is proportional to the square root of the intensity, like the error
    of the intensity if the error of the amplitude is the same everywhere. The third favours the brightest samples and
    their neighbours, and the last the sides of the window, where phases change fastest.

    The shapes are (stack, row), (stack, column) and (stack, row, column).
    """
    found, roots, squares = [], np.sqrt(images), np.square(images)
    for along in (2, 1):
        root, bright = (part.sum(axis=along, dtype=np.float64) for part in (roots, squares))
        bright[:, 1:-1] = bright[:, :-2] + bright[:, 1:-1] + bright[:, 2:]
        size = root.shape[1]
        sides = np.zeros(size)
        sides[[0, -1]] = 0.5
        of_light = (part / part.sum(axis=1, keepdims=True) for part in (root, bright))
        shares = np.full(size, 1 / size), *of_light, sides
        chance = sum(weight * share for weight, share in zip(SHARES, shares, strict=True))
        count = min(ACROSS, size)
        if count == size:
            found.append((np.broadcast_to(np.arange(count), root.shape), np.full(root.shape, 1 / count)))
            continue
        levels = np.cumsum(chance, axis=1)
        wanted = (np.arange(count) + 0.5) / count * levels[:, -1:]
        place = (levels[:, None, :] < wanted[:, :, None]).sum(axis=2).clip(max=size - 1)
        found.append((place, np.take_along_axis(chance, place, axis=1)))
    (rows, down), (columns, across) = found
    return rows, columns, down[:, :, None] * across[:, None, :]
