"""Choice of a few rows and columns of a PSF. Where they cross, `window_check` computes the PSF in a second way.

Each row has a probability of being chosen. The probabilities are added up from row to row. Whenever the sum reaches one
of several evenly spaced levels, this row is chosen. Columns are chosen in the same way. The probability is a mixture of
four distributions. The first is uniform. The second is proportional to the square root of the intensity. This favours
rows with large errors: if the error of the amplitude is the same everywhere, the error of the intensity is proportional
to this root. The third favours the brightest samples and their neighbours. The last favours the sides of the window,
where phases change fastest.
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
    """Samples at which PSFs are checked: the crossings of a few rows and columns of each PSF.

    The first axis of all arrays, `stack`, counts the PSFs.

    rows, columns: indices, (stack, row) and (stack, column).
    images: |U|² at the crossings, (stack, row, column), an array of the same library (NumPy or PyTorch) and on the same
        device as the PSFs.
    chance: probability of each crossing, which is the probability of its row times that of its column, (stack, row,
        column).
    total: sum of |U|⁴ over the window, (stack,).
    """

    rows: np.ndarray
    columns: np.ndarray
    images: Array
    chance: Array
    total: Array

    @classmethod
    def from_images(cls, images: Array) -> WindowCrossings:
        """Return a few rows and columns of each PSF, and the intensities where they cross.

        Rows and columns are chosen with probabilities that depend on the intensities in them.

        If the PSFs are on a GPU, only the indices of rows and columns are copied to the CPU.

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
    """Return the indices of a few rows of each PSF, and the probabilities of choosing these rows, (stack, row) each.

    The probabilities depend on sums over each row. With sums over each column instead, the function chooses columns.

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
    """Return the index 0, 1, 2, ... of each PSF, array (stack, 1). The first axis of `places` counts the PSFs."""
    return library(places).ones_like(places[:, :1]).cumsum(0) - 1
