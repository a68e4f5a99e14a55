"""The remaining factor of the diffraction kernel, after the parts that depend on x alone or on y alone are removed.

The slow factor is the ratio of the diffraction kernel to a Fourier kernel (see `slow_factor`). It has two axis factors
(see `AxisFactor`), the values of the slow factor on the x axis and on the y axis of the window. A point of the pupil
has two sines, the x and y components of its direction from the middle of the window. The axis factor along x is
computed for points with a common sine along y, and the axis factor along y for points with a common sine along x. The
remaining factor is the slow factor divided by both axis factors. All are relative to their values at the middle of the
window. The remaining factor varies even more slowly over the window than the slow factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.methods.axis_kernel import AxisFactor, Pair
from optics.methods.sine_stack import SineGeometry
from optics.methods.slow_factor import Path, slow_parts
from optics.numerics.array_library import turned

__all__ = ["RemainingFactor"]


@dataclass(frozen=True, eq=False)
class RemainingFactor:
    """The part of the slow factor that depends on both x and y, for light from given points of pupils to a window.

    The slow factor is the ratio of the diffraction kernel to a Fourier kernel. It is divided by two axis factors, its
    values on the x axis and on the y axis of the window (see `AxisFactor`). Intermediate results that do not depend on
    the position in the window are computed once.

    directions: x and y components (s, t) of the unit vector from the middle of the window to each point of a pupil,
        minus the components of the unit vector to the pupil's centre.
    dtype: "float32" or "float64". With "float32", paths are computed in float32, too, if they are short enough.
    """

    path: Path
    samples: SineGeometry
    directions: Pair
    dtype: str = "float64"

    def at(self, window: Pair) -> np.ndarray:
        """Return the complex remaining factor for light that arrives at positions of the window.

        The slow factor is the ratio of the diffraction kernel to a Fourier kernel. The remaining factor is the slow
        factor divided by two axis factors, at (u, 0) for points of the pupil with a common sine along y, and at (0, v)
        for points with a common sine along x (see `AxisFactor`). All three are relative to their values at the middle
        of the window.

        window: positions (u, v) [m] relative to the middle of the window. They have as many dimensions as the attribute
            `directions`, with which they broadcast.
        """
        window = self.rounded(window[0]), self.rounded(window[1])
        if len({part.shape for part in (*self.directions, *window)}) == 1:
            return self._paired(window)
        return self.divided(window, [factor.at(place) for factor, place in zip(self.along, window, strict=True)])

    def rounded(self, values: np.ndarray) -> np.ndarray:
        """Return numbers, rounded to the type in which path lengths from pupil to window are computed."""
        return values.astype(self._kind, copy=False)

    def divided(self, window: Pair, along: Sequence[Pair | np.ndarray]) -> np.ndarray:
        """Return the remaining factor at positions (u, v) of the window, given both axis factors there.

        The slow factor, the ratio of the diffraction kernel to a Fourier kernel, is divided by its value at the middle
        of the window and by both axis factors. The axis factors are the slow factor at (u, 0) and at (0, v), each
        relative to its value at the middle of the window (see `AxisFactor`).

        window: positions (u, v) [m] relative to the middle of the window, as `rounded` returns them.
        along: amplitude and phase [waves] of the axis factors at u and at v, as `AxisFactor.at` returns them.
        """
        path, points, directions = self._pupil
        size, waves = slow_parts(path, points, directions, window)
        middle = self._middle
        size, waves = size / middle[0], waves - middle[1]
        for part in along:
            size /= part[0]
            waves -= part[1]
        return np.asarray(turned(size, waves, self.dtype))

    def _paired(self, window: Pair) -> np.ndarray:
        """Return the remaining factor for pairs of one point of the pupil and one position (u, v) in the window.

        The slow factor is the diffraction kernel divided by a Fourier kernel. It is evaluated at (u, v), (u, 0) and
        (0, v) together. The values at (u, 0) and (0, v) are called axis factors. The remaining factor is the value at
        (u, v) divided by both axis factors.

        window: positions u and v [m], arrays of the same shape as the attribute `directions`.
        """
        (u, v), none, (points, directions, middle) = window, np.zeros_like(window[0]), self._three
        at = np.stack([u, u, none], axis=1), np.stack([v, none, v], axis=1)
        size, waves = slow_parts(self._pupil[0], points, directions, at)
        size, waves = size / middle[0], waves - middle[1]
        total = size[:, 0] / size[:, 1] / size[:, 2], waves[:, 0] - waves[:, 1] - waves[:, 2]
        return np.asarray(turned(*total, self.dtype))

    @cached_property
    def _three(self) -> tuple[Pair, Pair, Pair]:
        """Points of the pupil, their sines, and amplitude and phase of the slow factor at the window's middle.

        The slow factor is the ratio of the diffraction kernel to a Fourier kernel. The sines of a point are the x and y
        components of the unit vector from the window's middle to the point, minus those of the pupil's centre.

        Each array has the shape (pupil, 3, ...). Its axis 1 counts three sets of points. The first are the points with
        the attribute `directions` as sines. The second are those of the `AxisFactor` along x, which have a common sine
        along y. The third are those of the `AxisFactor` along y, which have a common sine along x.
        """
        _, points, directions = self._pupil
        own, shape = (points, directions, self._middle), directions[0].shape
        parts = [own, *(factor.pupil for factor in self.along)]

        def stacked(kind: int, axis: int) -> np.ndarray:
            return np.stack([np.broadcast_to(part[kind][axis], shape) for part in parts], axis=1)

        return (stacked(0, 0), stacked(0, 1)), (stacked(1, 0), stacked(1, 1)), (stacked(2, 0), stacked(2, 1))

    @cached_property
    def along(self) -> tuple[AxisFactor, AxisFactor]:
        """The diffraction kernel divided by a Fourier kernel, along x and along y.

        Both factors are relative to their values at the middle of the window.
        """
        path, _, (s, t) = self._pupil
        return AxisFactor(path, self.samples, 0, s), AxisFactor(path, self.samples, 1, t)

    @cached_property
    def _kind(self) -> str:
        """Type in which path lengths from pupil to window are computed."""
        return "float32" if self.dtype == "float32" and self.path.short(self.samples.steepest) else "float64"

    @cached_property
    def _pupil(self) -> tuple[Path, Pair, Pair]:
        """Three values: the attribute `path`, points (x, y) [m] of the pupil, and the attribute `directions` (s, t).

        The points are those that lie in these directions. The numbers in all three values are rounded to the type in
        which path lengths are computed (see `rounded`).
        """
        points = self.samples.points_at(*self.directions)
        if self._kind == "float64":
            return self.path, points, self.directions
        (x, y), (s, t) = (tuple(map(self.rounded, pair)) for pair in (points, self.directions))
        return self.path.rounded(self._kind), (x, y), (s, t)

    @cached_property
    def _middle(self) -> Pair:
        """Amplitude and phase [waves] of the slow factor at the middle of the window.

        The slow factor is the factor by which the diffraction kernel differs from a Fourier kernel.
        """
        path, points, directions = self._pupil
        none = np.zeros((1,) * directions[0].ndim, self._kind)
        return slow_parts(path, points, directions, (none, none))
