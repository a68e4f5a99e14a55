"""Means of an intensity over the square pixels of a sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.eye.cell_integrals import Tiles, cell_integrals, samples_per_cycle
from optics.numerics.grid import Grid

__all__ = ["SensorPixels"]

BEYOND = 8  # choice: samples beyond the outermost pixels, where a spline through samples is less accurate


@dataclass(frozen=True)
class SensorPixels:
    """Pixels of a sensor, and matrices that compute the means of an image over the pixels from samples of the image.

    samples: grid of the image's samples. The pixels are the cells of another grid, whose pitch is the side of a pixel.
    rows, columns: matrices (pixel, sample) of the means along y and x. The means of an image are rows @ image @
        columns.T.
    """

    samples: Grid
    rows: np.ndarray
    columns: np.ndarray

    @classmethod
    def around(cls, window: Grid, cutoff: float, tolerance: float) -> SensorPixels:
        """Return one pixel around each sample of a window, with the window's pitch as its side.

        cutoff: highest frequency [1/m] of the intensity.
        tolerance: largest relative error of the mean intensity of a pixel.
        """
        side = window.dx
        pitch = min(side, 1 / (samples_per_cycle(tolerance, cutoff * side) * cutoff))
        height, width = (2 * math.ceil(n * side / pitch / 2 + BEYOND) + 1 for n in window.shape)
        # Sample n//2 lies in the middle of a pixel. The middle of an even number of pixels is half a pixel before it.
        x, y = (at - side / 2 * (n % 2 == 0) for at, n in zip(window.centre, window.shape[::-1], strict=True))
        rows, columns = (
            cell_integrals(count, pitch, Tiles(n, side, False)) / side
            for count, n in zip((height, width), window.shape, strict=True)
        )
        return cls(Grid((height, width), pitch, (x, y)), rows, columns)
