"""Samples of a compound eye: rays that are spread over the acceptance functions of its ommatidia."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from optics.ommatidia.acceptance import AcceptanceFunction
from optics.spectra.spectrum import daylight
from sim.eyes.compound_eye import CompoundEye
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.receptive_fields import bounce_samples
from sim.eyes.sensor import Facets, OmmatidialSensor
from sim.eyes.viewing_directions import facet_frames

PATTERNS = 16  # choice: arrangements of rays that equal ommatidia share
STEPS = 20  # choice: steps of Lloyd's algorithm
COARSE, CELLS = 7, 30  # choice: iterations use every seventh direction if at least 30 of these remain for each ray
CORRECTED = 8  # choice: smallest number of rays with corrected weights; fewer would need negative weights


@dataclass(frozen=True)
class OmmatidialSampling:
    """Samples of a compound eye.

    An ommatidium's rays are spread over its field with a density that increases with the acceptance function. The
    weight of a ray is the integral of the acceptance function over the directions that are nearer to it than to any
    other ray. With 8 rays or more, weights are corrected so that the signals of two test scenes are exact in every
    band. For each distinct `optics.Ommatidium` object of the eye, there are 16 arrangements of rays. Each ommatidium
    has one of them, by a fixed pseudo-random choice, so that the errors of neighbours are nearly independent.

    depth: a single depth layer, so blur does not depend on distance, because facets have a large depth of field
    """

    eye: CompoundEye
    depth: DepthLayers = ONE_PSF

    def sensor(self, rays_per_receptor: float) -> OmmatidialSensor:
        """Return the eye's sensor with this number of rays per ommatidium, rounded to a whole number of at least 1."""
        eye, rays = self.eye, max(1, round(rays_per_receptor))
        turns = np.random.default_rng(1).random((len(eye), 1, 2))
        pattern = np.random.default_rng(0).integers(PATTERNS, size=len(eye))
        local = np.empty((len(eye), rays, 3), np.float32)
        weights = np.empty((len(eye), rays, eye.bands), np.float32)
        _, index = eye.kinds
        for kind, seed in sorted({*zip(index.tolist(), pattern.tolist(), strict=True)}):
            mine, found = (index == kind) & (pattern == seed), _pattern(eye.acceptance(kind), rays, seed)
            local[mine], weights[mine] = found.directions, found.weights
        frames = facet_frames(eye.directions).astype(np.float32)
        share = eye.solid_angles / eye.solid_angles.mean(axis=1, keepdims=True)
        weights *= share[:, None].astype(np.float32)
        return OmmatidialSensor(
            np.einsum("nij,nkj->nki", frames, local).reshape(-1, 3),
            ((bounce_samples(rays) + turns) % 1.0).reshape(-1, 2).astype(np.float32),
            rays,
            Facets(weights.reshape(-1, eye.bands), self._origins(frames, rays)),
            share * daylight(eye.spectral_bands.wavelengths),
            self.depth,
        )

    def _origins(self, frames: np.ndarray, rays: int) -> np.ndarray | None:
        """Return the starting points of the rays in the eye's frame [m], (ray, 3); None if all start at the origin."""
        if self.eye.radius is None:
            return None
        found: np.ndarray = np.repeat(frames[:, :, 2] * np.float32(self.eye.radius), rays, axis=0)
        return found


@dataclass(frozen=True)
class _RayPattern:
    """Rays of one ommatidium.

    directions: unit vectors in a facet's frame (right, up, axis), (ray, 3)
    weights: weights of the rays, (ray, band); in each band, their sum is 1
    """

    directions: np.ndarray
    weights: np.ndarray


def _pattern(accepted: AcceptanceFunction, rays: int, seed: int) -> _RayPattern:
    """Return rays at the centroids of a Voronoi tessellation of directions, by Lloyd's algorithm (1982).

    The weight of a ray in a band is the integral of the band's acceptance function over the ray's cell. Random points
    with importance weights would double the error at edges in the scene. All bands share the rays but differ in their
    acceptance functions, so these weights would vary from ray to ray.

    seed: determines the initial points
    """
    powers = accepted.values * accepted.solid_angles
    powers = (powers / powers.sum(axis=(1, 2), keepdims=True)).reshape(len(powers), -1)
    density, places = powers.mean(axis=0), np.stack(np.meshgrid(accepted.sines, accepted.sines), axis=-1).reshape(-1, 2)
    strata = (np.arange(rays) + np.random.default_rng(seed).random(rays)) / rays
    points = places[np.searchsorted(np.cumsum(density / density.sum()), strata).clip(0, len(places) - 1)]
    coarse = slice(seed % COARSE, None, COARSE) if rays * CELLS < len(places) / COARSE else slice(None)
    for _ in range(STEPS):
        points = _centroids(points, places[coarse], density[coarse])
    nearest = KDTree(points).query(places)[1]
    points = _centroids(points, places, density, nearest)
    weights = np.stack([np.bincount(nearest, power, rays) for power in powers], axis=-1)
    if rays >= CORRECTED:
        spread = (accepted.sines[1] - accepted.sines[0]) ** 2 / (density**2).sum() / (2 * math.pi)
        weights = _corrected(weights, _tests(points, spread), _tests(places, spread), powers)
    up, right = points[:, 1], -points[:, 0]  # the x axis of a pupil points to the owner's left
    return _RayPattern(np.stack([right, up, np.sqrt(1 - right**2 - up**2)], axis=-1), weights)


def _tests(places: np.ndarray, spread: float) -> np.ndarray:
    """Return the light of two test scenes in some directions, as an array (direction, scene).

    The light is uniform in the first scene, and a Gaussian of variance `spread` around the ommatidium's axis in the
    second.

    places: directions: the two components of each unit vector perpendicular to the ommatidium's axis, (direction, 2)
    """
    return np.stack([np.ones(len(places)), np.exp(-(places**2).sum(axis=-1) / (2 * spread))], axis=-1)


def _corrected(weights: np.ndarray, at_rays: np.ndarray, everywhere: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Return weights of an ommatidium's rays with which the signals of the test scenes are exact in every band.

    All bands share the same rays. Without the correction, the rays would represent a wide acceptance function as too
    narrow.

    weights: weights before the correction, (ray, band)
    at_rays: light of the test scenes along the rays, (ray, scene)
    everywhere: light of the test scenes in the directions for which `powers` is tabulated, (direction, scene)
    powers: fraction of the accepted power that comes from each direction, in each band, (band, direction)
    """
    found = weights.copy()
    for band, power in enumerate(powers):
        own = weights[:, band]
        missing = everywhere.T @ power - at_rays.T @ own
        normal = (at_rays * own[:, None]).T @ at_rays
        found[:, band] *= 1 + at_rays @ np.linalg.lstsq(normal, missing, rcond=1e-6)[0]
    return found


def _centroids(
    points: np.ndarray, places: np.ndarray, masses: np.ndarray, nearest: np.ndarray | None = None
) -> np.ndarray:
    """Return for each point the centre of mass of the places that are nearer to it than to other points, (point, 2).

    If the mass of these places is 0, the point stays where it is.

    places, masses: positions (place, 2), and the mass at each position (place,)
    nearest: index of the nearest point for each place, (place,); None: computed here
    """
    nearest = KDTree(points).query(places)[1] if nearest is None else nearest
    total = np.bincount(nearest, masses, len(points))
    safe = np.where(total > 0, total, 1)
    sums = [np.bincount(nearest, masses * axis, len(points)) for axis in places.T]
    found: np.ndarray = np.where(total[:, None] > 0, np.stack(sums, axis=-1) / safe[:, None], points)
    return found
