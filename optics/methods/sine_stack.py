"""Samples of several pupils at once, evenly spaced in sines as in `sine_samples`, with as many samples for each pupil.

All arrays are of NumPy, and their first axis counts the pupils. It has length 1 if the light of several wavelengths or
sources passes the same samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from optics.apertures.aperture import SoftAperture
from optics.elements.light_stack import LightStack
from optics.methods.sine_samples import MOST_SQUARE, MOST_STRETCH, RIM, SineSamples
from optics.numerics.array_library import turned
from optics.numerics.precision import padded_for_packets, precision

__all__ = ["SineGeometry", "SineStack", "rim_sines", "single_stack"]

LEVELS = 16384  # choice: number of values in a table of the transmittance against r²
FAR = 1000.0  # choice: smallest kz for which the near-field term of the kernel is constant over the pupil


@dataclass(frozen=True, eq=False)
class SineGeometry:
    """Points of pupils, and the sines of the rays from there to the centre of the window.

    distance: distances of the window [m], (pupil,).
    centre: centre (x, y) [m] of the window.
    steepest: sines of the outermost samples with light, (pupil,).
    elsewhere: sines at which factors along the other axis are evaluated, see `slow_factor.axis_factor`, (pupil,).
    """

    distance: np.ndarray
    centre: tuple[float, float]
    steepest: np.ndarray
    elsewhere: np.ndarray

    @cached_property
    def _middle(self) -> tuple[np.ndarray, np.ndarray]:
        """Sines of the rays from the centres of the pupils to the centre of the window."""
        none = np.zeros(len(self.distance))
        return _sines(none, none, self.centre, self.distance)

    def directions(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sines of points of the pupils [m], minus those of the pupils' centres, (pupil, ...)."""
        sx, sy = _sines(x, y, self.centre, _aligned(self.distance, x))
        return sx - _aligned(self._middle[0], sx), sy - _aligned(self._middle[1], sy)

    def points_at(self, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (x, y) [m] of the pupils in directions, see `directions`."""
        sx, sy = s + _aligned(self._middle[0], s), t + _aligned(self._middle[1], t)
        slant = _aligned(self.distance, sx) / np.sqrt(self._squared_cosine(sx, sy))
        return sx * slant + self.centre[0], sy * slant + self.centre[1]

    def _squared_cosine(self, sx: np.ndarray, sy: np.ndarray) -> np.ndarray:
        most = _aligned(np.maximum(np.square(self.steepest), MOST_SQUARE), sx)
        found: np.ndarray = 1 - np.minimum(sx * sx + sy * sy, most)
        return found


@dataclass(frozen=True, eq=False)
class SineStack(SineGeometry):
    """Soft apertures on grids of sines.

    at: sines along either axis minus those of the pupil's centre, (pupil, sample), evenly spaced.
    edges: soft apertures, (pupil,).
    radius: radii [m], (pupil,).
    """

    at: np.ndarray
    edges: tuple[SoftAperture, ...]
    radius: np.ndarray

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

    @cached_property
    def _cosine2(self) -> np.ndarray:
        """Squared cosines of the angles between rays and axis, (pupil, y, x)."""
        sx, sy = (part[:, None] for part in self._middle)
        return self._squared_cosine((self.at + sx)[:, None, :], (self.at + sy)[:, :, None])

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (x, y) [m] of all samples, (pupil, y, x)."""
        slant = self.distance[:, None, None] / np.sqrt(self._cosine2)
        sx, sy = (part[:, None] for part in self._middle)
        return (self.at + sx)[:, None, :] * slant + self.centre[0], (self.at + sy)[:, :, None] * slant + self.centre[1]

    @cached_property
    def weights(self) -> np.ndarray:
        """Areas of the samples [m²] times the transmittance of the apertures, (pupil, y, x)."""
        x, y = self.points
        area = np.square((self.distance * self.pitch)[:, None, None] / self._cosine2)
        first: dict[int, int] = {}
        same = np.array([first.setdefault(id(edge), place) for place, edge in enumerate(self.edges)])
        for place in first.values():
            own = slice(None) if len(first) == 1 else np.flatnonzero(same == place)
            radius = self.radius[own, None, None]
            area[own] *= _transmittance(self.edges[place], x[own] / radius, y[own] / radius)
        return area

    def light(self, stack: LightStack, dtype: str) -> np.ndarray:
        """Return the light behind the pupils times the areas of the samples, (beam, y, x), complex.

        dtype: type of the real and imaginary parts, in which the phase is rounded, "float32" or "float64".
        """
        return np.asarray(turned(self._size(stack), stack.waves(*self.points), dtype))

    def arriving(self, stack: LightStack, dtype: str) -> np.ndarray:
        """Return the contribution of each sample to the field at the middle of the window, (beam, y, x), complex.

        It is the result of `light` times z/(λD²) (1/(kD) - i) e^{ik(D - ρ)}, up to a constant phase.
        """
        x, y = self.points
        z, wavelength = (part[:, None, None] for part in (self.distance, stack.wavelength))
        middle = math.hypot(*self.centre)
        cosine2 = self._cosine2
        far = z / np.sqrt(cosine2)  # D
        # D - ρ = (ξ² - 2 c·ξ) / (D + ρ), without a difference of nearly equal numbers
        excess = x * x + y * y
        if middle:
            excess -= 2 * (self.centre[0] * x + self.centre[1] * y)
        waves = stack.waves(x, y)
        waves += excess / ((far + np.hypot(z, middle)) * wavelength)
        size = self._size(stack) * cosine2
        size /= z * wavelength
        if (2 * np.pi * z / wavelength).min() < FAR:
            near = wavelength / (2 * np.pi * far)
            size *= np.sqrt(1 + near * near)
            waves += np.arctan(near) / (2 * np.pi)
        return np.asarray(turned(size, waves, dtype))

    def _size(self, stack: LightStack) -> np.ndarray:
        amplitude = stack.amplitude(*self.points)
        return self.weights if amplitude is None else self.weights * amplitude


@lru_cache(maxsize=64)
def single_stack(samples: SineSamples) -> SineStack:
    """Return the samples of a single pupil as a stack of one. Many PSFs have the same samples, so it is cached."""
    numbers = samples.distance, samples.steepest, samples.elsewhere, samples.edge.radius
    distance, steepest, elsewhere, radius = (np.array([value]) for value in numbers)
    edges = (samples.edge.aperture,)
    return SineStack(distance, samples.centre, steepest, elsewhere, samples.at[None], edges, radius)


def rim_sines(
    outermost: np.ndarray, centre: tuple[float, float], distance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the largest sine of points on the rims, relative to the pupils' centres and along either axis, (pupil,).

    The second result is the largest sine itself. The third one states for which pupils samples that are evenly spaced
    in sines are even enough in the pupil.

    outermost: radii [m] of the rims.
    """
    angle = np.linspace(0, 2 * np.pi, RIM, endpoint=False)
    rim = _sines(*(outermost[:, None] * part for part in (np.cos(angle), np.sin(angle))), centre, distance[:, None])
    middle = _sines(np.zeros(len(distance)), np.zeros(len(distance)), centre, distance)
    steepest = np.hypot(*rim).max(axis=1)
    half = np.max([np.abs(at - own[:, None]).max(axis=1) for at, own in zip(rim, middle, strict=True)], axis=0)
    straight = (1 - np.square(middle[0]) - np.square(middle[1])) ** -1.5
    squared = np.maximum(1 - np.square(steepest), 1e-300)
    return half, steepest, (steepest < 1) & (squared**-1.5 <= MOST_STRETCH * straight)


def _aligned(values: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Return one value per pupil with the axes of another array (pupil, ...)."""
    return values.reshape(-1, *[1] * (to.ndim - 1))


def _sines(
    x: np.ndarray, y: np.ndarray, centre: tuple[float, float], distance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the sines of the rays from the centre of the window to points (x, y) of the pupils."""
    x, y = x - centre[0], y - centre[1]
    slant = np.sqrt(x * x + y * y + distance * distance)
    return x / slant, y / slant


def _transmittance(edge: SoftAperture, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the transmittance of a soft aperture at points in units of its radius."""
    if edge.rotationally_symmetric:
        table = _profile(edge)
        r2 = x * x + y * y
        return table.take((r2 * (LEVELS / (1 + edge.reach) ** 2)).astype(np.int32), mode="clip")
    types = precision("float64")
    across, down = (types.Float64(padded_for_packets(part)) for part in (x, y))
    return np.asarray(edge.transmittance(across, down, types).numpy().reshape(x.shape))


@lru_cache(maxsize=128)
def _profile(edge: SoftAperture) -> np.ndarray:
    """Return the transmittance in the middle of LEVELS equal steps of r², up to the rim, and 0 beyond."""
    types = precision("float64")
    r = np.sqrt((np.arange(LEVELS) + 0.5) / LEVELS) * (1 + edge.reach)
    found = edge.transmittance(types.Float64(r), types.Float64(np.zeros(LEVELS)), types).numpy()
    return np.append(found, 0.0)
