"""Conversion of the samples of a single pupil to a `SineStack`, the class for samples of several pupils.

The stack is kept for further PSFs with the same samples. It keeps arrays (`SineStack.known`), whose memory grows with
the number of samples.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Protocol

import numpy as np

from optics.methods.sine_samples import SineSamples
from optics.methods.sine_stack import SineStack
from optics.numerics.grid import Grid

__all__ = ["single_stack"]

# Choice, limited by memory (about 200 MB): 16 stacks are kept up to this number of samples. Of larger stacks, two are
# kept, because a PSF and its check have different samples.
LARGE = 2**17


class Stackable(Protocol):
    """Samples of a pupil, such as `PixelNodes`, with a method that returns them as a `SineStack` of a single pupil."""

    @property
    def grid(self) -> Grid: ...

    def stack(self) -> SineStack: ...

    def __hash__(self) -> int: ...


def single_stack(samples: SineSamples | Stackable) -> SineStack:
    """Return the samples of a single pupil as a `SineStack` of one pupil, from a cache if possible."""
    return (_large if math.prod(samples.grid.shape) > LARGE else _small)(samples)


def _stack(samples: SineSamples | Stackable) -> SineStack:
    if not isinstance(samples, SineSamples):
        return samples.stack()
    numbers = samples.distance, samples.steepest, samples.elsewhere, samples.edge.radius
    distance, steepest, elsewhere, radius = (np.array([value]) for value in numbers)
    edges = (samples.edge.aperture,)
    return SineStack(distance, samples.centre, steepest, elsewhere, samples.at[None], edges, radius, np.zeros(1))


_small, _large = (lru_cache(maxsize=count)(_stack) for count in (16, 2))
