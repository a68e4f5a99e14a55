"""The retina, a plane divided into cells, and exceptions for PSFs that cover too many cells or take too long."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from optics.numerics.accuracy import AccuracyError
from optics.numerics.autodiff import Scalar

__all__ = ["CellsError", "Retina", "more_time"]


@dataclass(frozen=True)
class Retina:
    """Properties of the retina that define the PSF on it.

    Cells are the equal rectangles into which the retina is divided, one or more along each side of a receptor.

    distance: distance [m] from the pupil to the retina.
    wavelengths: wavelength [m] of each band.
    cell: height and width of a cell [m].
    tolerance: relative error of the PSF.
    size: height and width [m] of the retina.
    samples: number of cells along a receptor's side.
    dtype: "float32" or "float64", the type of the results.
    pupil_turned: True if the pupil is rotated by 180° about the axis.
    most_seconds: largest predicted time [s] that the PSF of one band may take.
    """

    distance: Scalar
    wavelengths: np.ndarray
    cell: tuple[float, float]
    tolerance: float
    size: tuple[float, float]
    samples: int
    dtype: str = "float32"
    pupil_turned: bool = False
    most_seconds: float = 3.0  # choice

    def across_pupil(self, direction: tuple[float, float]) -> tuple[float, float]:
        """Return the tangents (x, y), in the pupil's axes, of the direction in which the light of a source travels.

        The x axis points to the left, as seen by the eye's owner, so light from the right travels in the direction +x.
        The y axis points up, so light from below travels in the direction +y. Both axes are reversed if the pupil is
        turned.

        direction: tangents (right, down) of the source's direction in the visual field.
        """
        right, down = direction
        return (-right, -down) if self.pupil_turned else (right, down)


class CellsError(AccuracyError):
    """The light of a point source covers more cells of the retina than the limit.

    Cells are the equal rectangles into which the retina is divided. If receptors consist of several cells, fewer and
    larger cells may be sufficient.
    """


@contextmanager
def more_time() -> Iterator[None]:
    """Within this context, an AccuracyError about too long a computing time also states a sufficient `most_seconds`."""
    try:
        yield
    except AccuracyError as refused:
        if refused.seconds is None:
            raise
        allowed = f"most_seconds={math.ceil(1.1 * refused.seconds)} allows the eye this time"
        raise AccuracyError(f"{refused}; {allowed}", seconds=refused.seconds) from None
