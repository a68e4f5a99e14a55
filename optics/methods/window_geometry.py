"""Geometry of pupils and a window, by which `window_plan` chooses samples.

The geometry depends neither on reliefs, wavefronts and masks nor on the tolerance. Users often compute many PSFs with
different wavefronts, but the same beam and window. The geometry of a single beam is therefore cached.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from optics.elements.light_geometry import LightGeometry, disk_points
from optics.elements.light_stack import LightStack
from optics.methods.remaining_factor import RemainingFactor
from optics.methods.sine_stack import SineGeometry, rim_sines
from optics.methods.slow_factor import Path
from optics.numerics.grid import Grid
from optics.numerics.kept_values import KeptValues

__all__ = ["PathSlopes", "PlannedRays", "WindowGeometry", "half_window", "window_geometry"]

RAYS = 100  # choice: number of rays that determine the rank
BLUR = 1.2  # choice, in λz/2R: distance from the end points of rays at which diffraction spreads their light
RIM = 0.85  # choice: distance from the axis [radii] beyond which rays count as rays of the edge
KEPT = 64  # choice, limited by memory: number of values that are kept for one window


class PathSlopes(NamedTuple):
    """Gradients of the optical paths from points of the pupils to the middle of a window.

    along_x, along_y: gradients along x and y of the pupil, (beam, point).
    cycles: factor that converts a gradient to a spatial frequency of the light in the pupil. The frequency is given in
        cycles of the phase per radius of the pupil. Array (beam, 1).
    rim: indices of the points near the rim.
    """

    along_x: np.ndarray
    along_y: np.ndarray
    cycles: np.ndarray
    rim: np.ndarray


class PlannedRays(NamedTuple):
    """Rays from some points of each pupil. A plan uses the rays to determine the rank of the slow factor.

    The slow factor is the factor by which the diffraction kernel differs from a Fourier kernel. Its rank is the number
    of Chebyshev points per axis of the window that are enough to interpolate it.

    some: indices of the points in `disk_points`.
    at: positions (x, y) [m] of the points, relative to the middle of the window, (beam, ray).
    scale: distance [m] by which the place where a ray hits the window moves if the gradient of the optical path with
        respect to the ray's point in the pupil grows by 1, (beam, ray).
    blur: distance [m] by which diffraction spreads the light, (beam, 1).
    directions: x and y components of the unit vectors from the middle of the window to the points, minus those of the
        unit vector to the pupil's centre, (beam, ray).
    sine2: sum of the squares of both arrays in `directions`, (beam, ray).
    """

    some: slice
    at: tuple[np.ndarray, np.ndarray]
    scale: np.ndarray
    blur: np.ndarray
    directions: tuple[np.ndarray, np.ndarray]
    sine2: np.ndarray


@dataclass(frozen=True)
class WindowGeometry:
    """Geometry of several beams and of their window.

    Reliefs, wavefronts and masks are not part of the geometry. Results that depend only on the geometry are
    computed once.

    light: radii of the pupils, distances, wavelengths, media, ideal lenses and sources.
    window: samples of the window.
    """

    light: LightGeometry
    window: Grid

    @cached_property
    def half(self) -> float:
        """Half the width [m] of a square around the window's middle. All interpolation points lie in this square."""
        return half_window(self.window)

    @cached_property
    def path(self) -> Path:
        return Path(self.light.wavelength, self.light.arrays[1], self.window)

    @cached_property
    def cycles(self) -> np.ndarray:
        """Spatial frequencies of the light that arrives at the sides of the window, (beam,).

        A frequency is the number of cycles of the light's phase per radius of the pupil, in the plane of the pupil. It
        is 0 for light that arrives at the middle of the window.
        """
        radius, distance, *_ = self.light.arrays
        return np.asarray(self.half * radius / (self.light.wavelength * distance))

    def to_middle(self, across: int) -> PathSlopes:
        """Return the gradients of the optical paths from points of the pupils to the middle of the window.

        The gradients are derivatives with respect to the position of the point in the pupil.

        across: number of points across the pupil, see `disk_points`.
        """

        def computed() -> PathSlopes:
            (x, y), length = self._apart(across, slice(None))
            radius, _, wavelength, index, *_ = self.light.arrays
            scale, r = index[:, None] / length, np.hypot(*disk_points(across)[1:])
            return PathSlopes(x * scale, y * scale, (radius / wavelength)[:, None], np.flatnonzero(r > RIM))

        found: PathSlopes = self.known.get(("paths", across), computed)
        return found

    def rays(self, across: int) -> PlannedRays:
        """Return some points of each pupil, with the data of the rays that start there.

        They are every n-th point of a square grid in the pupil (see `disk_points`), about 100 to 200 points.

        across: number of points of this grid along a diameter of the pupil.
        """

        def computed() -> PlannedRays:
            some = slice(None, None, max(1, len(disk_points(across)[1]) // RAYS))
            (x, y), length = self._apart(across, some)
            radius, distance, _, index, *_ = self.light.arrays
            cx, cy = self.window.centre
            middle = np.sqrt(np.square(distance) + cx**2 + cy**2)[:, None]
            s, t = x / length + cx / middle, y / length + cy / middle
            blur = BLUR * (self.light.wavelength * distance / (2 * radius))[:, None]
            return PlannedRays(some, (x, y), length / index[:, None], blur, (s, t), s * s + t * t)

        found: PlannedRays = self.known.get(("rays", across), computed)
        return found

    def _apart(self, across: int, some: slice) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        """Return some of the `disk_points` relative to the middle of the window, and their distances from it [m]."""
        _, *points = disk_points(across)
        radius, distance = (part[:, None] for part in self.light.arrays[:2])
        x, y = (radius * at[some] - centre for at, centre in zip(points, self.window.centre, strict=True))
        return (x, y), np.sqrt(x * x + y * y + np.square(distance))

    def rims(self, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the three arrays (beam,) of `rim_sines` for circles at which the soft edges of the pupils end.

        They are half the width of a pupil's grid of sines, the largest sine on the circle, and whether points with
        evenly spaced sines are also fairly evenly spaced in the pupil.

        reach: distances in pupil radii by which the soft edges extend beyond the rims, (beam,).
        """
        radius, distance, *_ = self.light.arrays
        found: tuple[np.ndarray, np.ndarray, np.ndarray] = self.known.get(
            ("rims", reach.tobytes()), lambda: rim_sines((1 + reach) * radius, self.window.centre, distance)
        )
        return found

    def ray_factor(self, across: int, steepest: np.ndarray, elsewhere: np.ndarray) -> RemainingFactor:
        """Return F(u, v) / (F(u, 0) F(0, v)) for light from the points of the pupils that the method `rays` returns.

        F(u, v) is the slow factor at a position (u, v) relative to the middle of the window. The slow factor is the
        factor by which the diffraction kernel differs from a Fourier kernel.

        across: number of points across the pupil, see `disk_points`.
        steepest, elsewhere: see `SineGeometry`.
        """

        def computed() -> RemainingFactor:
            geometry = SineGeometry(self.light.arrays[1], self.window.centre, steepest, elsewhere)
            return RemainingFactor(self.path, geometry, self.rays(across).directions)

        key = "factor", across, steepest.tobytes(), elsewhere.tobytes()
        found: RemainingFactor = self.known.get(key, computed)
        return found

    @cached_property
    def known(self) -> KeptValues:
        """Cached results, also of functions in other modules. Geometry and key of a result determine the result."""
        return KeptValues(KEPT)


def half_window(window: Grid) -> float:
    """Return half the width [m] of a square around a window's middle, in which all interpolation points lie."""
    return max(window.own_half_width, window.dx)


def window_geometry(stack: LightStack, window: Grid) -> WindowGeometry:
    """Return the quantities that depend on sources, ideal lenses, media, distances and the window only.

    Reliefs, wavefronts and masks do not change them. The result for a single beam is cached.

    stack: light of the beams.
    """
    light = stack.geometry
    return _kept(light, window) if len(stack.beams) == 1 else WindowGeometry(light, window)


@lru_cache(maxsize=16)
def _kept(light: LightGeometry, window: Grid) -> WindowGeometry:
    return WindowGeometry(light, window)
