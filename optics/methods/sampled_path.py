"""Heights of reliefs and aberrations of wavefronts at samples of the pupil.

They are computed from weights that are stored, because they are the same for many pupils.
An aberration is the length [m] by which a wavefront is ahead of the wavefront without aberrations.
Polynomials are interpolated from a few points across the pupil. A relief or wavefront can also be a map, a table of
values that cubic splines interpolate. Its values at the samples are the product of a sparse matrix and the coefficients
of the splines. This matrix and the weights of the interpolation only depend on the positions of the samples and the
size of the table, not on the values of the relief or wavefront.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from optics.elements.light_stack import SPHERE_POINTS
from optics.elements.pixel_relief import PixelRelief
from optics.elements.pupil import Pupil
from optics.elements.pupil_path import relief_height, wavefront_ahead
from optics.elements.pupil_polynomials import HIGHEST_ORDER
from optics.elements.relief import BSplineRelief, HeightMap
from optics.elements.spline_map import spline_weights
from optics.elements.wavefront import WavefrontMap, Zernike
from optics.methods.pixel_nodes import PixelNodes, WindowSamples
from optics.methods.sine_stack import even_weights
from optics.methods.single_stack import single_stack
from optics.numerics.array_library import like, sparse_product
from optics.numerics.autodiff import Array
from optics.numerics.interpolation import chebyshev_points
from optics.numerics.kept_values import cached_arrays

__all__ = ["sampled_height", "sampled_wavefront"]

Convert = Callable[[np.ndarray], Array]

RELIEF_POWERS = 4  # powers of x and of y of a bicubic polynomial
MOST_BYTES = 128e6  # choice, limited by memory: all sparse matrices that are cached


def sampled_height(pupil: Pupil, samples: WindowSamples, convert: Convert) -> Array | None:
    """Return the height [m] of the relief at samples, array (row, column); None without a relief.

    The radius of the pupil must not carry a derivative.

    convert: function that converts a NumPy array to the library of the computation, NumPy or PyTorch.
    """
    relief = pupil.height
    if relief is None:
        return None
    if isinstance(relief, PixelRelief) and isinstance(samples, PixelNodes):
        numbers = like(convert(np.zeros(0)), relief.samples).reshape(-1)
        return sparse_product(_pixel_weights(samples), numbers).reshape(samples.grid.shape)
    if isinstance(relief, HeightMap):
        return _of_map(relief, pupil.radius, samples, convert)
    powers = RELIEF_POWERS if isinstance(relief, BSplineRelief) else None
    return _interpolated(lambda x, y: relief_height(pupil, convert(x), convert(y)), powers, samples, convert)


def sampled_wavefront(pupil: Pupil, samples: WindowSamples, convert: Convert) -> Array | None:
    """Return the aberration of the pupil's wavefront at samples, array (row, column); None without an aberration.

    It is the length [m] by which the wavefront is ahead of the wavefront without aberrations. `sampled_height` explains
    the arguments.
    """
    wavefront = pupil.wavefront
    if wavefront is None:
        return None
    if isinstance(wavefront, WavefrontMap):
        return _of_map(wavefront, wavefront.radius or pupil.radius, samples, convert)
    if isinstance(wavefront, Zernike):
        radius, none = wavefront.radius or pupil.radius, convert(np.zeros(0))
        powers = wavefront.order + 1 if wavefront.order <= HIGHEST_ORDER else None
        return _interpolated(lambda x, y: wavefront.ahead_at(x / radius, y / radius, none), powers, samples, convert)
    return _interpolated(lambda x, y: wavefront_ahead(pupil, convert(x), convert(y)), None, samples, convert)


def _of_map(surface: HeightMap | WavefrontMap, radius: float, samples: WindowSamples, convert: Convert) -> Array:
    """Return the value [m] of a map at each sample of the pupil, interpolated by splines, array (row, column).

    It is the height of a relief, or the length by which a wavefront is ahead of the wavefront without aberrations.

    radius: half the side of the map [m].
    """
    rows, columns = surface.samples.shape
    weights = _map_weights(samples, radius, rows, columns)
    return surface.weighted(weights, convert(np.zeros(0))).reshape(samples.grid.shape)


def _interpolated(
    values: Callable[[np.ndarray, np.ndarray], Array],
    powers: int | None,
    samples: WindowSamples,
    convert: Convert,
) -> Array:
    """Return values at samples, array (row, column), interpolated from a few points of the pupil if possible.

    values: function of NumPy arrays x and y [m]. It returns an array of the same library (NumPy or PyTorch) as
        `convert`.
    powers: if `values` is a polynomial, the number of powers of x, which is also the number of powers of y. None for
        other functions, which are not interpolated.
    """
    many, few = len(samples.at), (powers or 0) + SPHERE_POINTS
    if powers is None or few >= many or isinstance(samples, PixelNodes) or not single_stack(samples).smooth(0.0):
        return values(*samples.points)
    found = values(*_few_points(samples, few))
    weight = convert(even_weights(many, few))
    return weight @ found @ weight.T


def _bytes_of(matrix: Any) -> int:
    return int(matrix.data.nbytes + matrix.indices.nbytes)


@cached_arrays(MOST_BYTES, _bytes_of)
def _map_weights(samples: WindowSamples, radius: float, rows: int, columns: int) -> Any:
    """Return the result of `spline_weights` for all samples. radius: half the side of the map [m]."""
    x, y = samples.points
    return spline_weights(x / radius, y / radius, rows, columns)


@cached_arrays(MOST_BYTES, _bytes_of)
def _pixel_weights(samples: PixelNodes) -> Any:
    """Return a sparse matrix (node, pixel) that is 1 for the pixel of each node."""
    from scipy.sparse import csr_matrix

    count, across = samples.nodes.aperture.count, samples.nodes.across
    pixel = np.repeat(np.arange(count), across)
    columns, ends = np.add.outer(pixel * count, pixel).ravel(), np.arange(pixel.size**2 + 1)
    return csr_matrix((np.ones(pixel.size**2), columns, ends), (pixel.size**2, count**2))


@lru_cache(maxsize=64)
def _few_points(samples: WindowSamples, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y [m] of `count` by `count` Chebyshev points in the samples' area, two arrays (row, column)."""
    ends = samples.at[[0, -1]]
    nodes = ends.mean() + np.diff(ends) / 2 * chebyshev_points(count)
    return samples.points_at(nodes[None, :], nodes[:, None])
