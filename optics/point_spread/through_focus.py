"""PSFs at several distances of the sensor, and the distance of best focus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.numerics.arguments import positive, reals, shown
from optics.numerics.autodiff import plain
from optics.numerics.read_only import ReadOnlyArrays, read_only
from optics.point_spread.psf import psf
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.strehl import strehl_ratio

__all__ = ["ThroughFocus", "through_focus"]


@dataclass(frozen=True, eq=False)
class ThroughFocus(ReadOnlyArrays):
    """PSFs of a pupil at several distances of the sensor, over the same window.

    distances: distances [m] behind the pupil, ascending, (distance,).
    results: one PSFResult per distance.
    """

    distances: np.ndarray
    results: tuple[PSFResult, ...]

    def __repr__(self) -> str:
        return f"<ThroughFocus {self.distances[0]:.6g} to {self.distances[-1]:.6g} m, {self.results!r}>"

    @cached_property
    def psf(self) -> np.ndarray:
        """PSFs [1/m²], (distance, wavelength, y, x)."""
        return read_only(np.stack([result.psf for result in self.results]))

    def measured(self, measure: Callable[[PSFResult], Any]) -> np.ndarray:
        """Return a measure of each PSF, for example `optics.strehl_ratio`, (distance, wavelength, ...).

        measure: function that returns an array (wavelength, ...). To pass it further arguments, use a lambda.
            Derivatives are dropped.
        """
        return np.stack([plain(measure(result)) for result in self.results])

    def best_focus(self) -> np.ndarray:
        """Return the distance [m] of the highest Strehl ratio, (wavelength,).

        It is the vertex of the parabola through the highest ratio and its neighbours.

        Raises:
            ValueError: there are fewer than three distances, or the ratio is highest at the first or the last distance.
            AccuracyError: see `optics.strehl_ratio`.
        """
        if len(self.distances) < 3:
            raise ValueError(f"{len(self.distances)} sensor_distances: must be three or more for a best focus")
        ratios, found = self.measured(strehl_ratio), []
        for wavelength, column in zip(self.results[0].wavelengths, ratios.T, strict=True):
            top = int(column.argmax())
            if top in (0, len(column) - 1):
                raise ValueError(
                    f"at {wavelength:g} m the Strehl ratio is highest at sensor_distance = {self.distances[top]:g} m, "
                    "the end of the range: must rise and fall within it"
                )
            at = self.distances[top - 1 : top + 2]
            curve, slope, _ = np.polyfit(at - at[1], column[top - 1 : top + 2], 2)
            found.append(at[1] - slope / (2 * curve))
        return np.array(found)


def through_focus(pupil: Pupil, sensor_distances: Any, **asked: Any) -> ThroughFocus:
    """Return the PSFs of a pupil for several distances of the sensor.

    sensor_distances: distances [m] behind the pupil, ascending. Distances around `pupil.image_distance(math.inf)` cover
        the focus of an ideal lens.
    asked: further arguments of `optics.psf`, such as wavelengths, dx and shape, apart from sensor_distance.

    Raises:
        ValueError: the distances are not a row of ascending positive numbers, or another argument is invalid.
        AccuracyError: see `optics.psf`.
        BackendError: see `optics.psf`.
    """
    if "sensor_distance" in asked:
        raise ValueError("sensor_distance: must be left out, because sensor_distances contains it")
    distances = np.atleast_1d(reals("sensor_distances", sensor_distances))
    if distances.ndim != 1 or not distances.size or not (np.diff(distances) > 0).all():
        raise ValueError(f"sensor_distances = {shown(sensor_distances)}: must be a row of ascending distances [m]")
    for distance in distances:
        positive("sensor_distances", float(distance))
    results = tuple(psf(pupil, sensor_distance=float(distance), **asked) for distance in distances)
    return ThroughFocus(distances, results)
