"""Ray directions of an eye, and the weights with which light along these rays enters the receptors' signals.

`sim.eyes.sampling` chooses the samples. All directions are fixed when the sensor is built, so that the same kernel
renders every step.

Coordinates are positions on the visual field's tangent plane: x to the right, in average receptor widths, and y
*down*, in average receptor heights, in the direction of increasing rows. The origin is on the optical axis. If h x w
receptors have equal sizes, receptor (i, j) covers the square [j - w/2, j + 1 - w/2] x [i - h/2, i + 1 - h/2].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

from optics.numerics.read_only import ReadOnlyArrays
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.receptor_sums import ReceptorSums, RowProduct, of_bands, of_components, of_receptors


@dataclass(frozen=True)
class Facets(ReadOnlyArrays):
    """Weights and starting points of the rays of a compound eye.

    weights: weight of each ray's light in each band, (ray, band) float32
    origins: starting points of the rays in the eye's frame [m], (ray, 3); None: all rays start at the pupil
    """

    weights: np.ndarray
    origins: np.ndarray | None = None


@dataclass(frozen=True)
class BoxSensor(ReadOnlyArrays):
    """Sensor of an eye with a perfect lens: a receptor's signal is the mean of the light over the receptor's area.

    directions: unit vectors in the eye's frame (x right, y up, z optical axis), (ray, 3) float32; ray = receptor *
        rays_per_receptor + sample
    bounce_samples: points in the unit square, one for each ray, that determine the direction of its bounce ray (see
        `sim.tracing.lighting`), (ray, 2) float32
    rays_per_receptor: number of samples of one receptor; the renderer's kernel sums them
    depth: a single layer, because a perfect lens is in focus at all distances
    extent: None if the samples are rays. If they are areas, these are equal rectangles on the tangent plane at
        distance 1: `extent` is their width and height, and `directions` are the positions of their centres.
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    rays_per_receptor: int
    depth: DepthLayers = ONE_PSF
    extent: tuple[float, float] | None = None
    facets = None

    def receptor_radiance(self, sums: np.ndarray) -> np.ndarray:
        """Return the mean radiance of each receptor, (band, view, receptor).

        sums: sums of radiance over the receptor's rays, in an array of the same shape
        """
        return sums * np.float32(1.0 / self.rays_per_receptor)

    def receptor_sums(self, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        """Return the function that computes signals from the light of each receptor.

        The argument of that function is the sum of each spectral component over the receptor's rays.

        mixing: weight of each band in each channel, (channel, band)
        basis: contribution of each component to each band, (component, band)
        """
        return of_receptors(mixing @ basis.T / self.rays_per_receptor)


@dataclass(frozen=True)
class ReceptiveFieldSensor(ReadOnlyArrays):
    """Sensor of an eye with a pupil. All receptors, in all bands, use the same set of directions.

    The directions are drawn from the mixture of all receptive fields. In band b, the signal of receptor r is a
    weighted sum over rays p (self-normalised importance sampling):

        signal_{r,b} = sum_p W_b[r, p] radiance_b(p),   W_b[r, p] ∝ RF_{r,b}(p) / q(p),   sum_p W_b[r, p] = power_b

    RF is the receptive field, q is the density of the directions, and power_b is the fraction of the power through the
    pupil that falls inside the receptive field (see `sim.eyes.receptive_fields.ReceptiveFields`). With several depth
    layers, each layer has its own W, which is applied to the fraction of a ray's light that the layer receives.

    If the samples are areas of the visual field instead of rays, W_b[r, p] is the integral of the receptive field
    over area p.

    If a ray is far above or below the part of the visual field that a row of receptors sees, its small weights for
    these receptors are set to 0. For each receptor, they amount to at most the fraction `eye.tolerance` of the sum of
    its weights. If nothing in the scene is brighter than white in full daylight, this changes no signal by more than
    `sim.eyes.sampling.NEGLIGIBLE` times the receptors' noise.

    directions: unit vectors in the eye's frame, (ray, 3) float32
    bounce_samples: points in the unit square, one for each ray, that determine the direction of its bounce ray (see
        `sim.tracing.lighting`), (ray, 2) float32
    weights: sparse matrices (receptor, ray), one for each band of each depth layer
    resolution: receptors (height, width)
    depth: the depth layers
    extent: see `BoxSensor`
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    weights: tuple[scipy.sparse.csr_array, ...]
    resolution: tuple[int, int]
    depth: DepthLayers = ONE_PSF
    extent: tuple[float, float] | None = None
    rays_per_receptor: int = 1  # 1, because the renderer's kernel does not sum the rays
    facets = None

    def receptor_radiance(self, radiance: np.ndarray) -> np.ndarray:
        """Return the receptors' radiance (band, view, receptor) from radiance along rays (layer * band, view, ray)."""
        planes = [product(plane) for product, plane in zip(self._products, radiance, strict=True)]
        layers = np.stack([plane.reshape(len(plane), -1) for plane in planes])
        return layers.reshape(self.depth.count, -1, *layers.shape[1:]).sum(axis=0)

    def receptor_sums(self, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        """Return the function that computes signals from the light along rays.

        The argument of that function is the light along the rays, (layer * component, view, ray). The light in each
        spectral component is divided between the depth layers, the distances for which the eye has a PSF. A view is one
        eye in one world.

        mixing: weight of each band in each channel, (channel, band)
        basis: contribution of each component to each band, (component, band)
        """
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
        """Number of nonzero weights divided by the number of all weights."""
        return float(np.mean([w.nnz / np.prod(w.shape) for w in self.weights]))


@dataclass(frozen=True)
class OmmatidialSensor(ReadOnlyArrays):
    """Sensor of a compound eye, whose ommatidia have their own rays.

    The kernel multiplies the light along each ray by the weight of the ray and sums over an ommatidium's rays. Let Ω_b
    be the integral of the acceptance function in band b over all directions. In this band, the weight of a ray is the
    integral of the acceptance function over all directions that are closer to this ray than to any other, divided by
    the mean of Ω over all bands. With 8 rays or more, the weights are then corrected (see
    `sim.eyes.ommatidial_sampling`). They sum to Ω_b / mean(Ω). The signal of receptor type t is Σ_b mixing[t, b] times
    the sum in band b (see `receptor_sums`), divided by the same expression for white light.

    directions, bounce_samples, rays_per_receptor: see `BoxSensor`
    facets: weights and starting points of the rays
    white: sum in each band for white light, (ommatidium, band)
    depth: a single layer, because facets have a large depth of field
    extent: always None, because the samples are rays
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    rays_per_receptor: int
    facets: Facets
    white: np.ndarray
    depth: DepthLayers = ONE_PSF
    extent: tuple[float, float] | None = None

    def receptor_radiance(self, sums: np.ndarray) -> np.ndarray:
        """Return the mean radiance in each ommatidium's field, (band, view, ommatidium).

        sums: sums of weighted radiance over the ommatidium's rays, in an array of the same shape
        """
        weights = self.facets.weights.reshape(len(self.white), self.rays_per_receptor, -1).sum(axis=1)
        return np.asarray(sums / weights.T[:, None].astype(np.float32))

    def receptor_sums(self, mixing: np.ndarray, basis: np.ndarray) -> ReceptorSums:
        """Return the function that computes signals from the light of each ommatidium.

        The argument of that function is the weighted sum of each spectral component over the ommatidium's rays. Each
        component must be the light in one band.

        mixing: weight of each band in each channel, (channel, band)
        basis: contribution of each component to each band, (component, band), the identity matrix
        """
        signals, white = of_receptors(mixing @ basis.T), (mixing @ self.white.T).astype(np.float32)
        return lambda light: signals(light) / white


Sensor = BoxSensor | ReceptiveFieldSensor | OmmatidialSensor
