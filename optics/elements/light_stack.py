"""Light through several pupils at once, as NumPy arrays whose first axis counts the beams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from optics.elements.beam import Beam
from optics.elements.light_geometry import FEW, MANY, RIM, LightGeometry, disk_points, light_geometry
from optics.elements.pupil_path import relief_height, wavefront_ahead
from optics.elements.pupil_polynomials import power_sum, powers_of
from optics.numerics.autodiff import number
from optics.numerics.read_only import ReadOnlyArrays, read_only

__all__ = ["LightStack", "StackSlopes"]

SPHERE_POINTS = (
    8  # choice: number of Chebyshev points across the pupil for spheres, in addition to those of polynomials
)
STEEP_POWERS = 5  # choice: number of powers from which on polynomials are much steeper at the rim than elsewhere
TILT_STEP = 1e-3  # choice: step [radii] of the slopes of oblique waves


@dataclass(frozen=True, eq=False)
class StackSlopes(ReadOnlyArrays):
    """Gradients of the optical paths behind several pupils, at the same points (x, y) relative to each pupil's radius.

    across: number of points across the pupils, see `disk_points`.
    x, y: points in units of the radius, (point,).
    along_x, along_y: gradients, (beam, point).
    """

    across: int
    x: np.ndarray
    y: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray

    @cached_property
    def steepest(self) -> np.ndarray:
        """Largest gradient of each beam's optical path at the points (`x`, `y`), as a magnitude, array (beam,)."""
        found: np.ndarray = np.sqrt((np.square(self.along_x) + np.square(self.along_y)).max(axis=1))
        return read_only(found)


