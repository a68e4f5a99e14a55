"""Samples of an eye's visual field: a requested number of rays or of rectangular areas.

`sim.eyes.sensor` defines the coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse

import optics
from sim.eyes.allowed_error import allowed_error
from sim.eyes.compound_eye import CompoundEye, WorldEye
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.field_areas import BEYOND, FieldAreas
from sim.eyes.ommatidial_sampling import OmmatidialSampling
from sim.eyes.receptive_fields import (
    Draw,
    NoRaysError,
    ReceptiveFields,
    bounce_samples,
    low_discrepancy,
    receptive_fields_of,
)
from sim.eyes.receptor_sums import within_stretches
from sim.eyes.sensor import BoxSensor, ReceptiveFieldSensor, Sensor
from sim.eyes.tangent_plane import aspect_of, directions_of, extent_of, from_receptors, on_tangent_plane, parts_of
from sim.eyes.varied_fields import VariedFields

# Chosen: small weights are omitted if this changes no signal by more than this fraction of the receptors' noise. The
# noise and this error together are then at most √(1 + 0.1²) = 1.005 times the noise alone.
NEGLIGIBLE = 0.1


@dataclass(frozen=True)
class Trial:
    """Rays or rectangular areas that sample the fields of only some of an eye's receptors.

    directions: directions of the rays, or centres of the areas on the tangent plane at distance 1, (ray, 3)
    bounce_samples: see `sim.eyes.sensor.BoxSensor`, (ray, 2)
    weights: weight of each ray in each receptor's signal, (layer * band, receptor, ray)
    extent: width and height of a rectangular area on the tangent plane at distance 1; None for rays
    """

    directions: np.ndarray
    bounce_samples: np.ndarray
    weights: np.ndarray
    extent: tuple[float, float] | None = None


@dataclass(frozen=True)
class BoxSampling:
    """Samples of an eye with a perfect lens.

    Every receptor's area is sampled at the same low-discrepancy points. The requested number of points is rounded to a
    whole number of at least 1. The points of each receptor are shifted by its own fixed random offset (with wrap-around
    at the edges of the area), so that the errors of neighbouring receptors are independent.
    """

    eye: optics.Eye
    depth: DepthLayers = ONE_PSF

    def sensor(self, rays_per_receptor: float) -> BoxSensor:
        """Return the eye's sensor with this number of rays per receptor."""
        rays = max(1, round(rays_per_receptor))
        return BoxSensor(*self._rays(rays, np.arange(np.prod(self.eye.resolution))), rays)

    def areas(self, per_receptor: float, *, in_rows: bool = True) -> BoxSensor:
        """Return the sensor whose samples are rectangles: a grid of `per_receptor` rectangles fills each receptor.

        If `in_rows` is True, the rectangles are as nearly square as possible (see `parts_of`); otherwise the grid has a
        single row.
        """
        count = max(1, round(per_receptor))
        return BoxSensor(*self._areas(count, in_rows, np.arange(np.prod(self.eye.resolution))))

    def area_trial(self, per_receptor: float, receptors: np.ndarray, *, in_rows: bool = True) -> Trial:
        """Return rectangles that fill some receptors (numbered row by row), arranged as by the method `areas`."""
        count = max(1, round(per_receptor))
        plane, unused, _, _, extent = self._areas(count, in_rows, receptors)
        return Trial(plane, unused, self._means(len(receptors), count), extent)

    def _areas(
        self, count: int, in_rows: bool, receptors: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, int, DepthLayers, tuple[float, float]]:
        rows, columns = parts_of(count, in_rows, aspect_of(self.eye))
        y, x = (index.ravel() for index in np.indices((rows, columns)))
        within = np.stack([(x + 0.5) / columns, (y + 0.5) / rows], axis=-1)
        points = (within + self._corners()[receptors]).reshape(-1, 2)
        plane = on_tangent_plane(self.eye, points).astype(np.float32)
        return plane, _unused(plane), count, self.depth, extent_of(self.eye, (1 / columns, 1 / rows))

    def trial(self, rays_per_receptor: float, receptors: np.ndarray) -> Trial:
        """Return this number of rays for each of some receptors (numbered row by row), with their weights."""
        rays = max(1, round(rays_per_receptor))
        return Trial(*self._rays(rays, receptors), self._means(len(receptors), rays))

    def beyond_rim(self, rays: int) -> np.ndarray:
        """Return directions of `rays` rays through each square of a ring around the visual field, (square * rays, 3).

        The squares have the size of a receptor. One square is next to every receptor at the rim of the field, and one
        is at each corner. Squares are numbered row by row.
        """
        rows, columns = (side + 2 for side in self.eye.resolution)
        row, column = np.nonzero(beyond_rim_of(self.eye.resolution))
        corners = np.stack([column - columns / 2, row - rows / 2], axis=-1)[:, None]
        shifts = np.random.default_rng(2).random((len(corners), 1, 2))
        return self._through((low_discrepancy(rays) + shifts) % 1.0 + corners)

    def _means(self, receptors: int, samples: int) -> np.ndarray:
        """Return weights (band, receptor, sample) for the mean over a receptor's `samples` own rays or rectangles."""
        weights = np.kron(np.eye(receptors), np.full((1, samples), 1 / samples))
        return np.broadcast_to(weights, (self.eye.bands, *weights.shape))

    def _rays(self, rays: int, receptors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions of some receptors' rays, (ray, 3), and a point of the unit square per ray, (ray, 2).

        The point determines the direction in which the ray is continued from the surface that it hits.
        """
        height, width = self.eye.resolution
        shifts, turns = (np.random.default_rng(seed).random((height * width, 1, 2))[receptors] for seed in (0, 1))
        corners = self._corners()[receptors]
        directions = self._through((low_discrepancy(rays) + shifts) % 1.0 + corners)
        return directions, ((bounce_samples(rays) + turns) % 1.0).reshape(-1, 2).astype(np.float32)

    def _through(self, points: np.ndarray) -> np.ndarray:
        """Return unit vectors (receptor * ray, 3) towards points of the tangent plane.

        points: x right and y down, in receptor widths and heights, (receptor, ray, 2)
        """
        return directions_of(self.eye, from_receptors(self.eye, points.reshape(-1, 2)))

    def _corners(self) -> np.ndarray:
        """Return the upper left corner of every receptor's square [receptor widths and heights], (receptor, 1, 2).

        The origin is in the middle of the receptors.
        """
        height, width = self.eye.resolution
        row, column = (index.ravel() for index in np.indices((height, width)))
        return np.stack([column - width / 2, row - height / 2], axis=-1)[:, None]


@dataclass(frozen=True)
class FieldSampling:
    """Samples of the visual field of an eye with a pupil: either rays, or the rectangles of a lattice.

    The probability density of rays is the mean of all receptive fields. If the requested number leaves a receptor
    without a ray, `sensor` draws more rays until every receptor has one.

    tolerance: allowed error of a signal, see `sim.eyes.allowed_error`. Rectangles around the receptors are added to the
        lattice until, in a white scene, the light from beyond any one side of the lattice contributes at most this much
        to the receptors' mean signal.
    """

    eye: optics.Eye
    fields: ReceptiveFields
    depth: DepthLayers = ONE_PSF
    tolerance: float | None = None

    def sensor(self, rays_per_receptor: float) -> ReceptiveFieldSensor:
        """Return the eye's sensor with this number of rays per receptor, on average."""
        rays = self._rays(rays_per_receptor)
        while True:
            try:
                return self._sensor(rays)
            except NoRaysError:
                rays += max(1, rays // 4)

    def trial(self, rays_per_receptor: float, receptors: np.ndarray) -> Trial:
        """Return rays drawn for the eye, and their weights in the signals of some receptors (numbered row by row).

        Raises:
            NoRaysError: one of these receptors has no ray.
        """
        draw = self.fields.draw(self._rays(rays_per_receptor))
        weights = self.fields.weights(draw, receptors)
        return Trial(directions_of(self.eye, draw.points), _bounce_samples(draw), weights)

    def _rays(self, rays_per_receptor: float) -> int:
        return max(1, round(rays_per_receptor * np.prod(self.eye.resolution)))

    def areas(self, per_receptor: float, *, in_rows: bool = True) -> ReceptiveFieldSensor:
        """Return the sensor whose samples are rectangles, `per_receptor` of them for each receptor.

        Each receptor's square is divided as in `BoxSampling.areas`. If the number is below 1, several receptors share a
        rectangle. Additional rectangles cover the parts of receptive fields that lie outside all receptors' squares.
        """
        lattice = self._lattice(per_receptor, in_rows)
        plane = on_tangent_plane(self.eye, lattice.middles).astype(np.float32)
        weights = self._in_rows(lambda receptors: lattice.weights(self.fields, receptors))
        extent = extent_of(self.eye, lattice.size)
        return ReceptiveFieldSensor(plane, _unused(plane), weights, self.eye.resolution, self.depth, extent)

    def may_share(self, per_receptor: float, *, in_rows: bool = True) -> bool:
        """Return True if the rectangles from the method `areas` are small enough to distinguish neighbouring receptors.

        A rectangle may be as wide as a receptor or as half of a receptive field, whichever is wider. The same applies
        to the height.
        """
        sides = (1 / n for n in _parts_or_share(per_receptor, in_rows, aspect_of(self.eye)))
        return all(side <= max(1, width / 2) for side, width in zip(sides, self.fields.widths, strict=True))

    def area_trial(self, per_receptor: float, receptors: np.ndarray, *, in_rows: bool = True) -> Trial:
        """Return the rectangles of `areas`, with their weights in some receptors' signals (numbered row by row)."""
        lattice = self._lattice(per_receptor, in_rows)
        plane = on_tangent_plane(self.eye, lattice.middles).astype(np.float32)
        return Trial(plane, _unused(plane), lattice.weights(self.fields, receptors), extent_of(self.eye, lattice.size))

    def _lattice(self, per_receptor: float, in_rows: bool) -> FieldAreas:
        beyond = min(allowed_error(self.eye, self.tolerance) / self.eye.aperture_throughput, BEYOND)
        parts = _parts_or_share(per_receptor, in_rows, aspect_of(self.eye))
        return FieldAreas.from_fields(self.fields, parts, beyond)

    def _sensor(self, rays: int) -> ReceptiveFieldSensor:
        draw = self.fields.draw(rays)
        weights = self._in_rows(lambda receptors: self.fields.weights(draw, receptors))
        directions = directions_of(self.eye, draw.points)
        return ReceptiveFieldSensor(directions, _bounce_samples(draw), weights, self.eye.resolution, self.depth)

    def _in_rows(self, of: Callable[[np.ndarray], np.ndarray]) -> tuple[scipy.sparse.csr_array, ...]:
        """Return the weights of all receptors, without negligible weights.

        of: function that returns the weights of some receptors; it is called for one row of receptors at a time
        """
        height, width = self.eye.resolution
        rows: list[list[scipy.sparse.csr_array]] = []
        for i in range(height):
            dense = of(i * width + np.arange(width)).astype(np.float32)
            rows.append([scipy.sparse.csr_array(plane) for plane in dense])
        weights = tuple(scipy.sparse.vstack(plane, format="csr") for plane in zip(*rows, strict=True))
        return within_stretches(weights, self.eye.resolution, negligible_share(self.eye))


def _parts_or_share(per_receptor: float, in_rows: bool, aspect: float) -> tuple[float, float]:
    """Return the number of rows, and the number of columns, of the rectangles that fill one receptor's area.

    A `per_receptor` of 1 or more is rounded to a whole number. If it is below 1, a rectangle covers several receptors,
    and the results are fractions: √`per_receptor` each with `in_rows`, otherwise 1 row and `per_receptor` columns.

    aspect: see `parts_of`
    """
    if per_receptor >= 1:
        return parts_of(round(per_receptor), in_rows, aspect)
    return (math.sqrt(per_receptor), math.sqrt(per_receptor)) if in_rows else (1.0, per_receptor)


def _unused(plane: np.ndarray) -> np.ndarray:
    """Return zeros (rectangle, 2) for `bounce_samples`: rectangles, unlike rays, need no directions of reflection."""
    return np.zeros((len(plane), 2), np.float32)


def _bounce_samples(draw: Draw) -> np.ndarray:
    return bounce_samples(len(draw)).astype(np.float32)


# Types that build the sensors of one eye for any number of rays: for eyes with a flat retina, and for all eyes.
EyeSampling = BoxSampling | FieldSampling
WorldSampling = EyeSampling | OmmatidialSampling


def beyond_rim_of(resolution: tuple[int, int]) -> np.ndarray:
    """Return a mask that is True in a ring, one receptor wide, around a grid of receptors, (height + 2, width + 2)."""
    return np.pad(np.zeros(resolution, bool), 1, constant_values=True)


def eye_sampling(eye: WorldEye, depth: DepthLayers = ONE_PSF) -> WorldSampling:
    """Return `OmmatidialSampling` for a compound eye, `BoxSampling` for a perfect lens, and otherwise `FieldSampling`.

    Raises:
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
    """
    if isinstance(eye, CompoundEye):
        return OmmatidialSampling(eye, depth)
    if eye.pupil is None:
        return BoxSampling(eye)
    kind = ReceptiveFields if eye.lattice is None else VariedFields
    return FieldSampling(eye, receptive_fields_of(eye, depth, kind), depth)


def build_sensor(eye: optics.Eye, rays_per_receptor: float, depth: DepthLayers = ONE_PSF) -> Sensor:
    """Return the sensor of an eye with this number of rays per receptor.

    Raises:
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
    """
    return eye_sampling(eye, depth).sensor(rays_per_receptor)


def negligible_share(eye: optics.Eye) -> float:
    """Return the fraction of a receptor's total weight that may be lost when small weights of samples are set to 0.

    Losing a fraction s changes a signal by at most s times the throughput of the aperture, if nothing in the scene is
    brighter than white in full daylight.
    """
    return min(NEGLIGIBLE * eye.noise_sigma / eye.aperture_throughput, eye.tolerance)
