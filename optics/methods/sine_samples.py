"""Samples of a pupil that are evenly spaced in sines, the components of directions from the window's centre.

The sines of a point are the x and y components of the unit vector from the window's centre to the point. The distance
from a point ξ of the pupil to points x = c + u of a window about c is

    |x - ξ| = √(D² - 2 u·(ξ - c) + u²) = D - u·s + (u² - (u·s)²)/2D + ...,   s = (ξ - c)/D,   D = |(ξ - c, z)|.

With s as the variable, the term that is linear in u is exactly the Fourier kernel, however wide the aperture is. The
terms of higher order in u become smaller as D grows. Over the pupil, these terms vary by about u²NA²/2λD cycles,
because the rays are oblique.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.pupil_edge import PupilEdge
from optics.methods.pupil_sampling import MOST_ACROSS
from optics.numerics.array_library import turned
from optics.numerics.autodiff import Array
from optics.numerics.cost import PUPIL_SAMPLE
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["SineSamples", "evenly_in_sines", "sine_samples"]

# Choice: largest ratio between the distances of samples in the pupil; above it, too many samples are necessary.
MOST_STRETCH = 3.0
MOST_SQUARE = 0.95  # choice: largest square of a sine outside the pupil, where there is no light
RIM = 64  # number of points on the rim from which the range of the sines is determined


@dataclass(frozen=True)
class SineSamples:
    """A soft aperture on a grid of sines. The grid lies around the sines of the pupil's centre.

    The sines s = (ξ - c)/D of a point ξ of the pupil are the x and y components of the unit vector from the window's
    centre c to ξ, at the distance D. The sines of the pupil's centre are s₀.

    grid: grid of s - s₀.
    centre: centre (x, y) [m] of the window.
    distance: distance [m] to the window's plane.
    steepest: |s| of the outermost sample with light.
    elsewhere: value of one component of s - s₀ that some points of the pupil have in common. `axis_kernel.AxisFactor`
        evaluates the diffraction kernel along one axis of the window, x or y, for points with this component along the
        other axis.
    """

    edge: PupilEdge
    grid: Grid
    centre: tuple[float, float]
    distance: float
    steepest: float
    elsewhere: float = 0.0

    @property
    def at(self) -> np.ndarray:
        """Sines of the samples along either axis, each minus the sine of the pupil's centre along this axis.

        The sines of a sample are the x and y components of the unit vector from the centre of the image window to the
        sample.
        """
        return self.grid.x

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which the pupil is dark."""
        return self.edge.outermost

    @property
    def seconds(self) -> float:
        """Approximate time of `field`."""
        return self.grid.shape[0] ** 2 * (self.edge.seconds_per_point + PUPIL_SAMPLE / 5)

    @cached_property
    def _middle(self) -> tuple[float, float]:
        return _middle(self.centre, self.distance)

    def directions(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sines of points (x, y) [m] of the pupil, minus the sines of the pupil's centre.

        Sines are the x and y components of the unit vector from the window's centre to a point.
        """
        sx, sy = _sines(x, y, self.centre, self.distance)
        return sx - self._middle[0], sy - self._middle[1]

    @property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates x and y [m] of all samples in the pupil, each an array (row, column)."""
        x, y, _ = self.layout
        return x, y

    @property
    def layout(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Three arrays (row, column) with a value for each sample: x [m], y [m], and the sample's weight [m²].

        The weight is the area that the sample represents in the pupil's plane, times the transmittance of the aperture.
        """
        return _layout(self)

    def light(self, beam: Beam, dtype: str) -> np.ndarray:
        """Return the result of `field` as a complex NumPy array (y, x), without derivatives.

        dtype: type of the real and imaginary parts, "float32" or "float64". The phase is rounded to the same type after
            whole waves are subtracted.
        """
        x, y, weight = self.layout
        if beam.pupil.mask is not None:
            weight = weight * beam.pupil.amplitude(x / self.edge.radius, y / self.edge.radius)
        found: np.ndarray = turned(weight, beam.waves(x, y), dtype)
        return found

    def points_at(self, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (x, y) [m] of the pupil whose `directions` are (s, t).

        s and t are the x and y components of the unit vector from the window's centre to a point, minus those of the
        unit vector to the pupil's centre.
        """
        sx, sy = s + self._middle[0], t + self._middle[1]
        slant = self.distance / np.sqrt(1 - np.minimum(sx * sx + sy * sy, max(self.steepest**2, MOST_SQUARE)))
        return sx * slant + self.centre[0], sy * slant + self.centre[1]

    def places(self, i: Array, j: Array, beam: Beam, types: Precision) -> tuple[Array, Array]:
        """Return the points (x, y) [m] of samples. i and j are their float64 indices along x and along y."""
        import drjit as dr

        at = types.Float64(padded_for_packets(self.at))
        sx, sy = (
            dr.gather(types.Float64, at, types.Index(index)) + opaque(types, middle)
            for index, middle in zip((i, j), self._middle, strict=True)
        )
        slant = opaque(types, self.distance) / self._cosine(sx, sy, types)
        return sx * slant + opaque(types, self.centre[0]), sy * slant + opaque(types, self.centre[1])

    def _cosine(self, sx: Array, sy: Array, types: Precision) -> Array:
        """Return the cosine of the angle between ray and axis.

        Beyond the outermost sample with light, the cosine stays constant.
        """
        import drjit as dr

        return dr.sqrt(1 - dr.minimum(sx * sx + sy * sy, opaque(types, self.steepest**2)))

    def field(self, beam: Beam, types: Precision) -> Field:
        """Return the field behind the pupil times the areas [m²] that the samples represent in the pupil's plane.

        The samples are evenly spaced in s and t, the x and y components of the unit vector from the window's centre to
        a sample. The area of a sample is z²/cos⁴θ ds dt. Here z is the distance between pupil and window, and θ is the
        angle between the axis and the line from the window's centre to the sample.
        """
        import drjit as dr

        column, row = self.grid.coordinates(types)
        sx, sy = (part + opaque(types, middle) for part, middle in zip((column, row), self._middle, strict=True))
        cosine, z = self._cosine(sx, sy, types), opaque(types, self.distance)
        x = sx * z / cosine + opaque(types, self.centre[0])
        y = sy * z / cosine + opaque(types, self.centre[1])
        area = dr.square(z * opaque(types, self.grid.dx) / dr.square(cosine))
        behind = beam.at(self.edge.aperture, x, y, self.grid, types)
        return Field(behind.re * types.Float(area), behind.im * types.Float(area), self.grid, types)


@lru_cache(maxsize=64)
def _layout(samples: SineSamples) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `SineSamples.layout`. Many PSFs have the same samples, so the layout is cached."""
    types, radius = precision("float64"), samples.edge.radius
    sx, sy = np.meshgrid(samples.at + samples._middle[0], samples.at + samples._middle[1])
    x, y = samples.points_at(sx - samples._middle[0], sy - samples._middle[1])
    across, down = (types.Float64(padded_for_packets(part / radius)) for part in (x, y))
    soft = samples.edge.aperture.transmittance(across, down, types).numpy().reshape(x.shape)
    cosine2 = 1 - np.minimum(sx * sx + sy * sy, max(samples.steepest**2, MOST_SQUARE))
    return x, y, soft * (samples.distance * samples.grid.dx / cosine2) ** 2


def _sines(x: np.ndarray, y: np.ndarray, centre: tuple[float, float], distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y components (sines) of unit vectors from the window's centre to points (x, y) [m] of the pupil."""
    x, y = x - centre[0], y - centre[1]
    slant = np.sqrt(x * x + y * y + distance * distance)
    return x / slant, y / slant


def _middle(centre: tuple[float, float], distance: float) -> tuple[float, float]:
    """Return s₀, the x and y components (sines) of the unit vector from the window's centre to the pupil's centre."""
    slant = math.hypot(*centre, distance)
    return -centre[0] / slant, -centre[1] / slant


def sine_samples(problem: Problem) -> SineSamples | None:
    """Return the fewest samples that resolve the phase over the pupil; None if their spacing would be too uneven.

    The phase is the sum of the phase of the light behind the pupil and the phase of the path from the pupil to a point
    of the window. The result is also None if the grid would be too large.
    """
    edge = problem.soft_edge(problem.turning)
    return evenly_in_sines(problem, edge, problem.turning + edge.stopband)


def evenly_in_sines(problem: Problem, edge: PupilEdge, cycles: float, shift: float = 0.0) -> SineSamples | None:
    """Return samples that resolve light behind the pupil whose phase varies by up to `cycles` cycles per metre.

    The result is None if samples that are evenly spaced in sines are too uneven in the pupil, or if the grid would be
    too large.

    The distance between two points in the pupil is at most z/cos³θ times the difference between their sines. Here z is
    the distance between pupil and window, and θ is the angle of the steepest ray. The number of cycles per unit of sine
    is therefore at most `cycles` times z/cos³θ.

    cycles: number of cycles per metre in the pupil's plane [1/m].
    shift: distance by which the grid is shifted along both axes, in units of its pitch, at most 1.
    """
    angle = np.linspace(0, 2 * np.pi, RIM, endpoint=False)
    centre = problem.window.centre
    rim = _sines(edge.outermost * np.cos(angle), edge.outermost * np.sin(angle), centre, problem.distance)
    middle = _middle(centre, problem.distance)
    steepest = float(np.hypot(*rim).max())
    if steepest >= 1:  # rounding, in pupils millions of times wider than their distance
        return None
    stretch = (1 - steepest**2) ** -1.5
    if stretch > MOST_STRETCH * (1 - math.hypot(*middle) ** 2) ** -1.5:
        return None
    pitch = 1 / (stretch * problem.distance * cycles)
    half = max(float(np.abs(at - middle_at).max()) for at, middle_at in zip(rim, middle, strict=True))
    if half / pitch > MOST_ACROSS:
        return None
    count = 2 * math.ceil(half / pitch + shift) + 1
    grid = Grid((count, count), pitch, (shift * pitch, shift * pitch))
    return SineSamples(edge, grid, centre, problem.distance, steepest)
