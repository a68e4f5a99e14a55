"""Signals of receptors as weighted sums over samples (rays or areas), by one matrix product per row of receptors.

Samples are called rays below. Rays are ordered by their height in the visual field, so each row of receptors uses a
contiguous range of rays. Narrow receptive fields have short ranges. A view is one eye in one world.

Light may be traced as a few spectral components (`sim.tracing.closed_form_tracer`). The light in each band is then a
weighted sum of these components, and each channel of the signals is a weighted sum of bands. If it is cheaper, the
weights of rays in receptors' signals are multiplied in advance by the weights of components and of bands
(`of_components`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse

# Largest number of views in one product. BLAS rounds differently for different shapes. This number is constant, so that
# the signals of a world are bit-identical for any number of other worlds in the batch.
BLOCK = 32
# Largest number of multiplications in a product that OpenBLAS is certain to compute on one thread. The threads of
# OpenBLAS busy-wait for each other. When Dr.Jit or another process used the cores, waiting took a hundred times as long
# as the product itself.
ONE_THREAD = 2**18


@dataclass(frozen=True)
class Stretch:
    """The contiguous range of rays that a row of receptors uses.

    first: index of the first ray
    weights: weight of each ray in each channel of each receptor in the row, (ray, channel * width) float32
    views: number of views for which one matrix product computes the signals; a view is one eye in one world
    """

    first: int
    weights: np.ndarray
    views: int

    @classmethod
    def from_weights(cls, weights: Sequence[scipy.sparse.csr_array]) -> Stretch:
        """Return the range of rays that one row of receptors uses, and the weights of these rays.

        weights: weights of all rays in the signals of the row's receptors, a sparse matrix (receptor, ray) per channel
        """
        used = np.concatenate([w.indices for w in weights])
        first, last = (int(used.min()), int(used.max()) + 1) if len(used) else (0, 1)
        dense = np.concatenate([w[:, first:last].toarray() for w in weights])
        return cls(first, np.ascontiguousarray(dense.T, np.float32), _views_at_once(dense.size))

    def product(self, radiance: np.ndarray, views: int) -> np.ndarray:
        """Return the signals of at least the first `views` views, (view, channel * width).

        Each matrix product computes the signals of `self.views` views, so the number of views in the result is `views`,
        rounded up to a multiple of `self.views`.

        radiance: radiance along all rays, (view, ray); the number of views is a multiple of `self.views`
        """
        count, last = -(-views // self.views), self.first + len(self.weights)
        blocks = radiance.reshape(-1, self.views, radiance.shape[1])[:count, :, self.first : last]
        signals: np.ndarray = (blocks @ self.weights).reshape(count * self.views, -1)
        return signals


@dataclass(frozen=True)
class RowProduct:
    """Matrix products that compute signals from the radiance along each ray. Each row of receptors has one product.

    signal[view, channel, i, j] is the sum over all rays of radiance[view, ray] W[channel, receptor (i, j), ray]. A view
    is one eye in one world.

    stretches: for each row of receptors, the contiguous range of rays that its signals depend on, with their weights
    channels: number of channels
    width: number of receptors in a row
    """

    stretches: tuple[Stretch, ...]
    channels: int
    width: int

    @classmethod
    def from_weights(cls, weights: Sequence[scipy.sparse.csr_array], resolution: tuple[int, int]) -> RowProduct:
        """Build the matrix products from the weights of rays in signals.

        weights: weight of each ray in each receptor's signal, a sparse matrix (receptor, ray) per channel
        resolution: rows and columns of receptors
        """
        height, width = resolution
        rows = ([w[row * width : (row + 1) * width] for w in weights] for row in range(height))
        return cls(tuple(map(Stretch.from_weights, rows)), len(weights), width)

    def __call__(self, radiance: np.ndarray) -> np.ndarray:
        """Map radiance (view, ray) to signals (view, channel, height, width), float32."""
        views, rays = radiance.shape
        missing = -views % max(stretch.views for stretch in self.stretches)
        if missing:
            radiance = np.concatenate([radiance, np.zeros((missing, rays), np.float32)])
        out = np.empty((views, self.channels, len(self.stretches), self.width), np.float32)
        for row, stretch in enumerate(self.stretches):
            signals = stretch.product(radiance, views)[:views]
            out[:, :, row] = signals.reshape(views, self.channels, self.width)
        return out


def _views_at_once(weights: int) -> int:
    """Return the number of views for which one matrix product computes the signals; a view is one eye in one world.

    The result is the largest of 32, 16, 8 and 4 for which OpenBLAS certainly computes the product on one thread. If
    even the product for 4 views may use several threads, the result is 32. Such a product is large enough to be worth
    several threads.

    weights: number of weights in the product for one row of receptors: rays times receptors times channels
    """
    return next((n for n in (BLOCK, BLOCK // 2, BLOCK // 4, BLOCK // 8) if n * weights <= ONE_THREAD), BLOCK)


# Function that maps spectral components of light, (component, view, ...), to signals, (view, channel, ...):
# signals_c = sum_b mixing[c, b] sum_k basis[k, b] (sum of component k with the receptors' weights in band b).
# Here mixing[c, b] is the weight of band b in channel c, and basis[k, b] the contribution of component k to band b.
# Every sum has a fixed order. Rounding is therefore the same for any number of worlds.
ReceptorSums = Callable[[np.ndarray], np.ndarray]


def of_receptors(factors: np.ndarray) -> ReceptorSums:
    """Return the function that maps light, already summed over each receptor, to signals.

    factors: weight of each component in each channel, (channel, component)
    """
    factors = factors.astype(np.float32)

    def signals(light: np.ndarray) -> np.ndarray:
        total: np.ndarray = factors[:, 0, None] * light[0][:, None]
        for k in range(1, len(light)):
            total += factors[:, k, None] * light[k][:, None]
        return total

    return signals


def of_components(
    weights: Sequence[scipy.sparse.csr_array], resolution: tuple[int, int], mixing: np.ndarray, basis: np.ndarray
) -> ReceptorSums:
    """Return the function that maps light along rays to signals.

    Light is given as spectral components. The function applies one `RowProduct` to each component, and adds the
    results. The weights of rays are multiplied in advance by `basis` and `mixing`, and summed over bands.

    weights: weight of each ray in each receptor's signal, sparse matrices (receptor, ray), one for each band
    resolution: rows and columns of receptors
    mixing: weight of each band in each channel, (channel, band)
    basis: contribution of each component of light to each band, (component, band)
    """
    products = [
        RowProduct.from_weights([_mixed(weights, channel * component) for channel in mixing], resolution)
        for component in basis
    ]

    def signals(light: np.ndarray) -> np.ndarray:
        total = products[0](light[0])
        for product, component in zip(products[1:], light[1:], strict=True):
            total += product(component)
        return total

    return signals


def of_bands(products: Sequence[RowProduct], mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
    """Return the function that maps light along rays to signals by one `RowProduct` per band.

    This is cheaper than `of_components` if there are fewer bands than pairs of a component and a channel.

    products: sums over rays, one for each band
    mixing: weight of each band in each channel, (channel, band)
    basis: contribution of each component of light to each band, (component, band)
    """
    mixing, basis = mixing.astype(np.float32), basis.astype(np.float32)
    every = np.array_equal(basis, np.eye(len(basis)))

    def signals(light: np.ndarray) -> np.ndarray:
        planes = [product(_in_band(light, basis[:, b], every, b)) for b, product in enumerate(products)]
        total: np.ndarray = mixing[:, 0, None, None] * planes[0]
        for band in range(1, len(planes)):
            total += mixing[:, band, None, None] * planes[band]
        return total

    return signals


def _in_band(light: np.ndarray, factors: np.ndarray, is_component: bool, band: int) -> np.ndarray:
    if is_component:
        return light[band]
    total: np.ndarray = factors[0] * light[0]
    for k in range(1, len(light)):
        total += factors[k] * light[k]
    return total


def within_stretches(
    weights: Sequence[scipy.sparse.csr_array], resolution: tuple[int, int], share: float
) -> tuple[scipy.sparse.csr_array, ...]:
    """Return weights (receptor, ray) per band, with 0 for the negligible rays at both ends of each row of receptors.

    As many rays as possible are omitted at each end of a row. For every receptor and band, the omitted weights at one
    end amount to at most the fraction `share` / 2 of this receptor's weights in this band. The remaining weights are
    then scaled so that the sums are unchanged.
    """
    height, width = resolution
    rows: list[list[scipy.sparse.csr_array]] = [[] for _ in weights]
    for row in range(height):
        mine = [w[row * width : (row + 1) * width].toarray().astype(np.float64) for w in weights]
        sums = [w.sum(axis=1, keepdims=True) for w in mine]
        # Number of rays at one end that together contribute at most half of `share` to every receptor. The rays at the
        # other end contribute at most the other half.
        ends = [
            min(
                int((np.cumsum(w[:, ::step], axis=1) <= share / 2 * s).sum(axis=1).min())
                for w, s in zip(mine, sums, strict=True)
            )
            for step in (1, -1)
        ]
        for band, (w, s) in enumerate(zip(mine, sums, strict=True)):
            w[:, : ends[0]] = 0
            w[:, w.shape[1] - ends[1] :] = 0
            rows[band].append(scipy.sparse.csr_array((w * (s / w.sum(axis=1, keepdims=True))).astype(np.float32)))
    return tuple(scipy.sparse.vstack(band, format="csr") for band in rows)


def _mixed(weights: Sequence[scipy.sparse.csr_array], factors: np.ndarray) -> scipy.sparse.csr_array:
    """Return the sum over bands of each band's weights (receptor, ray) times its factor, in double precision."""
    total = float(factors[0]) * weights[0].astype(np.float64)
    for factor, band in zip(factors[1:], weights[1:], strict=True):
        total = total + float(factor) * band.astype(np.float64)
    return scipy.sparse.csr_array(total)
