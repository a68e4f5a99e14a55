"""PSFs of several pupils over one window at coarse tolerances, as stacked matrix products, and their errors."""

from __future__ import annotations

import numpy as np

from optics.elements.light_stack import LightStack
from optics.methods.sine_stack import SineStack
from optics.methods.slow_factor import Path, cross_term, remaining_factor, window_kernel
from optics.methods.window_check import window_errors
from optics.methods.window_sums import intensity_of, window_field
from optics.numerics.grid import Grid, sample_positions
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = ["window_image_errors", "window_images"]


def window_images(
    stack: LightStack, samples: SineStack, rank: int, crossed: bool, window: Grid, dtype: str
) -> np.ndarray:
    """Return |U|² over the window for unit amplitude at the pupils, (beam, y, x).

    samples: samples of the pupils, one for each beam or one for all.
    rank: rank of the slow factor over the window.
    crossed: True to include `cross_term`, which replaces interpolation of the slow factor.
    dtype: "float32" or "float64".
    """
    path = Path(stack.wavelength, stack.distance, window)
    nodes = max(window.own_half_width, window.dx) * chebyshev_points(rank)
    field = samples.arriving(stack, dtype)
    down, across = _fourier(path, samples, nodes, dtype)
    if not crossed:
        if rank == 1:
            return np.asarray(intensity_of(down @ field @ across.swapaxes(1, 2)))
        kernel = _node_factors(path, samples, nodes, dtype)
        return np.asarray(intensity_of(window_field(field, kernel, down, across)))
    at, (u, v) = samples.at[:, None, :], (sample_positions(n, window.dx)[None, :, None] for n in window.shape[::-1])
    a, b = (part.astype(field.dtype) for part in cross_term(path, samples, (at, at), (u, v)))
    both = field @ np.concatenate([across, across * a], axis=1).swapaxes(1, 2)
    first, second = both[..., : window.shape[1]], both[..., window.shape[1] :]
    summed = np.concatenate([down, down * b], axis=2) @ np.concatenate([first, second], axis=1)
    return np.asarray(intensity_of(summed))


def window_image_errors(
    stack: LightStack, finer: SineStack, images: np.ndarray, window: Grid, tolerance: float
) -> np.ndarray:
    """Return the relative L2 errors of the results of `window_images`, (beam,), see `window_errors`.

    finer: samples of the check, see `WindowPlan.samples`.
    images: result of `window_images`, (beam, y, x).
    """
    path = Path(stack.wavelength, stack.distance, window)
    return window_errors(finer, path, finer.arriving(stack, str(images.dtype)), images, tolerance)


def _fourier(path: Path, samples: SineStack, nodes: np.ndarray, dtype: str) -> tuple[np.ndarray, np.ndarray]:
    """Return `_along` for rows and columns. Further PSFs with the same samples share them."""
    window, key = path.window, ("fourier", path.window, len(nodes), np.asarray(path.wavelength).tobytes(), dtype)
    if key not in samples.known:
        down = _along(path, samples, 1, nodes, dtype)
        same = window.shape[0] == window.shape[1] and window.centre[0] == window.centre[1]
        samples.known[key] = down, down if same else _along(path, samples, 0, nodes, dtype)
    found: tuple[np.ndarray, np.ndarray] = samples.known[key]
    return found


def _along(path: Path, samples: SineStack, axis: int, nodes: np.ndarray, dtype: str) -> np.ndarray:
    """Return the kernel along x (0) or y (1) times interpolation weights of the nodes, (pupil, place, a · sample)."""
    kernel = window_kernel(path, samples, axis, dtype)
    if len(nodes) == 1:
        return kernel
    place = sample_positions(path.window.shape[1 - axis], path.window.dx)
    weight = lagrange_basis(place, nodes).T.astype(dtype)
    found: np.ndarray = weight[None, :, :, None] * kernel[:, :, None, :]
    return found.reshape(len(kernel), len(place), -1)


def _node_factors(path: Path, samples: SineStack, nodes: np.ndarray, dtype: str) -> np.ndarray:
    """Return the slow factor at nodes of the window, divided by its values along both axes and in the middle.

    The shape is (pupil, b, a, η, ξ).
    """
    s, t = samples.at[:, None, None, None, :], samples.at[:, None, None, :, None]
    u, v = nodes[None, None, :, None, None], nodes[None, :, None, None, None]
    return remaining_factor(path, samples, (s, t), (u, v), dtype)
