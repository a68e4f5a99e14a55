"""Where an eye looks and what each receptor makes of the light: ray directions and their weights.

All directions are fixed when the sensor is built, so that rendering is the same kernel every step. Coordinates
are the visual field's tangent plane, in receptor pitches: x to the right, y *down* as rows run, origin on the
optical axis; receptor (i, j) covers [j - w/2, j + 1 - w/2] x [i - h/2, i + 1 - h/2].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

import optics
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.receptive_fields import (
    Draw,
    NoRaysError,
    ReceptiveFields,
    bounce_samples,
    low_discrepancy,
    receptive_fields_of,
)
from sim.eyes.receptor_sums import ReceptorSums, RowProduct, of_bands, of_components, of_receptors, within_stretches

# Chosen: weights that together change no signal by more than this share of the receptors' noise are left out; beside
# it, that makes √(1 + 0.1²) = 1.005 of it.
NEGLIGIBLE = 0.1


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

    Weights far above and below a row of receptors are 0 where they are too small to matter: together they are less than
    the tolerance asked of the PSF, and change no signal of a scene up to white in full daylight by more than
    NEGLIGIBLE of the receptors' noise.

    directions: unit vectors in the eye's frame, (ray, 3) float32
    bounce_samples: of each ray, on the unit square: which way light that bounces goes on, (ray, 2) float32
    weights: per plane, a band of a depth layer, sparse (receptor, ray)
    resolution: receptors (height, width)
    depth: the layers
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    weights: tuple[scipy.sparse.csr_array, ...]
    resolution: tuple[int, int]
    depth: DepthLayers = ONE_PSF
    rays_per_receptor: int = 1  # summed in the kernel: none
    extent: None = None  # samples are rays

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


@dataclass(frozen=True)
class Trial:
    """Some receptors of a sensor that need not be built: directions (ray, 3), bounce samples (ray, 2) and weights
    (layer * band, receptor, ray)."""

    directions: np.ndarray
    bounce_samples: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class BoxSampling:
    """Every receptor's square sampled by the same low-discrepancy points, each receptor's shifted (on the torus)
    by its own fixed random offset so that the errors of neighbours are independent; a whole number of points each."""

    eye: optics.Eye
    depth: DepthLayers = ONE_PSF

    def sensor(self, rays_per_receptor: float) -> BoxSensor:
        """The sensor with so many rays per receptor."""
        rays = max(1, round(rays_per_receptor))
        return BoxSensor(*self._rays(rays, np.arange(np.prod(self.eye.resolution))), rays)

    def areas(self, per_receptor: float, *, in_rows: bool = True) -> BoxSensor:
        """The sensor whose samples are all of a receptor's square, cut into so many rectangles: one row of them, or, in
        rows, as many rows as columns or fewer."""
        count = max(1, round(per_receptor))
        rows = max(n for n in range(1, math.isqrt(count) + 1) if count % n == 0) if in_rows else 1
        columns = count // rows
        y, x = (index.ravel() for index in np.indices((rows, columns)))
        within = np.stack([(x + 0.5) / columns, (y + 0.5) / rows], axis=-1)
        plane = on_tangent_plane(self.eye, (within + self._corners()).reshape(-1, 2)).astype(np.float32)
        side = self.eye.receptor_pitch / self.eye.sensor_distance
        unused = np.zeros((len(plane), 2), np.float32)
        return BoxSensor(plane, unused, count, extent=(side / columns, side / rows))

    def trial(self, rays_per_receptor: float, receptors: np.ndarray) -> Trial:
        """What that sensor has for these receptors (numbered row by row)."""
        rays = max(1, round(rays_per_receptor))
        weights = np.kron(np.eye(len(receptors)), np.full((1, rays), 1 / rays))
        return Trial(*self._rays(rays, receptors), np.broadcast_to(weights, (self.eye.bands, *weights.shape)))

    def _rays(self, rays: int, receptors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Directions and places."""
        height, width = self.eye.resolution
        shifts, turns = (np.random.default_rng(seed).random((height * width, 1, 2))[receptors] for seed in (0, 1))
        corners = self._corners()[receptors]
        directions = directions_of(self.eye, ((low_discrepancy(rays) + shifts) % 1.0 + corners).reshape(-1, 2))
        return directions, ((bounce_samples(rays) + turns) % 1.0).reshape(-1, 2).astype(np.float32)

    def _corners(self) -> np.ndarray:
        """Of every receptor's square, upper left, (receptor, 1, 2)."""
        height, width = self.eye.resolution
        row, column = (index.ravel() for index in np.indices((height, width)))
        return np.stack([column - width / 2, row - height / 2], axis=-1)[:, None]


