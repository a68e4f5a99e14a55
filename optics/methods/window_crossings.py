"""Crossings of a few rows and columns, where `window_check` computes a PSF once more.

Each row has a probability. It is added up from row to row, and a row is chosen wherever the sum reaches the next of
evenly spaced levels. Columns are chosen in the same way. The probability is a mixture of four distributions. The first
is uniform. The second is proportional to the square root of the intensity. The error of the intensity is proportional
to this root, too, if the error of the amplitude is the same everywhere. The third favours the brightest samples and
their neighbours. The last favours the sides of the window, where phases change fastest.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from optics.numerics.array_library import gather, indices, library, on_processor, to_double
from optics.numerics.autodiff import Array

__all__ = ["WindowCrossings"]

ACROSS = 10  # choice: number of rows and of columns in which the check computes the PSF
SHARES = (0.3, 0.3, 0.3, 0.1)  # choices: weights of the probabilities of rows and columns


@dataclass(frozen=True, eq=False)
class WindowCrossings:
    """Samples of PSFs that are checked: the crossings of a few rows and columns of each PSF.

    The first axis of all arrays, `stack`, counts the PSFs.

    rows, columns: indices, (stack, row) and (stack, column).
    images: |U|² at the crossings, (stack, row, column), an array of NumPy or PyTorch like the PSFs, on the same device.
    chance: probability of each crossing, the product of those of its row and column, (stack, row, column).
    total: sum of |U|⁴ over the window, (stack,).
    """

    rows: np.ndarray
    columns: np.ndarray
    images: Array
    chance: Array
    total: Array

    @classmethod
    def from_images(cls, images: Array) -> WindowCrossings:
        """Return a few rows and columns of PSFs, chosen by their intensities, with the intensities at the crossings.

        If the PSFs are on another device, only the indices of rows and columns are copied to the processor.

        images: PSFs |U|², (stack, y, x), an array of NumPy or PyTorch.
        """
        own, (count, height, width) = library(images), images.shape
        total = own.square(to_double(images)).reshape(count, -1).sum(1)
        lit = images
        if own is not np or not (total > 0).all():
            lit = own.where((total > 0)[:, None, None], images, 1)
        light = own.sqrt(lit), own.square(lit)
        of_rows, of_columns = ([part.sum(along) for part in light] for along in (2, 1))
        if height == width:
            both = [own.concatenate(pair) for pair in zip(of_rows, of_columns, strict=True)]
            places, chance = _along_axis(*both)
            rows, columns, down, across = places[:count], places[count:], chance[:count], chance[count:]
        else:
            (rows, down), (columns, across) = _along_axis(*of_rows), _along_axis(*of_columns)
        corner = _beams(rows) * height + rows
        drawn = gather(images, corner[:, :, None] * width + columns[:, None, :])
        places = on_processor(own.concatenate([rows, columns], 1))
        found = places[:, : rows.shape[1]], places[:, rows.shape[1] :]
        return cls(*found, drawn, down[:, :, None] * across[:, None, :], total)

    def part(self, some: slice) -> WindowCrossings:
        """Return the same data for some of the PSFs only.

        some: their places along the first axis.
        """
        return WindowCrossings(*(getattr(self, one.name)[some] for one in fields(self)))


def _along_axis(root: Array, bright: Array) -> tuple[Array, Array]:
    """Return the indices of a few rows of each PSF, chosen by probability, and their probabilities, (stack, row) each.

    Columns are chosen in the same way, from their sums instead of those of rows.

    root: sum of the square root of the intensity over each row, (stack, row).
    bright: sum of the squared intensity over each row, (stack, row).
    """
    own, root, bright = library(root), to_double(root), to_double(bright)
    size = root.shape[1]
    count = min(ACROSS, size)
    if count == size:
        return indices(own.ones_like(root).cumsum(1) - 1), own.full_like(root, 1 / count)
    bright[:, 1:-1] = bright[:, :-2] + bright[:, 1:-1] + bright[:, 2:]
    uniform, of_root, of_bright, of_sides = SHARES
    chance = root * (of_root / root.sum(1))[:, None] + bright * (of_bright / bright.sum(1))[:, None]
    chance += uniform / size
    chance[:, 0] += of_sides / 2
    chance[:, -1] += of_sides / 2
    levels = chance.cumsum(1)
    steps = own.ones_like(root[:, :count]).cumsum(1) - 0.5
    wanted = steps / count * levels[:, -1:]
    place = (levels[:, None, :] < wanted[:, :, None]).sum(2).clip(max=size - 1)
    return place, gather(chance, _beams(place) * size + place)


def _beams(places: Array) -> Array:
    """Return the indices 0, 1, 2, ... of the PSFs, which lie along the first axis of `places`, array (stack, 1)."""
    return library(places).ones_like(places[:, :1]).cumsum(0) - 1
