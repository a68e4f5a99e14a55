"""The error of a PSF from few samples of the pupil, by a sum over other samples in a few rows and columns.

The other samples are finer, and their edge is sharper. Their grid is shifted by a fraction of the pitch that is not a
simple ratio. The comparison therefore shows the errors due to aliased light, to detail between the samples, and to the
soft edge. It also shows the error due to the rank, because the check interpolates the slow factor over the pupil
instead of the window. Both sums use the slow factor, so the check also compares this factor with the diffraction kernel
itself. The error of the check's own sum is at most half of the error that the check finds.
"""

from __future__ import annotations

from bisect import bisect

import numpy as np

from optics.methods.diffraction_kernel import diffraction_kernel
from optics.methods.sine_stack import SineStack
from optics.methods.slow_factor import Path, axis_factor, axis_kernel, remaining_factor
from optics.methods.window_sums import intensity_of
from optics.numerics.array_library import turned
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = ["window_errors"]

CAUTION = 3.5  # choice: safety factor on the estimated error; see test_window_sampling.py
UNSEEN = 0.05  # choice: error that both sums may share, relative to the tolerance
ACROSS = 10  # choice: number of rows and of columns in which the check computes the PSF
SHARES = (0.3, 0.3, 0.3, 0.1)  # choices: weights of the probabilities of rows and columns, see `_drawn`
INTERPOLATED = 0.5  # choice: largest error of the interpolated kernel of the check, relative to the tolerance
# Choices: numbers of interpolation points across the pupil, and phases [rad] from which on each is too small.
ORDERS, PHASES = (2, 3, 4, 5, 7, 9, 12, 16), (0.02, 0.3, 0.8, 1.2, 1.8, 3.0, 6.0)


