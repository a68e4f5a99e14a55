"""PSFs of several pupils over one window, computed together as matrix products, and estimated errors of the PSFs.

The method is used for PSFs with coarse tolerances.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from optics.elements.light_stack import LightStack
from optics.methods.axis_kernel import window_kernel
from optics.methods.mirrored_matrix import MirroredMatrix, mirroring_share
from optics.methods.remaining_factor import RemainingFactor
from optics.methods.sine_stack import SineStack
from optics.methods.slow_factor import Path, cross_term
from optics.methods.window_check import window_errors
from optics.methods.window_crossings import WindowCrossings
from optics.methods.window_sums import intensity_of, weighted
from optics.numerics.grid import Grid, sample_positions
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = ["window_image_errors", "window_images"]


def window_images(
    stack: LightStack, samples: SineStack, rank: int, crossed: bool, window: Grid, dtype: str
) -> np.ndarray:
    """Return the intensities |U|² over the window for unit amplitude at the pupils, as an array (beam, y, x).

    U is a sum over the samples of a pupil. The diffraction kernel of the sum is a Fourier kernel times a factor that
    varies slowly over the window, the slow factor.

    samples: grids of samples, one for each beam's pupil, or one for all pupils.
    rank: number of interpolation points along each axis of the window, from which the slow factor is interpolated.
    crossed: True to approximate the slow factor without interpolation. It is then the product of its values along both
        axes of the window, corrected by `cross_term`. This requires rank 1.
    dtype: "float32" or "float64".
    """
    path = Path(stack.wavelength, stack.distance, window)
    nodes = max(window.own_half_width, window.dx) * chebyshev_points(rank)
    field = samples.arriving(stack, dtype)
    if rank > 1:
        field = weighted(field, _node_factors(path, samples, nodes, dtype))
    terms = _terms(path, samples, nodes, crossed, dtype)
    if isinstance(terms[0][0], MirroredMatrix):
        parts = [down @ (across @ field.swapaxes(1, 2)).swapaxes(1, 2) for down, across in terms]
        return np.asarray(intensity_of(parts[0] if len(parts) == 1 else parts[0] + parts[1]))
    [(down, across)] = terms
    if not crossed:
        return np.asarray(intensity_of(down @ field @ across.swapaxes(1, 2)))
    both = field @ across.swapaxes(1, 2)
    first, second = both[..., : window.shape[1]], both[..., window.shape[1] :]
    return np.asarray(intensity_of(down @ np.concatenate([first, second], axis=1)))


def window_image_errors(
    stack: LightStack, finer: SineStack, images: np.ndarray, window: Grid, tolerance: float
) -> np.ndarray:
    """Return the relative L2 errors of the results of `window_images`, (beam,), see `window_errors`.

    The images are compared with sums over finer samples of the pupils, in a few rows and columns of the window.

    finer: these finer samples, the second result of `WindowPlan.samples`.
    images: result of `window_images`, (beam, y, x).
    """
    path = Path(stack.wavelength, stack.distance, window)
    crossings = WindowCrossings.from_images(images)
    return np.asarray(window_errors(finer, path, finer.arriving(stack, str(images.dtype)), crossings, tolerance))


def _terms(path: Path, samples: SineStack, nodes: np.ndarray, crossed: bool, dtype: str) -> list[tuple[Any, Any]]:
    """Return pairs of matrices: diffraction kernels (see `_along`) for rows and for columns of the window.

    PSFs with the same samples share the matrices. Without `crossed`, there is one pair. If `crossed` is True, there are
    two pairs, the second one for `cross_term`. Each pair yields a field over the window, and the sum of both fields is
    the field of the PSF. If the matrices are mirrored (`MirroredMatrix`), the list holds two pairs. Else the two are
    joined to one larger pair, because one large product takes less time than two. The larger pair has the shapes
    (pupil, y, 2 · sample) and (pupil, 2 · x, sample).
    """
    window = path.window

    def computed() -> list[tuple[Any, Any]]:
        down = _along(path, samples, 1, nodes, dtype)
        same = window.shape[0] == window.shape[1] and window.centre[0] == window.centre[1]
        across = down if same else _along(path, samples, 0, nodes, dtype)
        terms: list[tuple[Any, Any]] = [(down, across)]
        if crossed:
            at, (x, y) = samples.at[:, None, :], (sample_positions(n, window.dx) for n in window.shape[::-1])
            a, b = cross_term(path, samples, (at, at), (x[None, :, None], y[None, :, None]))
            terms.append((down * b.astype(down.dtype), across * a.astype(across.dtype)))
        if mirroring_share(window, np.array(across.shape[2])) < 1:
            return [(MirroredMatrix.from_matrix(a), MirroredMatrix.from_matrix(b)) for a, b in terms]
        if crossed:
            downs, acrosses = zip(*terms, strict=True)
            return [(np.concatenate(downs, axis=2), np.concatenate(acrosses, axis=1))]
        return terms

    found: list[tuple[Any, Any]] = samples.known.get(("terms", path.key, len(nodes), crossed, dtype), computed)
    return found


def _along(path: Path, samples: SineStack, axis: int, nodes: np.ndarray, dtype: str) -> np.ndarray:
    """Return the diffraction kernel along x (`axis` 0) or y (1), multiplied by interpolation weights, complex.

    The kernel depends on the position in the window (place) and on the sample of the pupil. Between the nodes, which
    are points of the window, values are interpolated. The weight of a node is its Lagrange polynomial at the place. The
    last axis counts all pairs of a node and a sample, so the shape is (pupil, place, node · sample).
    """
    kernel = window_kernel(path, samples, axis, dtype)
    if len(nodes) == 1:
        return kernel
    place = sample_positions(path.window.shape[1 - axis], path.window.dx)
    weight = lagrange_basis(place, nodes).T.astype(dtype)
    found: np.ndarray = weight[None, :, :, None] * kernel[:, :, None, :]
    return found.reshape(len(kernel), len(place), -1)


def _node_factors(path: Path, samples: SineStack, nodes: np.ndarray, dtype: str) -> np.ndarray:
    """Return a slowly varying factor of the diffraction kernel at nodes (points) of the window.

    The slow factor is the quotient of the diffraction kernel and a Fourier kernel, divided by the value of this
    quotient at the middle of the window. If F(u, v) is the slow factor at a node (u, v), the result is the quotient
    F(u, v) / (F(u, 0) F(0, v)) (see `RemainingFactor`). It differs from 1 only off the x and y axes of the window. The
    shape is (pupil, node along y, node along x, row of samples, column of samples).
    """
    s, t = samples.at[:, None, None, None, :], samples.at[:, None, None, :, None]
    u, v = nodes[None, None, :, None, None], nodes[None, :, None, None, None]
    return RemainingFactor(path, samples, (s, t), dtype).at((u, v))
