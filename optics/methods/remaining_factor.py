"""The slow factor of `low_rank`, relative to the middle of the window, divided by its values along both axes.

This quotient varies even more slowly over the window than the slow factor.
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
    """The remaining factor for some points of pupils. Parts that do not depend on the window are computed once.

    directions: sines (s, t) of the points, minus those of the pupil's centre.
    dtype: "float32" or "float64". With "float32", paths are computed in float32, too, if they are short enough.
    """

    path: Path
    samples: SineGeometry
    directions: Pair
    dtype: str = "float64"

    def at(self, window: Pair) -> np.ndarray:
        """Return the factor at positions (u, v) [m] relative to the middle of the window, complex.

        Directions and positions are arrays with the same number of dimensions, and broadcast.
        """
        window = self.rounded(window[0]), self.rounded(window[1])
        if len({part.shape for part in (*self.directions, *window)}) == 1:
            return self._paired(window)
        return self.divided(window, [factor.at(place) for factor, place in zip(self.along, window, strict=True)])

    def rounded(self, values: np.ndarray) -> np.ndarray:
        """Return numbers in the type of the paths."""
        return values.astype(self._kind, copy=False)

    def divided(self, window: Pair, along: Sequence[Pair | np.ndarray]) -> np.ndarray:
        """Return the factor at `rounded` positions, from amplitudes and phases of both axis factors there."""
        path, points, directions = self._pupil
        size, waves = slow_parts(path, points, directions, window)
        middle = self._middle
        size, waves = size / middle[0], waves - middle[1]
        for part in along:
            size /= part[0]
            waves -= part[1]
        return np.asarray(turned(size, waves, self.dtype))

    def _paired(self, window: Pair) -> np.ndarray:
        """Return the factor for one position per point. The slow factor and its axis factors are evaluated together."""
        (u, v), none, (points, directions, middle) = window, np.zeros_like(window[0]), self._three
        at = np.stack([u, u, none], axis=1), np.stack([v, none, v], axis=1)
        size, waves = slow_parts(self._pupil[0], points, directions, at)
        size, waves = size / middle[0], waves - middle[1]
        total = size[:, 0] / size[:, 1] / size[:, 2], waves[:, 0] - waves[:, 1] - waves[:, 2]
        return np.asarray(turned(*total, self.dtype))

    @cached_property
    def _three(self) -> tuple[Pair, Pair, Pair]:
        """Points, directions, and slow factors at the window's middle, for the factor itself and both axis factors.

        The shapes are (pupil, 3, ...).
        """
        _, points, directions = self._pupil
        own, shape = (points, directions, self._middle), directions[0].shape
        parts = [own, *(factor.pupil for factor in self.along)]

        def stacked(kind: int, axis: int) -> np.ndarray:
            return np.stack([np.broadcast_to(part[kind][axis], shape) for part in parts], axis=1)

        return (stacked(0, 0), stacked(0, 1)), (stacked(1, 0), stacked(1, 1)), (stacked(2, 0), stacked(2, 1))

    @cached_property
    def along(self) -> tuple[AxisFactor, AxisFactor]:
        """Factors along x and y."""
        path, _, (s, t) = self._pupil
        return AxisFactor(path, self.samples, 0, s), AxisFactor(path, self.samples, 1, t)

    @cached_property
    def _kind(self) -> str:
        """Type of the paths."""
        return "float32" if self.dtype == "float32" and self.path.short(self.samples.steepest) else "float64"

    @cached_property
    def _pupil(self) -> tuple[Path, Pair, Pair]:
        """Path, points of the pupil and their directions, rounded."""
        points = self.samples.points_at(*self.directions)
        if self._kind == "float64":
            return self.path, points, self.directions
        (x, y), (s, t) = (tuple(map(self.rounded, pair)) for pair in (points, self.directions))
        return self.path.rounded(self._kind), (x, y), (s, t)

    @cached_property
    def _middle(self) -> Pair:
        """Amplitude and phase [waves] of the slow factor at the middle of the window."""
        path, points, directions = self._pupil
        none = np.zeros((1,) * directions[0].ndim, self._kind)
        return slow_parts(path, points, directions, (none, none))