@dataclass(frozen=True)
class FieldSampling:
    """Directions drawn from the mixture of all receptive fields; as many as asked for, or as it takes until every
    receptor has one."""

    eye: optics.Eye
    fields: ReceptiveFields
    depth: DepthLayers = ONE_PSF

    def sensor(self, rays_per_receptor: float) -> ReceptiveFieldSensor:
        """The sensor with so many rays per receptor, on average."""
        rays = self._rays(rays_per_receptor)
        while True:
            try:
                return self._sensor(rays)
            except NoRaysError:
                rays += max(1, rays // 4)

    def trial(self, rays_per_receptor: float, receptors: np.ndarray) -> Trial:
        """What that sensor has for these receptors.

        Raises:
            NoRaysError: one of them has no ray.
        """
        draw = self.fields.draw(self._rays(rays_per_receptor))
        weights = self.fields.weights(draw, receptors)
        return Trial(directions_of(self.eye, draw.points), _bounce_samples(draw), weights)

    def _rays(self, rays_per_receptor: float) -> int:
        return max(1, round(rays_per_receptor * np.prod(self.eye.resolution)))

    def _sensor(self, rays: int) -> ReceptiveFieldSensor:
        draw, (height, width) = self.fields.draw(rays), self.eye.resolution
        rows: list[list[scipy.sparse.csr_array]] = []
        for i in range(height):
            dense = self.fields.weights(draw, i * width + np.arange(width)).astype(np.float32)
            rows.append([scipy.sparse.csr_array(plane) for plane in dense])
        weights = tuple(scipy.sparse.vstack(plane, format="csr") for plane in zip(*rows, strict=True))
        weights = within_stretches(weights, self.eye.resolution, negligible_share(self.eye))
        directions = directions_of(self.eye, draw.points)
        return ReceptiveFieldSensor(directions, _bounce_samples(draw), weights, self.eye.resolution, self.depth)


def _bounce_samples(draw: Draw) -> np.ndarray:
    return bounce_samples(len(draw)).astype(np.float32)


# Makes sensors of one eye, with any number of rays.
EyeSampling = BoxSampling | FieldSampling


def eye_sampling(eye: optics.Eye, depth: DepthLayers = ONE_PSF) -> EyeSampling:
    """How an eye is sampled.

    Raises:
        optics.AccuracyError: a pupil whose light spreads too far to be computed.
    """
    return BoxSampling(eye) if eye.pupil is None else FieldSampling(eye, receptive_fields_of(eye, depth), depth)


def build_sensor(eye: optics.Eye, rays_per_receptor: float, depth: DepthLayers = ONE_PSF) -> Sensor:
    """The sensor of an eye.

    Raises:
        optics.AccuracyError: a pupil whose light spreads too far to be computed.
    """
    return eye_sampling(eye, depth).sensor(rays_per_receptor)


def directions_of(eye: optics.Eye, plane: np.ndarray) -> np.ndarray:
    """Unit vectors (ray, 3) in the eye's frame of points (x right, y down) [receptor pitches] on the tangent plane."""
    v = on_tangent_plane(eye, plane)
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(np.float32)


def on_tangent_plane(eye: optics.Eye, plane: np.ndarray) -> np.ndarray:
    """The same points in the eye's frame, on the plane at distance 1, (ray, 3)."""
    side = eye.receptor_pitch / eye.sensor_distance
    return np.stack([plane[:, 0] * side, -plane[:, 1] * side, np.ones(len(plane))], axis=-1)


def negligible_share(eye: optics.Eye) -> float:
    """Share of a receptor's weights that can be left out: a share s changes a signal by a² s at most."""
    return min(NEGLIGIBLE * eye.noise_sigma / eye.throughput, eye.tolerance)
