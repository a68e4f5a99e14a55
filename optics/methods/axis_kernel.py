"""The diffraction kernel along one axis of the window, relative to its value at the middle of the window.

The kernel is a Fourier kernel times a factor that varies slowly over the window (see `slow_factor`). A point of the
pupil is identified by two sines, the components along x and y of its direction as seen from the middle of the window.
Along one axis of the window, the Fourier kernel and the slow factor depend on two numbers only: the position in the
window and the sine of the point of the pupil, both along this axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from optics.methods.sine_stack import SineStack, even_weights
from optics.methods.slow_factor import Path, slow_parts
from optics.numerics.array_library import turned
from optics.numerics.grid import sample_positions
from optics.numerics.interpolation import chebyshev_points

__all__ = ["AxisFactor", "AxisRows", "Pair", "axis_factor", "axis_kernel", "window_kernel"]

Pair = tuple[np.ndarray, np.ndarray]

SMOOTH = 12  # choice: number of sines, and of positions, from which smooth phases are interpolated


class HasDirections(Protocol):
    """Samples of one or several pupils: `SineSamples`, `SineGeometry`, or `PixelNodes`."""

    @property
    def elsewhere(self) -> float | np.ndarray:
        """Sine that points of the pupil have in common along one axis, minus the sine of the pupil's centre.

        The sines of a point are the x and y components of the unit vector from the window's middle to the point. The
        slow factor, the ratio of the diffraction kernel to a Fourier kernel, is computed along x for points that have
        different sines along x and a common sine along y. Along y, it is computed for points that have different sines
        along y and a common sine along x. This property gives the common sine in both cases.
        """

    def points_at(self, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (x, y) [m] of the pupils in given directions from the window's middle.

        s, t: x and y components of the unit vector from the window's middle to each point, minus the components of the
            unit vector to the pupil's centre.
        """


@dataclass(frozen=True, eq=False)
class AxisFactor:
    """The slow factor along x (0) or y (1), relative to its value at the middle of the window.

    The slow factor is the ratio of the diffraction kernel to a Fourier kernel, and varies slowly over the window. The
    sines of a point of the pupil are the components of its direction along x and y, as seen from the middle of the
    window. The points have different sines along `axis`. Along the other axis, all points have the same sine: that of
    the pupil's centre plus `samples.elsewhere`. The points, and the factor at the middle of the window, are computed
    once.

    sines: sines of the points along the axis, minus the sine of the pupil's centre. The array has as many dimensions as
        the array `places` that the method `at` takes.
    """

    path: Path
    samples: HasDirections
    axis: int
    sines: np.ndarray

    def at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitude and phase [waves] of the slow factor, relative to its value at the middle of the window.

        The slow factor is the ratio of the diffraction kernel to a Fourier kernel.

        places: positions [m] along the axis, relative to the middle of the window, with the dtype of the field `sines`.
        """
        points, directions, middle = self.pupil
        none = np.zeros((1,) * self.sines.ndim, self.sines.dtype)
        size, waves = slow_parts(self.path, points, directions, (places, none) if self.axis == 0 else (none, places))
        size /= middle[0]
        waves -= middle[1]
        return size, waves

    @cached_property
    def pupil(self) -> tuple[Pair, Pair, Pair]:
        """Points of the pupil, their directions, and the slow factor of each point.

        The slow factor is the ratio of the diffraction kernel to a Fourier kernel. Its amplitude and phase are those at
        the middle of the window. Points are (x, y) [m], and the phase is in waves. Directions are the x and y
        components of the unit vector from the window's middle to a point, minus those of the unit vector to the pupil's
        centre.
        """
        kind, elsewhere = self.sines.dtype, self.samples.elsewhere
        none = np.zeros((1,) * self.sines.ndim, kind)
        other = none + (elsewhere.reshape(-1, *none.shape[1:]) if isinstance(elsewhere, np.ndarray) else elsewhere)
        other = other.astype(kind)
        directions = (self.sines, other) if self.axis == 0 else (other, self.sines)
        x, y = self.samples.points_at(*directions)
        points = x.astype(kind), y.astype(kind)
        return points, directions, slow_parts(self.path, points, directions, (none, none))


def axis_factor(path: Path, samples: HasDirections, axis: int, sines: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the complex slow factor along x (0) or y (1), relative to its value at the middle of the window.

    The slow factor is the ratio of the diffraction kernel to a Fourier kernel. Like the Fourier kernel along this axis,
    it depends on two numbers only: the position in the window, and the sine of the direction to a point of the pupil.
    It can therefore be included in the Fourier kernel. The sine is the component along the axis of the unit vector from
    the middle of the window to the point. The arrays `sines` and `places` broadcast with each other.

    sines: sines of points, minus the sine of the pupil's centre.
    places: positions [m] along the axis, relative to the middle of the window.
    """
    sines = sines.reshape((1,) * (places.ndim - sines.ndim) + sines.shape)
    return np.asarray(turned(*AxisFactor(path, samples, axis, sines).at(places), "float64"))


