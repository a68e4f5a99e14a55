"""Ray directions of an eye, and the receptors' weights for the light along them.

`sim.eyes.sampling` chooses the samples. All directions are fixed when the sensor is built, so that the same kernel
renders every step.

Coordinates refer to the visual field's tangent plane, in receptor pitches: x to the right, y *down* in the
direction of increasing rows, origin on the optical axis. Receptor (i, j) covers [j - w/2, j + 1 - w/2] x [i - h/2, i +
1 - h/2].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.receptor_sums import ReceptorSums, RowProduct, of_bands, of_components, of_receptors


@dataclass(frozen=True)
class BoxSensor:
    """An eye with a perfect lens: a receptor's signal is the mean over the square that it covers.

    directions: unit vectors in the eye's frame (x right, y up, z optical axis), (ray, 3) float32; ray = receptor *
        rays_per_receptor + sample
    bounce_samples: points in the unit square, one for each ray, that set the direction of reflected light, (ray, 2)
        float32
    rays_per_receptor: samples of one receptor; the renderer sums them in its kernel
    depth: a single layer, since nothing is blurred at any distance
    extent: width and height of areas, as rectangles of the tangent plane at distance 1. The directions then end at the
        areas' centres on that plane. None: the samples are rays.
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    rays_per_receptor: int
    depth: DepthLayers = ONE_PSF
    extent: tuple[float, float] | None = None

    def receptor_radiance(self, sums: np.ndarray) -> np.ndarray:
        """Return the mean radiance of each receptor, (band, view, receptor), from the sums over its rays in the same
        shape."""
        return sums * np.float32(1.0 / self.rays_per_receptor)

    def receptor_sums(self, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        """Return the map from sums of components over receptors' rays to signals, see sim.eyes.receptor_sums."""
        return of_receptors(mixing @ basis.T / self.rays_per_receptor)


@dataclass(frozen=True)
class ReceptiveFieldSensor:
    """An eye behind a pupil. One set of directions, drawn from the mixture of all receptive fields, serves all
    receptors and bands. A receptor's signal is a weighted sum (self-normalised importance sampling):

        signal_r = sum_p W_b[r, p] radiance_b(p),   W_b[r, p] ∝ RF_{r,b}(p) / q(p),   sum_p W_b[r, p] = power_b

    RF is the PSF, rotated by 180° and convolved with the receptor's square. q is the density of the directions, and
    power_b is the fraction of the pupil's power inside the kernel. With several depth layers, each has its own W for
    its share of the light along a ray.

    If the samples are areas of the visual field instead of rays, W_b[r, p] is the share of the field in area p.

    Small weights far above and below a row of receptors are set to 0. Together they are less than the requested
    tolerance of the PSF. They change no signal of a scene up to white in full daylight by more than
    `sim.eyes.sampling.NEGLIGIBLE` of the receptors' noise.

    directions: unit vectors in the eye's frame, (ray, 3) float32
    bounce_samples: points in the unit square, one for each ray, that set the direction of reflected light, (ray, 2)
        float32
    weights: sparse matrices (receptor, ray), one for each band of each depth layer
    resolution: receptors (height, width)
    depth: the layers
    extent: see `BoxSensor`
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    weights: tuple[scipy.sparse.csr_array, ...]
    resolution: tuple[int, int]
    depth: DepthLayers = ONE_PSF
    extent: tuple[float, float] | None = None
    rays_per_receptor: int = 1  # the kernel sums no rays

    def receptor_radiance(self, radiance: np.ndarray) -> np.ndarray:
        """Map radiance (layer * band, view, ray) to (band, view, receptor)."""
        planes = [product(plane) for product, plane in zip(self._products, radiance, strict=True)]
        layers = np.stack([plane.reshape(len(plane), -1) for plane in planes])
        return layers.reshape(self.depth.count, -1, *layers.shape[1:]).sum(axis=0)

    def receptor_sums(self, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        """Return the map from components along rays (layer * component, view, ray) to signals, see
        sim.eyes.receptor_sums."""
        count, k = self.depth.count, len(basis)
        bands = len(self.weights) // count
        sums_of_layers = [self._sums_of_layer(layer * bands, bands, mixing, basis) for layer in range(count)]
        if count == 1:
            return sums_of_layers[0]
        return lambda light: np.sum([of_layer(light[i * k :][:k]) for i, of_layer in enumerate(sums_of_layers)], axis=0)

    def _sums_of_layer(self, first: int, bands: int, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        planes = slice(first, first + bands)
        if len(mixing) * len(basis) > bands:
            return of_bands(self._products[planes], mixing, basis)
        return of_components(self.weights[planes], self.resolution, mixing, basis)

    @cached_property
    def _products(self) -> list[RowProduct]:
        return [RowProduct.from_weights([w], self.resolution) for w in self.weights]

    @property
    def density(self) -> float:
        """Share of weights that are not zero."""
        return float(np.mean([w.nnz / np.prod(w.shape) for w in self.weights]))


Sensor = BoxSensor | ReceptiveFieldSensor
