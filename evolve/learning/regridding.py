"""Change of the grid of an eye's signals before they reach the encoder, the part of the brain that processes images.

Signals are averaged on a coarser grid, and the averages are repeated on a finer grid. Averaging and repetition serve as
controls in experiments on resolution. An eye of 15 x 15 receptors whose signals are averaged on 4 x 4 cells and
repeated on 15 x 15 has the acuity of 4 x 4 receptors, but still 15 x 15 inputs.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from evolve.config.settings import WiringConfig

__all__ = ["Regridding"]


class Regridding:
    """Linear map from the signals of a retina to the inputs of an encoder, the same for all eyes and channels.

    retina: rows and columns of the receptors
    wiring: settings; only `pool_side` and `repeat_side` are used

    The attribute `shape` contains the rows and columns of the inputs. The map is not a PyTorch module, because it has
    no parameters and no state.
    """

    def __init__(self, retina: tuple[int, int], wiring: WiringConfig) -> None:
        maps = [_axis(n, wiring.pool_side, wiring.repeat_side) for n in retina]
        self.shape = (len(maps[0]), len(maps[1]))
        self._rows, self._columns = (torch.tensor(one, device="cpu") for one in maps)
        self._is_identity = all(np.array_equal(one, np.eye(n)) for one, n in zip(maps, retina, strict=True))

    def __call__(self, signals: Tensor) -> Tensor:
        """Return the inputs of the encoder.

        signals: signals of the receptors, (..., height, width); the result is (..., rows, columns)
        """
        if self._is_identity:
            return signals
        rows, columns = self._rows.to(signals), self._columns.to(signals)
        return rows @ signals @ columns.T


def _axis(n: int, pool_side: int, repeat_side: int) -> np.ndarray:
    """Return the matrix that maps a line of receptors to a line of inputs of the encoder, (input, receptor).

    A line is a row or a column of the grid, and `n` is its number of receptors.
    """
    pooled = _averages(n, min(pool_side or n, n))
    return _repeats(len(pooled), max(repeat_side, len(pooled))) @ pooled


def _averages(n: int, side: int) -> np.ndarray:
    """Return the matrix (side, n) that averages `n` receptors over `side` equal intervals of their axis.

    The weight of a receptor is the fraction of the interval that it covers.
    """
    receptor, interval = (  # beginnings of receptors and intervals, on an axis of the length n * side
        side * np.arange(n),
        n * np.arange(side)[:, None],
    )
    overlap = np.minimum(receptor + side, interval + n) - np.maximum(receptor, interval)
    return np.clip(overlap, 0, None) / n


def _repeats(n: int, side: int) -> np.ndarray:
    """Return the matrix that repeats `n` values on a grid of `side` cells, (side, n).

    The values belong to equal intervals. Each cell takes the value of the interval that contains its centre.
    """
    taken = (np.arange(side) + 0.5) * n // side
    return np.eye(n)[taken.astype(int)]