def axis_kernel(path: Path, samples: SineStack, axis: int, places: np.ndarray, dtype: str) -> np.ndarray:
    """Return the diffraction kernel along x (0) or y (1), relative to its value at the middle of the window.

    The result, the product of the Fourier kernel and `axis_factor`, is a complex array (pupil, position, sample).

    places: positions [m] along the axis, relative to the middle of the window, (pupil, position).
    dtype: "float32" or "float64".
    """
    return np.asarray(turned(*_whole(path, samples, axis, samples.at, places), dtype))


def window_kernel(path: Path, samples: SineStack, axis: int, dtype: str) -> np.ndarray:
    """Return the diffraction kernel along x (0) or y (1) at all columns or rows of the window, see `axis_kernel`.

    If amplitude and phase of the kernel are smooth, both are computed for only a few points of the pupil and a few
    positions in the window, and interpolated between these. The result is a complex array (pupil, column or row,
    sample).
    """
    at, place = samples.at, sample_positions(path.window.shape[1 - axis], path.window.dx)
    if min(len(place), at.shape[1]) <= SMOOTH or not samples.smooth(path.window.half_width):
        return axis_kernel(path, samples, axis, place[None, :], dtype)
    nodes = chebyshev_points(SMOOTH)
    sides = [part[:, [0, -1]] for part in (at, place[None, :])]
    sines, few = (side.mean(axis=1)[:, None] + np.diff(side) / 2 * nodes for side in sides)
    to_sines, to_places = (even_weights(count, SMOOTH) for count in (at.shape[1], len(place)))
    size, waves = (to_places @ part @ to_sines.T for part in _whole(path, samples, axis, sines, few))
    return np.asarray(turned(size, waves, dtype))


@dataclass(eq=False)
class AxisRows:
    """Rows of the matrix `axis_kernel`, one for each position along an axis of the window.

    For a single pupil, each row is computed only once.

    path, samples, axis, dtype: see `axis_kernel`.
    """

    path: Path
    samples: SineStack
    axis: int
    dtype: str

    def __post_init__(self) -> None:
        count = self.path.window.shape[1 - self.axis]
        self._known = np.zeros(count, bool)
        self._rows = np.empty((count, self.samples.at.shape[1]), np.result_type(self.dtype, np.complex64))

    def at(self, places: np.ndarray) -> np.ndarray:
        """Return the diffraction kernel at some positions along the axis of the window, see `axis_kernel`.

        The result is an array (pupil, position, sample of the pupil).

        places: indices of columns of the window if the axis is x, and of rows if it is y.
        """
        if len(self.samples.at) > 1:
            return self._computed(places)
        known = self._known[places]
        if not known.all():
            missing = np.unique(places[~known])
            self._rows[missing] = self._computed(missing[None, :])[0]
            self._known[missing] = True
        return self._rows[places]

    def _computed(self, places: np.ndarray) -> np.ndarray:
        window = self.path.window
        at = (places - window.shape[1 - self.axis] // 2) * window.dx
        return axis_kernel(self.path, self.samples, self.axis, at, self.dtype)


def _whole(
    path: Path, samples: SineStack, axis: int, sines: np.ndarray, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return amplitude and phase [waves] of the diffraction kernel along an axis, arrays (pupil, position, sine).

    The kernel is relative to its value at the middle of the window, see `axis_kernel`.

    sines: sines of points of the pupil along the axis, minus the sine of the pupil's centre, (pupil, sine).
    places: positions [m] along the axis, relative to the middle of the window, (pupil, position).
    """
    sines, places = sines[:, None, :], places[:, :, None]
    size, waves = AxisFactor(path, samples, axis, sines).at(places)
    wavelength, _ = path.numbers(3)
    return size, waves - places * sines / wavelength
