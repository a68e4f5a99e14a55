"""Where an eye looks and what each receptor makes of the light: ray directions and their weights.

`sim.eyes.sampling` says which these are.

All directions are fixed when the sensor is built, so that rendering is the same kernel every step. Coordinates
are the visual field's tangent plane, in receptor pitches: x to the right, y *down* as rows run, origin on the
optical axis; receptor (i, j) covers [j - w/2, j + 1 - w/2] x [i - h/2, i + 1 - h/2].
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
    """Perfect lens: a receptor's signal is the mean over the square it covers.

    directions: unit vectors in the eye's frame (x right, y up, z optical axis), (ray, 3) float32; ray = receptor *
        rays_per_receptor + sample
    bounce_samples: of each ray, on the unit square: which way light that bounces goes on, (ray, 2) float32
    rays_per_receptor: samples of one receptor; the renderer sums them in its kernel
    depth: nothing is blurred, whatever its distance
    extent: where samples are rectangles of the tangent plane at distance 1, their width and height; directions are then
        those of their middles, up to that plane. None: samples are rays
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    rays_per_receptor: int
    depth: DepthLayers = ONE_PSF
    extent: tuple[float, float] | None = None

    def receptor_radiance(self, sums: np.ndarray) -> np.ndarray:
        """Mean radiance of each receptor from the sums over its rays: (band, view, receptor), both ways."""
        return sums * np.float32(1.0 / self.rays_per_receptor)

    def receptor_sums(self, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        """Signals from sums of components over receptors' rays, see sim.eyes.receptor_sums."""
        return of_receptors(mixing @ basis.T / self.rays_per_receptor)


@dataclass(frozen=True)
class ReceptiveFieldSensor:
    """An eye behind a pupil: one set of directions, drawn from the mixture of all receptive fields, serves all
    receptors and bands; a receptor's signal is a weighted sum (importance sampling, self-normalised):

        signal_r = sum_p W_b[r, p] radiance_b(p),   W_b[r, p] ∝ RF_{r,b}(p) / q(p),   sum_p W_b[r, p] = power_b

    with RF the turned PSF kernel convolved with the receptor's square, q the density that directions were drawn from
    and power_b the fraction of the pupil's power inside the kernel. With several depth layers there is such a W for
    each of them, for its share of the light along a ray.

    Where samples are areas of the visual field and not rays, W_b[r, p] is the share of the field in area p.

    Weights far above and below a row of receptors are 0 where they are too small to matter: together they are less than
    the tolerance asked of the PSF, and change no signal of a scene up to white in full daylight by more than
    `sim.eyes.sampling.NEGLIGIBLE` of the receptors' noise.

    directions: unit vectors in the eye's frame, (ray, 3) float32
    bounce_samples: of each ray, on the unit square: which way light that bounces goes on, (ray, 2) float32
    weights: per plane, a band of a depth layer, sparse (receptor, ray)
    resolution: receptors (height, width)
    depth: the layers
    extent: as of `BoxSensor`
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    weights: tuple[scipy.sparse.csr_array, ...]
    resolution: tuple[int, int]
    depth: DepthLayers = ONE_PSF
    extent: tuple[float, float] | None = None
    rays_per_receptor: int = 1  # summed in the kernel: none

    def receptor_radiance(self, radiance: np.ndarray) -> np.ndarray:
        """(layer * band, view, ray) -> (band, view, receptor)."""
        planes = [product(plane) for product, plane in zip(self._products, radiance, strict=True)]
        layers = np.stack([plane.reshape(len(plane), -1) for plane in planes])
        return layers.reshape(self.depth.count, -1, *layers.shape[1:]).sum(axis=0)

    def receptor_sums(self, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        """Signals from components along rays (layer * component, view, ray), see sim.eyes.receptor_sums."""
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
        return [RowProduct.of([w], self.resolution) for w in self.weights]

    @property
    def density(self) -> float:
        """Share of weights that are not zero."""
        return float(np.mean([w.nnz / np.prod(w.shape) for w in self.weights]))


Sensor = BoxSensor | ReceptiveFieldSensor
