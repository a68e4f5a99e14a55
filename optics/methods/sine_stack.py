"""Equal numbers of samples of several pupils, evenly spaced in sines: components of unit vectors (see `sine_samples`).

All arrays are of NumPy, and their first axis counts the pupils. If the light of several wavelengths or sources passes
the same pupil, its samples are stored once, and the first axis has length 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from optics.apertures.aperture import SoftAperture
from optics.apertures.circular import SoftAnnulus
from optics.apertures.curved_disk import curved_ring
from optics.elements.light_stack import LightStack
from optics.methods.diffraction_kernel import FAR, diffraction_kernel, near_field
from optics.methods.sine_samples import MOST_SQUARE, MOST_STRETCH, RIM
from optics.numerics.array_library import turned
from optics.numerics.interpolation import chebyshev_points, lagrange_basis
from optics.numerics.kept_values import KeptValues
from optics.numerics.precision import padded_for_packets, precision

__all__ = ["SineGeometry", "SineStack", "even_weights", "rim_sines"]

# Choices for tables of the transmittance against r²: number of values per cycle of the edge, and of smoothed waves.
PER_CYCLE, SMOOTHED_LEVELS = 1000, 16384
KEPT = 12  # choice, limited by memory: arrays that are kept for further PSFs with the same samples
SMOOTH_SINE = 0.4  # choice: largest sine at which paths are interpolated from a few points


@dataclass(frozen=True, eq=False)
class SineGeometry:
    """Conversion between the position of a point in a pupil and the direction in which it is seen from the window.

    The sines of a point are the x and y components of the unit vector from the window's centre to the point.

    distance: distances of the window [m], (pupil,).
    centre: centre (x, y) [m] of the window.
    steepest: sines of the angle between the axis and the line to the outermost sample with light, (pupil,).
    elsewhere: common sine of some points along one axis, x or y, minus that of the pupil's centre, (pupil,).
        `axis_kernel.AxisFactor` evaluates the kernel along the other axis for these points.
    """

    distance: np.ndarray
    centre: tuple[float, float]
    steepest: np.ndarray
    elsewhere: np.ndarray

    @cached_property
    def _middle(self) -> tuple[np.ndarray, np.ndarray]:
        """Components x and y (sines) of unit vectors from the window's centre to the pupils' centres, each (pupil,)."""
        none = np.zeros(len(self.distance))
        return _sines(none, none, self.centre, self.distance)

    def directions(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return components along x and y of unit vectors from the window's centre to points (x, y) [m] of the pupils.

        The components of the unit vector to the pupil's centre are subtracted. Both arrays have the shape (pupil, ...).
        """
        sx, sy = _sines(x, y, self.centre, _aligned(self.distance, x))
        return sx - _aligned(self._middle[0], sx), sy - _aligned(self._middle[1], sy)

    def points_at(self, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return those points (x, y) [m] of the pupils for which `directions` returns (s, t)."""
        sx, sy = s + _aligned(self._middle[0], s), t + _aligned(self._middle[1], t)
        slant = _aligned(self.distance, sx) / np.sqrt(self._squared_cosine(sx, sy))
        return sx * slant + self.centre[0], sy * slant + self.centre[1]

    def _squared_cosine(self, sx: np.ndarray, sy: np.ndarray) -> np.ndarray:
        most = _aligned(np.maximum(np.square(self.steepest), MOST_SQUARE), sx)
        found: np.ndarray = 1 - np.minimum(sx * sx + sy * sy, most)
        return found


@dataclass(frozen=True, eq=False)
class SineStack(SineGeometry):
    """Soft apertures, sampled on grids of sines. `SineGeometry` defines sines.

    at: evenly spaced sines along either axis, each minus the sine of the pupil's centre, (pupil, sample).
    edges: soft apertures, (pupil,).
    radius: radii [m], (pupil,).
    curvature: c [cycles per radius], (pupil,), the local frequency of a curved wave e^{iπcr²} at the pupil's rim. The
        hard aperture is multiplied by this wave before the edge is softened, see `curved_ring`. 0 if there is no such
        wave.
    """

    at: np.ndarray
    edges: tuple[SoftAperture, ...]
    radius: np.ndarray
    curvature: np.ndarray

    def smooth(self, reach: float) -> bool:
        """Return whether paths from samples to points up to `reach` [m] from the axis vary smoothly over the pupils."""
        return bool(max(self.steepest.max(), reach / self.distance.min()) <= SMOOTH_SINE)

    @property
    def pitch(self) -> np.ndarray:
        """Spacing of the samples, (pupil,)."""
        found: np.ndarray = (self.at[:, -1] - self.at[:, 0]) / (self.at.shape[1] - 1)
        return found

    @cached_property
    def outermost(self) -> np.ndarray:
        """Distances from the axis [m] beyond which the pupils are dark, (pupil,)."""
        found: np.ndarray = (1 + np.array([edge.reach for edge in self.edges])) * self.radius
        return found

    def _sine2(self, dtype: str = "float64") -> np.ndarray:
        """Return the squared sines of the angles between the optical axis and the samples' rays, (pupil, y, x)."""
        across, down = (np.square(self.at + part[:, None]).astype(dtype) for part in self._middle)
        return np.asarray(across[:, None, :] + down[:, :, None])

    def _cosine2(self, dtype: str = "float64") -> np.ndarray:
        """Return the squared cosines of the angles between the optical axis and the samples' rays, (pupil, y, x)."""
        found: np.ndarray = 1 - self._sine2(dtype)
        least = 1 - np.maximum(np.square(self.steepest), MOST_SQUARE)
        if (found[:, [0, 0, -1, -1], [0, -1, 0, -1]].min(axis=1) < least).any():
            np.maximum(found, least[:, None, None], out=found)
        return found

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates x and y [m] of all samples, each (pupil, row, column)."""
        slant = self.distance[:, None, None] / np.sqrt(self._cosine2())
        sx, sy = (part[:, None] for part in self._middle)
        return (self.at + sx)[:, None, :] * slant + self.centre[0], (self.at + sy)[:, :, None] * slant + self.centre[1]

    def arriving(self, stack: LightStack, dtype: str) -> np.ndarray:
        """Return the complex contribution of each sample to the field at the middle of the window, (beam, y, x).

        It is the light behind the pupils, times the areas of the samples, times z/(λD²) (1/(kD) - i) e^{ik(D - ρ)}, up
        to a constant phase. D and ρ are the distances from the middle of the window to the sample and to the pupil's
        centre. z is the distance between the planes of pupil and window, and k the wave number.

        dtype: type of real and imaginary parts, and of the phase after whole waves are removed, "float32" or "float64".
        """
        size = self._sizes(dtype) / stack.wavelength[:, None, None].astype(dtype)
        if any(beam.pupil.mask is not None for beam in stack.beams):
            size = size * stack.amplitude(*self.points)
        waves = self._waves(stack)
        if (stack.wavelength / stack.distance).max() > 2 * np.pi * FAR:
            far = self.distance[:, None, None] / np.sqrt(self._cosine2())
            size = size * near_field(stack.wavelength[:, None, None], far)[0]
        if not self.curvature.any():
            return np.asarray(turned(size, waves, dtype))
        found = turned(1.0, waves, dtype)
        found *= size
        return np.asarray(found)

    @cached_property
    def known(self) -> KeptValues:
        """Arrays that are kept for further PSFs with the same samples."""
        return KeptValues(KEPT)

    def _sizes(self, dtype: str) -> np.ndarray:
        """Return products [m] of a sample's area, the transmittance of the aperture there, and z/D², (pupil, y, x).

        z is the distance of the window's plane, and D the distance of a sample from the middle of the window. If
        `curvature` is not 0, the transmittance is that of `curved_ring`, and the result is complex.
        """
        return np.asarray(self.known.get(dtype, lambda: self._new_sizes(dtype)))

    def _new_sizes(self, dtype: str) -> np.ndarray:
        stretch = 1 / self._cosine2(dtype)
        size = (self.distance * np.square(self.pitch))[:, None, None].astype(dtype) * stretch
        found = np.empty(size.shape, np.result_type(dtype, np.complex64)) if self.curvature.any() else size
        first: dict[tuple[int, float], int] = {}
        kinds = zip(map(id, self.edges), self.curvature.tolist(), strict=True)
        same = np.array([first.setdefault(kind, place) for place, kind in enumerate(kinds)])
        for place in first.values():
            own = slice(None) if len(first) == 1 else np.flatnonzero(same == place)
            edge, radius = self.edges[place], self.radius[own, None, None]
            if edge.rotationally_symmetric:
                profile = _profile(edge, float(self.curvature[place]), dtype)
                per_level = (len(profile) - 1) / ((1 + edge.reach) * radius) ** 2
                if self.centre == (0.0, 0.0):  # r² = z² tan²θ
                    level = (np.square(self.distance)[own, None, None] * per_level).astype(dtype) * stretch[own]
                    level *= self._sine2(dtype)[own]
                else:
                    x, y = self.points
                    level = (np.square(x[own]) + np.square(y[own])) * per_level
                found[own] = size[own] * profile.take(level.astype(np.int32), mode="clip")
            else:
                x, y = self.points
                found[own] = size[own] * _transmittance(edge, x[own] / radius, y[own] / radius)
        return found

    def _waves(self, stack: LightStack) -> np.ndarray:
        """Return paths [waves] from the source through all samples to the window's middle, (beam, y, x).

        A constant is omitted. Paths that vary smoothly are interpolated from a few points of the pupil. This requires
        that the sines of the angles between the axis and the rays to the window do not exceed SMOOTH_SINE.
        """
        count = stack.smooth_points
        if count is None or count >= self.at.shape[1] or not self.smooth(0.0):
            return self._paths(stack, *self.points)

        def computed() -> tuple[np.ndarray, np.ndarray]:
            """Return two arrays at Chebyshev points: paths [waves] without relief or aberration, and terms y^i x^j."""
            side = self.at[:, [0, -1]]
            nodes = side.mean(axis=1)[:, None] + np.diff(side) / 2 * chebyshev_points(count)
            points = self.points_at(nodes[:, None, :], nodes[:, :, None])
            to_middle = self._to_middle(stack.wavelength[:, None, None], *points)[1]
            return stack.geometry.waves(*points) + to_middle, stack.powers(*points)

        straight, powers = self.known.get(("paths", stack.geometry, count), computed)
        paths = straight + stack.polynomial_waves(powers).reshape(-1, count, count)
        weight = even_weights(self.at.shape[1], count)
        return np.asarray(weight @ paths @ weight.T)

    def _paths(self, stack: LightStack, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return paths [waves] from source through (x, y) [m] to the window's middle, up to a constant per beam."""
        return np.asarray(stack.waves(x, y) + self._to_middle(stack.wavelength[:, None, None], x, y)[1])

    def _to_middle(self, wavelength: float | np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the `diffraction_kernel` from points (x, y) [m] to the middle of the window."""
        return diffraction_kernel(wavelength, self.distance[:, None, None], (x, y), self.centre)

    def to_middle(self, wavelength: float | np.ndarray, dtype: str) -> np.ndarray:
        """Return factors from the light at samples to the field at the window's middle, (pupil, y, x).

        A factor is the complex `diffraction_kernel` [1/m²], up to a constant phase. The light that is multiplied by it
        must already be multiplied by the areas [m²] of the samples.

        wavelength: a single wavelength [m] in the medium.
        """
        key = "to_middle", float(wavelength), dtype
        return np.asarray(self.known.get(key, lambda: turned(*self._to_middle(wavelength, *self.points), dtype)))


def rim_sines(
    outermost: np.ndarray, centre: tuple[float, float], distance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return three properties of each pupil's rim. They determine the grid of sines on which the pupil is sampled.

    Sines are the x and y components of the unit vector from the window's centre to a point. The first result is half
    the width of the grid: the largest difference, along x or y, between the sine of a point on the rim and that of the
    pupil's centre. The second is the largest sine of the angle between the axis and the line to a point on the rim.
    Evenly spaced sines have a spacing [m] in the pupil's plane that grows toward the rim. The third is True if it is at
    most MOST_STRETCH times as large there as at the centre. All are arrays (pupil,).

    outermost: radii [m] of the rims.
    """
    angle = np.linspace(0, 2 * np.pi, RIM, endpoint=False)
    x, y = (outermost[:, None] * part for part in (np.cos(angle), np.sin(angle)))
    rim = _sines(x, y, centre, distance[:, None])
    middle = _sines(np.zeros(len(distance)), np.zeros(len(distance)), centre, distance)
    steepest = np.hypot(*rim).max(axis=1)
    half = np.max([np.abs(at - own[:, None]).max(axis=1) for at, own in zip(rim, middle, strict=True)], axis=0)
    straight = (1 - np.square(middle[0]) - np.square(middle[1])) ** -1.5
    squared = np.maximum(1 - np.square(steepest), 1e-200)
    return half, steepest, (steepest < 1) & (squared**-1.5 <= MOST_STRETCH * straight)


def _aligned(values: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Return values (pupil,) with more axes, so that they broadcast with another array (pupil, ...)."""
    return values.reshape(-1, *[1] * (to.ndim - 1))


def _sines(
    x: np.ndarray, y: np.ndarray, centre: tuple[float, float], distance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y components (sines) of unit vectors from the window's centre to points (x, y) [m] of the pupils."""
    x, y = x - centre[0], y - centre[1]
    slant = np.sqrt(x * x + y * y + distance * distance)
    return x / slant, y / slant


def _transmittance(edge: SoftAperture, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the transmittance of a soft aperture at points in units of its radius."""
    types = precision("float64")
    across, down = (types.Float64(padded_for_packets(part)) for part in (x, y))
    return np.asarray(edge.transmittance(across, down, types).numpy().reshape(x.shape))


@lru_cache(maxsize=64)
def even_weights(samples: int, count: int) -> np.ndarray:
    """Return the matrix (sample, point) that interpolates from Chebyshev points to evenly spaced samples."""
    return np.ascontiguousarray(lagrange_basis(np.linspace(-1, 1, samples), chebyshev_points(count)).T)


@lru_cache(maxsize=256)
def _profile(edge: SoftAperture, curvature: float, dtype: str) -> np.ndarray:
    """Return a table of a soft aperture's transmittance against r², the squared distance from the axis.

    Its values are in the middle of equal steps of r² up to the outermost radius with light, followed by a 0.

    curvature: as in `SineStack`. If not 0, the table of a circle or ring is the complex result of `curved_ring`, in
        single precision.
    dtype: type of the table in all other cases, "float32" or "float64".
    """
    if curvature and isinstance(edge, SoftAnnulus):
        return np.append(curved_ring(edge.edge, edge.inner, curvature, SMOOTHED_LEVELS), 0)
    types, levels = precision("float64"), 2 ** math.ceil(math.log2(PER_CYCLE * edge.stopband))
    r = np.sqrt((np.arange(levels) + 0.5) / levels) * (1 + edge.reach)
    found = edge.transmittance(types.Float64(r), types.Float64(np.zeros(levels)), types).numpy()
    return np.append(found, 0.0).astype(dtype)
