"""Light through several pupils at once, as NumPy arrays whose first axis counts the beams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil_path import relief_height, wavefront_ahead
from optics.elements.pupil_polynomials import power_sum, powers_of
from optics.numerics.autodiff import number
from optics.numerics.read_only import ReadOnlyArrays, read_only

__all__ = ["LightStack", "StackSlopes"]

SPHERE_POINTS = (
    8  # choice: number of Chebyshev points across the pupil for spheres, in addition to those of polynomials
)
FEW, MANY = 21, 53  # choices: points across the pupil at which slopes are evaluated, without and with fine detail


@dataclass(frozen=True, eq=False)
class StackSlopes(ReadOnlyArrays):
    """Gradients of the optical paths behind several pupils, at the same points of their disks.

    x, y: points in units of the radius, (point,).
    along_x, along_y: gradients, (beam, point).
    """

    x: np.ndarray
    y: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray

    @cached_property
    def steepest(self) -> np.ndarray:
        """Largest slope at these points, (beam,)."""
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
    def radius(self) -> np.ndarray:
        """Radii of the pupils [m], (beam,)."""
        return read_only(np.array([beam.pupil.radius for beam in self.beams]))

    @cached_property
    def distance(self) -> np.ndarray:
        """Distances of the window behind the pupils [m], (beam,)."""
        return read_only(np.array([number(beam.distance) for beam in self.beams]))

    @property
    def index(self) -> np.ndarray:
        """Refractive indices behind the pupils, (beam,)."""
        return self._indices[0]

    @cached_property
    def _indices(self) -> np.ndarray:
        """Refractive indices behind and before the pupils, and the steps of the reliefs, (3, beam).

        Pupils of a population often have the same media, whose curves are then evaluated once.
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
        return read_only(np.array(found).reshape(-1, 3).T)

    @cached_property
    def vacuum_wavelength(self) -> np.ndarray:
        """Wavelengths in vacuum [m], (beam,)."""
        return read_only(np.array([beam.wavelength for beam in self.beams]))

    @property
    def wavelength(self) -> np.ndarray:
        """Wavelengths in the media behind the pupils [m], (beam,)."""
        found: np.ndarray = self.vacuum_wavelength / self.index
        return found

    @cached_property
    def _spheres(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Spherical waves of the lenses and of the sources: index and distance [m] of the centre, (beam,) each.

        The index of a wave that converges is negative.
        """
        focal = [beam.pupil.thin_lens_focal_length for beam in self.beams]
        lenses = np.array([math.inf if f is None else number(f) for f in focal])
        before = self._indices[1]
        sources = np.array([math.inf if self._tilted[k] else b.source.distance for k, b in enumerate(self.beams)])
        known = (-np.sign(lenses) * self.index, np.abs(lenses)), (before, sources)
        return [(read_only(index), read_only(r)) for index, r in known if np.isfinite(r).any()]

    @cached_property
    def _tilted(self) -> list[bool]:
        return [beam.source.angle != (0.0, 0.0) for beam in self.beams]

    @cached_property
    def _polynomials(self) -> tuple[np.ndarray, list[int]]:
        """Coefficients of `powers_of` for each beam, and the beams whose reliefs or wavefronts are not polynomials."""
        steps = self._indices[2].tolist()
        known = [powers_of(beam.pupil, beam.wavelength, step) for beam, step in zip(self.beams, steps, strict=True)]
        size = max([len(one) for one in known if one is not None], default=1)
        found = np.zeros((len(known), size, size))
        for place, one in enumerate(known):
            if one is not None:
                found[place, : len(one), : len(one)] = one
        return read_only(found), [place for place, one in enumerate(known) if one is None]

    @cached_property
    def mapped(self) -> np.ndarray:
        """True for beams whose relief or wavefront is not a polynomial and may have fine detail, (beam,)."""
        return read_only(np.isin(np.arange(len(self.beams)), self._polynomials[1]))

    @cached_property
    def smooth_points(self) -> int | None:
        """Number of Chebyshev points across the pupils that determine the paths; None for maps and oblique light."""
        coefficients, others = self._polynomials
        if others or any(self._tilted):
            return None
        return len(coefficients[0]) + SPHERE_POINTS

    def waves(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the optical paths at points (x, y) [m], in waves, up to a constant, (beam, y, x).

        x, y: points, (beam, y, x).
        """
        per_radius, per_wave = (part[:, None, None] for part in (1 / self.radius, 1 / self.vacuum_wavelength))
        coefficients, others = self._polynomials
        total = np.zeros((len(self.beams), *x.shape[1:]))
        if coefficients.any():
            total += power_sum(coefficients, x * per_radius, y * per_radius)
        if self._spheres:
            r2 = x * x + y * y
        for index, distance in self._spheres:
            centre = distance[:, None, None]
            total += (index[:, None, None] * per_wave) * r2 / (np.sqrt(r2 + centre * centre) + centre)
        for place in range(len(self.beams)):
            if place in others or self._tilted[place]:
                total[place] += self._other_path(place, x[place], y[place]) / self.vacuum_wavelength[place]
        return total

    def _other_path(self, place: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the part of the path [m] of one beam that is neither a polynomial nor a sphere about the axis."""
        beam, total = self.beams[place], np.zeros(np.broadcast_shapes(x.shape, y.shape))
        pupil = beam.pupil
        if self._tilted[place]:
            total += self._indices[1][place] * beam.source.path(x, y)
        if place in self._polynomials[1]:
            if pupil.height is not None and self._indices[2][place] != 0:
                total += self._indices[2][place] * np.asarray(relief_height(pupil, x, y))
            if (ahead := wavefront_ahead(pupil, x, y)) is not None:
                total -= ahead
        return total

    def amplitude(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the amplitudes that masks transmit at points (x, y) [m], (beam, y, x)."""
        found = np.ones(x.shape)
        for place, (beam, radius) in enumerate(zip(self.beams, self.radius, strict=True)):
            if beam.pupil.mask is not None:
                found[place] = beam.pupil.amplitude(x[place] / radius, y[place] / radius)
        return found

    @cached_property
    def slopes(self) -> StackSlopes:
        """Slopes of the wavefronts at some points of the disks, which may miss the steepest point."""
        coefficients, others = self._polynomials
        pieces = {place: self.beams[place].pupil.pieces(self.beams[place].wavelength) for place in others}
        across = MANY if any(4 * count > FEW for count in pieces.values()) else FEW
        grid, x, y = _points(across)
        by_x, by_y = _power_slopes(across, coefficients.shape[1])
        flat, scale = coefficients.reshape(len(coefficients), -1), (self.vacuum_wavelength / self.radius)[:, None]
        along_x, along_y = flat @ by_x * scale, flat @ by_y * scale
        r = np.hypot(x, y) * self.radius[:, None]
        for index, distance in self._spheres:
            outward = index[:, None] * self.radius[:, None] / np.hypot(r, distance[:, None])
            along_x, along_y = along_x + outward * x, along_y + outward * y
        inside = np.hypot(grid[None, :], grid[:, None]) <= 1
        for place in range(len(self.beams)):
            if place in others or self._tilted[place]:
                radius = self.radius[place]
                step = radius / (8 * max(pieces.get(place, 1), 4))
                for along, (dx, dy) in ((along_x, (step, 0.0)), (along_y, (0.0, step))):
                    ahead, behind = (
                        self._other_path(place, (grid * radius + s * dx)[None, :], (grid * radius + s * dy)[:, None])
                        for s in (1, -1)
                    )
                    along[place] += ((ahead - behind) / (2 * step))[inside]
        return StackSlopes(x, y, along_x, along_y)


@lru_cache(maxsize=4)
def _points(across: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions along an axis, and points (x, y) of the square grid inside the unit disk."""
    grid = np.linspace(-1, 1, across)
    x, y = np.meshgrid(grid, grid)
    inside = np.hypot(x, y) <= 1
    return read_only(grid), read_only(x[inside]), read_only(y[inside])


@lru_cache(maxsize=16)
def _power_slopes(across: int, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of y^i x^j by x and by y at the points of `_points`, (power of y · power of x, point)."""
    _, x, y = _points(across)
    powers = np.arange(size)
    px, py = (at[None, :] ** powers[:, None] for at in (x, y))
    dx, dy = (powers[:, None] * np.roll(part, 1, axis=0) for part in (px, py))
    return (py[:, None] * dx[None]).reshape(size * size, -1), (dy[:, None] * px[None]).reshape(size * size, -1)