def window_errors(
    samples: SineStack, path: Path, field: np.ndarray, images: np.ndarray, tolerance: float
) -> np.ndarray:
    """Return the relative L2 errors of intensities over a window, estimated in a few rows and columns, (stack,).

    The result is NaN for a window without light.

    samples: samples of the pupils for the comparison. They and the path may have a first axis of length 1.
    field: contribution of each of these samples to the middle of the window, see `SineStack.arriving`, (stack, y, x).
    images: |U|² over the window, (stack, y, x).
    tolerance: tolerance of the PSFs.
    """
    window = path.window
    total = np.square(images, dtype=np.float64).sum((1, 2))
    rows, columns, chance = _drawn(np.where((total > 0)[:, None, None], images, 1))
    u, v = ((at - n // 2) * window.dx for at, n in zip((columns, rows), window.shape[::-1], strict=True))
    exact, apart = _at_points(samples, path, field, (u, v), tolerance)
    drawn = images[np.arange(len(images))[:, None, None], rows[:, :, None], columns[:, None, :]]
    squared = np.mean(np.square(drawn - exact) / chance, (1, 2))
    # choice: with an error above a tenth, the PSF may be too bright, so the error is relative to the darker of the two
    bright = np.minimum(total, np.mean(np.square(exact) / chance, (1, 2)))
    total = np.where(total > 0, np.where(squared > 0.01 * total, bright, total), np.nan)
    rounding = float(np.finfo(field.real.dtype).eps)
    # Below the goal of the interpolation, the difference may be its own error, which both sums do not share.
    unlike = np.where(apart > INTERPOLATED * tolerance, apart, 0)
    return np.asarray(CAUTION * (np.sqrt(squared / total) + unlike) + UNSEEN * tolerance + rounding)


def _at_points(
    samples: SineStack, path: Path, field: np.ndarray, place: tuple[np.ndarray, np.ndarray], tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return |U|² in columns u and rows v [m], relative to the middle of the window, (stack, v, u).

    The second result is the largest difference between the slow factor and the diffraction kernel, (stack,).

    The slow factor, divided by its values A along both axes, is interpolated from a few points (ξ_a, η_b) of the pupil
    with weights L_a and L_b:

        U(u, v) = Σ_ba G(ξ_a, η_b; u, v) Σ_ηξ L_b A_v e^{-ik v t} P L_a A_u e^{-ik u s}.

    G is this quotient, P the contribution of a sample with the sines (s, t), and k the wave number.
    """
    (u, v), dtype = place, str(field.real.dtype)
    nodes, ratio, apart = _ratios(samples, path, place, dtype, INTERPOLATED * tolerance)
    # The nodes and the samples of all pupils are alike, apart from their scale.
    weight = lagrange_basis(samples.at[0], nodes[0]).astype(dtype)
    across, down = (_interpolated_kernel(path, samples, axis, part, weight) for axis, part in enumerate((u, v)))
    sums = down @ field @ across.swapaxes(1, 2)
    split = sums.reshape(len(v), v.shape[1], len(weight), u.shape[1], len(weight))
    return intensity_of(np.einsum("nbavu,nvbua->nvu", ratio, split)), apart


def _interpolated_kernel(
    path: Path, samples: SineStack, axis: int, place: np.ndarray, weight: np.ndarray
) -> np.ndarray:
    """Return the kernel L_a A e^{-ik u s} of `_at_points` along one axis, (stack, place · a, sine)."""
    kernel = axis_kernel(path, samples, axis, place, str(weight.dtype))
    return np.asarray((kernel[:, :, None, :] * weight).reshape(len(place), -1, weight.shape[1]))


def _ratios(
    samples: SineStack, path: Path, place: tuple[np.ndarray, np.ndarray], dtype: str, most: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return interpolation points in sines, (pupil, a), the factor there, (stack, b, a, v, u), and its error, (stack,).

    The factor is the slow factor relative to the middle of the window, divided by its values along both axes. Its
    interpolation is compared with the factor in the middle and at the rim of the pupil, for the outermost columns and
    rows of each window. The search starts with a number of points that is usually sufficient for the phase there.

    most: error at which the search ends.
    """
    (u, v), (left, top) = place, ([0, -1, 0, -1], [0, 0, -1, -1])  # corners, since rows and columns ascend
    angle, radius = 2 * np.pi * np.arange(12) / 12, samples.outermost[:, None] * np.array([0, *[1] * 12])
    rim = samples.directions(radius * np.cos([0, *angle]), radius * np.sin([0, *angle]))
    corners = u[:, left, None], v[:, top, None]
    exact = _remaining(path, samples, (rim[0][:, None], rim[1][:, None]), corners)
    phase = float(np.abs(np.angle(exact)).max())
    side = samples.at[:, [0, -1]]
    middle, half = side.mean(axis=1)[:, None], np.diff(side) / 2
    for order in ORDERS[bisect(PHASES, phase) :]:
        nodes = middle + half * chebyshev_points(order)
        own = np.broadcast_to(nodes[:, None, :], (len(nodes), order, order))
        weight = [lagrange_basis((part - middle) / half, chebyshev_points(order)) for part in rim]
        directions = own[..., None, None], own.swapaxes(1, 2)[..., None, None]
        found = remaining_factor(path, samples, directions, (u[:, None, None, None], v[:, None, None, :, None]), dtype)
        outer = np.einsum("nbac,bnk,ank->nck", found[..., top, left], weight[1], weight[0])
        apart = np.abs(outer - exact).max(axis=(1, 2))
        if apart.max() < most:
            break
    return nodes, found, apart


def _remaining(
    path: Path,
    samples: SineStack,
    directions: tuple[np.ndarray, np.ndarray],
    place: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the `remaining_factor` from the diffraction kernel itself, as a check of the factors of the sums."""
    (s, t), (u, v) = directions, place
    wavelength, distance = path.numbers(s.ndim)
    x, y = path.window.centre
    points = samples.points_at(s, t)
    size, waves = diffraction_kernel(wavelength, distance, points, (u + x, v + y))
    middle = diffraction_kernel(wavelength, distance, points, (x, y))
    found = turned(size / middle[0], waves - middle[1] + (u * s + v * t) / wavelength, "float64")
    for axis in (0, 1):
        found /= axis_factor(path, samples, axis, directions[axis], place[axis])
    return found


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
        root, bright = (part.sum(axis=along).astype(np.float64) for part in (roots, squares))
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
