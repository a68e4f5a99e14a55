"""The retina as a plane of cells, and the time that its kernels may take."""

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
    """Properties of the retina that define the PSF: distance [m], wavelengths [m], cells, tolerance, dtype.

    cell: height and width of a cell [m].
    size: height and width [m] of the retina.
    samples: number of cells along a receptor's side.
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

        Light from the right travels to the left of the eye's owner, which is +x. Light from below travels up, to +y.
        Both signs are reversed if the pupil is turned.

        direction: tangents (right, down) of the source's direction in the visual field.
        """
        right, down = direction
        return (-right, -down) if self.pupil_turned else (right, down)


class CellsError(AccuracyError):
    """The light covers too many cells. If receptors consist of several cells, coarser cells may be sufficient."""


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
