"""Sources, ideal lenses and media of several beams. Reliefs and wavefronts of the pupils are not included.

Users often compute many PSFs that differ in the relief or wavefront only. The sources, lenses and media of these PSFs
are then cached. Some steps in planning the computation depend only on sources, lenses and media, and the results of
these steps are cached as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from optics.numerics.read_only import read_only

__all__ = ["FEW", "MANY", "RIM", "LightGeometry", "disk_points", "light_geometry"]

FEW, MANY = 21, 53  # choices: points across the pupil at which slopes are evaluated, without and with fine detail
RIM, ANGLES = 0, 48  # stands for points on the rim, see `disk_points`; choice: number of these points


@dataclass(frozen=True)
class LightGeometry:
    """Geometry of several beams. Each field contains one number per beam.

    radius: radii of the pupils [m].
    distance: distances of the sensor planes behind the pupils [m].
    vacuum_wavelength: wavelengths in vacuum [m].
    behind, before: refractive indices behind and before the pupils.
    focal: focal lengths of ideal lenses [m]; infinite without a lens.
    source: distances of sources on the axis [m]; infinite for parallel or oblique light.
    """

    radius: tuple[float, ...]
    distance: tuple[float, ...]
    vacuum_wavelength: tuple[float, ...]
    behind: tuple[float, ...]
    before: tuple[float, ...]
    focal: tuple[float, ...]
    source: tuple[float, ...]

    @cached_property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """All attributes of the class, in the order of its arguments, each as an array (beam,)."""
        rows = self.radius, self.distance, self.vacuum_wavelength, self.behind, self.before, self.focal, self.source
        return tuple(read_only(np.array(row, float)) for row in rows)

    @cached_property
    def wavelength(self) -> np.ndarray:
        """Wavelengths in the media behind the pupils [m], (beam,)."""
        return read_only(self.arrays[2] / self.arrays[3])

    @cached_property
    def spheres(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Spherical waves of lenses and sources, each given by a refractive index and a distance [m], arrays (beam,).

        The index is that of the wave's medium, and negative if the wave converges. The distance is that of the wave's
        centre from the pupil.
        """
        *_, behind, before, focal, source = self.arrays
        known = (-np.sign(focal) * behind, np.abs(focal)), (before, source)
        return [(read_only(index), read_only(r)) for index, r in known if np.isfinite(r).any()]

    def waves(self, x: np.ndarray, y: np.ndarray) -> np.ndarray | float:
        """Return the optical path at points (x, y) [m] due to ideal lenses and sources on the axis, in waves.

        Each lens or source adds a spherical wave. The path is relative to the centre of the pupil, and the unit is the
        vacuum wavelength. Without spherical waves, the result is the number 0, otherwise an array (beam, y, x).

        x, y: points, (beam, y, x).
        """
        total: np.ndarray | float = 0.0
        r2, per_wave = x * x + y * y if self.spheres else 0.0, 1 / self.arrays[2][:, None, None]
        for index, distance in self.spheres:
            centre = distance[:, None, None]
            total = total + (index[:, None, None] * per_wave) * r2 / (np.sqrt(r2 + centre * centre) + centre)
        return total

    def slopes(self, across: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the slopes along x and along y of the optical path, at `disk_points`, arrays (beam, point).

        Only the spherical waves of ideal lenses and of sources on the axis are included.
        """
        if across not in self._slopes:
            _, x, y = disk_points(across)
            radius = self.arrays[0][:, None]
            r, outward = np.hypot(x, y) * radius, np.zeros((len(radius), len(x)))
            for index, distance in self.spheres:
                outward = outward + index[:, None] * radius / np.hypot(r, distance[:, None])
            self._slopes[across] = read_only(outward * x), read_only(outward * y)
        return self._slopes[across]

    @cached_property
    def _slopes(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Cached results of `slopes`, by the number of points across the pupil."""
        return {}


def light_geometry(beams: Sequence[tuple[float, ...]]) -> LightGeometry:
    """Return the geometry of beams, each given by the fields of `LightGeometry`. The geometry of one beam is cached."""
    return _kept(beams[0]) if len(beams) == 1 else LightGeometry(*zip(*beams, strict=True))


@lru_cache(maxsize=64)
def _kept(beam: tuple[float, ...]) -> LightGeometry:
    return LightGeometry(*((value,) for value in beam))


@lru_cache(maxsize=4)
def disk_points(across: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the points of a square grid that lie inside the unit disk.

    The result contains the positions of the grid's columns (or rows) from -1 to 1, array (column,), and the coordinates
    x and y of the points, arrays (point,).

    across: number of points along a diameter. If it is RIM (0), the points lie evenly spaced on the rim of the disk,
        and the array of positions is empty.
    """
    if across == RIM:
        angle = 2 * np.pi * np.arange(ANGLES) / ANGLES
        return read_only(np.empty(0)), read_only(np.cos(angle)), read_only(np.sin(angle))
    grid = np.linspace(-1, 1, across)
    x, y = np.meshgrid(grid, grid)
    inside = np.hypot(x, y) <= 1
    return read_only(grid), read_only(x[inside]), read_only(y[inside])
