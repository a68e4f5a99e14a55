"""Checks of samples over a square, such as heights of a relief, amplitudes of a mask or values of a wavefront."""

from __future__ import annotations

from typing import Any

import numpy as np

from optics.numerics.arguments import plain_reals

__all__ = ["map_samples", "on_both_sides", "square_samples"]


def on_both_sides(heights: np.ndarray) -> bool:
    """Return whether the samples are invariant under mirroring of x and under mirroring of y."""
    return np.array_equal(heights, heights[::-1]) and np.array_equal(heights, heights[:, ::-1])


def square_samples(samples: Any, name: str = "height", what: str = "heights [m]") -> np.ndarray:
    """Return samples with equal numbers of rows and columns, without derivatives, as a read-only array.

    name, what: name of the argument, and description of its values, for error messages.

    Raises:
        ValueError: the array is not square. See also `map_samples`.
    """
    heights = map_samples(samples, name, what)
    if heights.shape[0] != heights.shape[1]:
        raise ValueError(f"{name} has shape {heights.shape}: must be square (n, n), n at least 1")
    return heights


def map_samples(samples: Any, name: str = "height", what: str = "heights [m]") -> np.ndarray:
    """Return samples as a read-only NumPy array (row, column), without derivatives.

    name, what: name of the argument, and description of its values, for error messages.

    Raises:
        ValueError: the array is not two-dimensional, is empty, is of half precision, or contains anything other than
            finite real numbers.
    """
    heights = np.array(plain_reals(name, samples))
    if heights.ndim != 2 or heights.size == 0:
        raise ValueError(f"{name} has shape {heights.shape}: must be (rows, columns), each at least 1")
    if not np.isfinite(heights).all():
        raise ValueError(f"{name} holds NaN or infinity: must be finite {what}")
    heights.setflags(write=False)
    return heights