@dataclass(frozen=True, eq=False)
class LightStack:
    """Light of several beams, without derivatives.

    beams: the light. Pupils, sources, wavelengths and distances may all differ. Pixelated reliefs are not supported.
    """

    beams: tuple[Beam, ...]

    def part(self, places: Sequence[int] | np.ndarray) -> LightStack:
        """Return the light of the beams with these indices."""
        found = LightStack(tuple(self.beams[place] for place in places))
        chosen = set(map(int, places))
        coefficients, others = self._polynomials
        mine = [k for k, place in enumerate(places) if int(place) in chosen.intersection(others)]
        found.__dict__["_polynomials"] = read_only(coefficients[np.asarray(places, int)]), mine
        return found

    @cached_property
    def level(self) -> LightStack:
        """The light of the same pupils without reliefs."""
        return LightStack(tuple(replace(beam, pupil=beam.pupil.level) for beam in self.beams))

    @cached_property
    def geometry(self) -> LightGeometry:
        """Sources, lenses and media."""
        found = []
        for beam, tilted, (behind, before, _) in zip(self.beams, self._tilted, self._indices, strict=True):
            focal = beam.pupil.thin_lens_focal_length
            lens = math.inf if focal is None else number(focal)
            source = math.inf if tilted else beam.source.distance
            radius, distance = beam.pupil.radius, number(beam.distance)
            found.append((radius, distance, beam.wavelength, behind, before, lens, source))
        return light_geometry(found)

    @property
    def radius(self) -> np.ndarray:
        """Radii of the pupils [m], (beam,)."""
        return self.geometry.arrays[0]

    @property
    def distance(self) -> np.ndarray:
        """Distances of the sensor planes behind the pupils [m], (beam,)."""
        return self.geometry.arrays[1]

    @property
    def vacuum_wavelength(self) -> np.ndarray:
        """Wavelengths in vacuum [m], (beam,)."""
        return self.geometry.arrays[2]

    @property
    def wavelength(self) -> np.ndarray:
        """Wavelengths in the media behind the pupils [m], (beam,)."""
        return self.geometry.wavelength

    @cached_property
    def _indices(self) -> list[tuple[float, float, float]]:
        """Refractive indices behind and before the pupil, and the index step of the relief, for each beam.

        The index step is the index of the relief minus that of the medium around it. Beams often have the same media
        and wavelength. The dispersion curves of the media are then evaluated once for all of them.
        """
        known: dict[Any, tuple[float, float, float]] = {}
        found = []
        for beam in self.beams:
            pupil, wavelength = beam.pupil, beam.wavelength
            media = pupil.n, pupil.medium_n, pupil.object_n, wavelength
            values = known.get(media)
            if values is None:
                step = number(pupil.index_step(wavelength))
                values = known[media] = beam.index, pupil.index_before(wavelength), step
            found.append(values)
        return found

    @cached_property
    def _tilted(self) -> list[bool]:
        return [beam.source.angle != (0.0, 0.0) for beam in self.beams]

    @cached_property
    def _polynomials(self) -> tuple[np.ndarray, list[int]]:
        """Coefficients of polynomial reliefs and wavefronts (see `powers_of`), and the beams without such polynomials.

        The coefficients of a beam are 0 if its relief or wavefront is not a polynomial. The second result contains the
        indices of these beams.
        """
        known = [
            powers_of(beam.pupil, beam.wavelength, step)
            for beam, (_, _, step) in zip(self.beams, self._indices, strict=True)
        ]
        size = max([len(one) for one in known if one is not None], default=1)
        found = np.zeros((len(known), size, size))
        for place, one in enumerate(known):
            if one is not None:
                found[place, : len(one), : len(one)] = one
        return read_only(found), [place for place, one in enumerate(known) if one is None]

    @cached_property
    def mapped(self) -> np.ndarray:
        """True for beams whose relief or wavefront may have fine detail because it is not a polynomial, (beam,)."""
        return read_only(np.isin(np.arange(len(self.beams)), self._polynomials[1]))

    @cached_property
    def smooth_points(self) -> int | None:
        """Number of Chebyshev points along a pupil's diameter that is enough to interpolate the optical paths.

        None if light is oblique, or if a relief or wavefront is not a polynomial (for example, a map of samples).
        """
        coefficients, others = self._polynomials
        if others or any(self._tilted):
            return None
        return len(coefficients[0]) + SPHERE_POINTS

    def waves(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the optical paths at points (x, y) [m], in waves, up to a constant, (beam, y, x).

        x, y: points, (beam, y, x).
        """
        per_radius = (1 / self.radius)[:, None, None]
        coefficients, others = self._polynomials
        total = np.zeros((len(self.beams), *x.shape[1:])) + self.geometry.waves(x, y)
        if coefficients.any():
            total += power_sum(coefficients, x * per_radius, y * per_radius)
        for place in range(len(self.beams)):
            if place in others or self._tilted[place]:
                total[place] += self._other_path(place, x[place], y[place]) / self.vacuum_wavelength[place]
        return total

    def powers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return y^i x^j for `polynomial_waves`, with x and y in units of the radius, (beam, i, j, point).

        x, y: points [m], (beam, y, x).
        """
        scale, count = (1 / self.radius)[:, None, None], self._polynomials[0].shape[1]
        across, down = (_powers((at * scale).reshape(len(self.beams), -1), count) for at in (x, y))
        return down[:, :, None] * across[:, None]

    def polynomial_waves(self, powers: np.ndarray) -> np.ndarray:
        """Return the optical paths [waves] of polynomial reliefs and wavefronts, up to a constant, (beam, point)."""
        coefficients = self._polynomials[0].reshape(len(self.beams), 1, -1)
        return np.asarray((coefficients @ powers.reshape(len(powers), coefficients.shape[2], -1))[:, 0])

    def _other_path(self, place: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the part of one beam's optical path [m] that neither polynomials nor `geometry` describe.

        It is due to oblique light. If the relief or the wavefront is not a polynomial, it includes the paths of both.
        """
        beam, total = self.beams[place], np.zeros(np.broadcast_shapes(x.shape, y.shape))
        pupil = beam.pupil
        if self._tilted[place]:
            total += self._indices[place][1] * beam.source.path(x, y)
        if place in self._polynomials[1]:
            if pupil.height is not None and self._indices[place][2] != 0:
                total += self._indices[place][2] * np.asarray(relief_height(pupil, x, y))
            if (ahead := wavefront_ahead(pupil, x, y)) is not None:
                total -= ahead
        return total

    def amplitude(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the amplitude transmittances of the pupils' masks at points (x, y) [m], array (beam, y, x)."""
        found = np.ones(x.shape)
        for place, (beam, radius) in enumerate(zip(self.beams, self.radius, strict=True)):
            if beam.pupil.mask is not None:
                found[place] = beam.pupil.amplitude(x[place] / radius, y[place] / radius)
        return found

    def mask_cycles(self, levels: np.ndarray) -> np.ndarray:
        """Return for each beam the frequency above which the mask's detail is weaker than a level, array (beam,).

        The unit is one cycle per radius of the beam's pupil. The frequency is 0 for a pupil without a mask.

        levels: for each beam, the amplitude transmittance below which detail is negligible, array (beam,).
        """
        return np.array([
            0.0 if beam.pupil.mask is None else beam.pupil.mask.bandwidth(level, radius) * radius
            for beam, radius, level in zip(self.beams, self.radius, levels.tolist(), strict=True)
        ])  # fmt: skip

    @cached_property
    def slopes(self) -> StackSlopes:
        """Slopes of the optical paths behind the pupils, at the points of a grid over the disk of each pupil.

        Between these points, slopes may be larger than at any of the points.
        """
        others = self._polynomials[1]
        pieces = {place: self.beams[place].pupil.pieces(self.beams[place].wavelength) for place in others}
        across = MANY if any(4 * count > FEW for count in pieces.values()) else FEW
        (grid, x, y), (along_x, along_y) = disk_points(across), self._smooth_slopes(across)
        for place in range(len(self.beams)):
            if place in others or self._tilted[place]:
                inside = np.hypot(grid[None, :], grid[:, None]) <= 1
                radius = self.radius[place]
                step = radius / (8 * max(pieces.get(place, 1), 4))
                for along, (dx, dy) in ((along_x, (step, 0.0)), (along_y, (0.0, step))):
                    ahead, behind = (
                        self._other_path(place, (grid * radius + s * dx)[None, :], (grid * radius + s * dy)[:, None])
                        for s in (1, -1)
                    )
                    along[place] += ((ahead - behind) / (2 * step))[inside]
        return StackSlopes(across, x, y, along_x, along_y)

    @cached_property
    def rim_slopes(self) -> StackSlopes | None:
        """Slopes of the optical paths at points on the rims of the pupils.

        Reliefs and wavefronts that are polynomials of high order are steepest there. None if no pupil has such a
        polynomial. The slopes of reliefs and wavefronts that are not polynomials, such as maps of samples, are omitted.
        """
        if self._polynomials[0].shape[1] < STEEP_POWERS:
            return None
        _, x, y = disk_points(RIM)
        along_x, along_y = self._smooth_slopes(RIM)
        for place in np.flatnonzero(self._tilted):
            source, index, radius = self.beams[place].source, self._indices[place][1], self.radius[place]
            for along, (dx, dy) in ((along_x, (TILT_STEP, 0.0)), (along_y, (0.0, TILT_STEP))):
                ahead, behind = (source.path((x + s * dx) * radius, (y + s * dy) * radius) for s in (1, -1))
                along[place] += index * (ahead - behind) / (2 * TILT_STEP * radius)
        return StackSlopes(RIM, x, y, along_x, along_y)

    def _smooth_slopes(self, across: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the slopes along x and along y of the optical path, at `disk_points`, arrays (beam, point).

        The path includes polynomial reliefs, polynomial wavefronts, and the spherical waves of ideal lenses and of
        sources on the axis. Everything else is omitted.
        """
        coefficients = self._polynomials[0]
        by_x, by_y = _power_slopes(across, coefficients.shape[1])
        flat, scale = coefficients.reshape(len(coefficients), -1), (self.vacuum_wavelength / self.radius)[:, None]
        spheres_x, spheres_y = self.geometry.slopes(across)
        return flat @ by_x * scale + spheres_x, flat @ by_y * scale + spheres_y


def _powers(values: np.ndarray, count: int) -> np.ndarray:
    """Return the powers 0 to count - 1 of values (beam, point), as an array (beam, power, point)."""
    found = np.ones((len(values), count, values.shape[1]))
    for power in range(1, count):
        np.multiply(found[:, power - 1], values, out=found[:, power])
    return found


@lru_cache(maxsize=16)
def _power_slopes(across: int, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of y^i x^j with respect to x and to y, at points (x, y) of the unit disk, two arrays.

    i and j run from 0 to size - 1. The arrays have the shape (size · i + j, point). `disk_points` defines the points.
    """
    _, x, y = disk_points(across)
    powers = np.arange(size)
    px, py = (at[None, :] ** powers[:, None] for at in (x, y))
    dx, dy = (powers[:, None] * np.roll(part, 1, axis=0) for part in (px, py))
    return (py[:, None] * dx[None]).reshape(size * size, -1), (dy[:, None] * px[None]).reshape(size * size, -1)
