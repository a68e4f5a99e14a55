"""Samples of a compound eye: rays drawn from the acceptance functions of its ommatidia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.ommatidia.acceptance import AcceptanceFunction
from optics.spectra.spectrum import daylight
from sim.eyes.compound_eye import CompoundEye
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.receptive_fields import bounce_samples, low_discrepancy
from sim.eyes.sensor import Facets, OmmatidialSensor
from sim.eyes.viewing_directions import facet_frames


@dataclass(frozen=True)
class OmmatidialSampling:
    """Samples of a compound eye.

    All ommatidia use the same low-discrepancy points, shifted by a fixed random offset of each ommatidium, so that the
    errors of neighbours are independent. The points are mapped to directions by the inverse of a cumulative
    distribution, the mean over bands of the normalised acceptance functions.
    """

    eye: CompoundEye
    depth: DepthLayers = ONE_PSF

    def sensor(self, rays_per_receptor: float) -> OmmatidialSensor:
        """Return the eye's sensor with this number of rays per ommatidium, rounded to a whole number."""
        eye, rays = self.eye, max(1, round(rays_per_receptor))
        shifts, turns = (np.random.default_rng(seed).random((len(eye), 1, 2)) for seed in (0, 1))
        points = (low_discrepancy(rays) + shifts) % 1.0
        local = np.empty((len(eye), rays, 3), np.float32)
        weights = np.empty((len(eye), rays, eye.bands), np.float32)
        kinds, index = eye.kinds
        for kind in range(len(kinds)):
            mine = np.flatnonzero(index == kind)
            local[mine], weights[mine] = _drawn(eye.acceptance(kind), points[mine])
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
        """Return the starting points of the rays in the eye's frame [m], (ray, 3); None if they all start at 0."""
        if self.eye.radius is None:
            return None
        found: np.ndarray = np.repeat(frames[:, :, 2] * np.float32(self.eye.radius), rays, axis=0)
        return found


def _drawn(accepted: AcceptanceFunction, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return directions (..., 3) in a facet's frame (right, up, axis), and their weights in each band, (..., band).

    The weights in each band sum to 1 over the last axis but one.

    points: points in the unit square, (..., 2)
    """
    powers = accepted.values * accepted.solid_angles
    powers /= powers.sum(axis=(1, 2), keepdims=True)
    density = powers.mean(axis=0)
    side, pitch = len(accepted.sines), accepted.sines[1] - accepted.sines[0]
    ends = np.concatenate([[0.0], np.cumsum(density)])
    ends /= ends[-1]
    rows = ends[::side]
    row = np.clip(np.searchsorted(rows, points[..., 0], side="right") - 1, 0, side - 1)
    mass = rows[row + 1] - rows[row]
    within = (points[..., 0] - rows[row]) / mass
    target = rows[row] + points[..., 1] * mass
    cell = np.clip(np.searchsorted(ends, target, side="right") - 1, row * side, row * side + side - 1)
    along = (target - ends[cell]) / np.maximum(ends[cell + 1] - ends[cell], np.finfo(float).tiny)
    up = accepted.sines[row] + (within - 0.5) * pitch
    # The x axis of a pupil points to the owner's left (docs/architecture.md, "Coordinates and orientation").
    right = -(accepted.sines[cell - row * side] + (np.clip(along, 0, 1) - 0.5) * pitch)
    directions = np.stack([right, up, np.sqrt(np.maximum(1 - right**2 - up**2, 0))], axis=-1)
    weights = np.moveaxis(powers.reshape(len(powers), -1)[:, cell] / density.ravel()[cell], 0, -1)
    total = weights.sum(axis=-2, keepdims=True)
    return directions, weights / total
