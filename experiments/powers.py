"""Power laws of errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.means import Interval

__all__ = ["PowerLaw", "power_law"]

Floats = NDArray[np.float64]
RESAMPLES = 2000


@dataclass(frozen=True)
class PowerLaw:
    """Power law error = scale · Π sizeᵢ^-exponentᵢ.

    explained: share of the variance of log error that the law explains
    """

    exponents: tuple[Interval, ...]
    scale: float
    explained: float

    def error(self, *sizes: Floats) -> Floats:
        """Return the error at these sizes: arrays of equal shape, one for each exponent."""
        pairs = zip(sizes, self.exponents, strict=True)
        return self.scale * np.prod([size**-exponent.mean for size, exponent in pairs], axis=0)


def power_law(errors: Floats, *sizes: Floats, seed: int = 0) -> PowerLaw:
    """Return a power law fitted by least squares in logarithms, with 95 % intervals by a bootstrap over candidates.

    errors, sizes: (n,), positive

    Raises:
        ValueError: a value is not positive, all errors are equal, or the sizes do not determine the exponents because
            there are too few of them or because one follows from the others.
    """
    if min(map(np.min, (errors, *sizes))) <= 0:
        raise ValueError("errors, sizes: must be positive, because others have no logarithms")
    y = np.log(errors)
    x = np.log(np.stack(sizes, axis=1))
    middle = x.mean(axis=0)  # without this, sizes within one order of magnitude would resemble the constant
    design = np.column_stack([np.ones(len(y)), x - middle])
    least = len(sizes) + 2
    if len(np.unique(x, axis=0)) < least or np.linalg.matrix_rank(design) < design.shape[1]:
        raise ValueError(
            f"sizes do not determine the exponents: must be at least {least} different ones, none following from others"
        )
    if np.ptp(y) < 1e-9:
        raise ValueError("errors that are all equal have no power law")
    found = np.linalg.lstsq(design, y, rcond=None)[0]
    chance = np.random.default_rng(seed)
    drawn = chance.integers(len(y), size=(RESAMPLES, len(y)))
    solved = [np.linalg.lstsq(design[one], y[one], rcond=None) for one in drawn]
    # With few candidates, some resamples do not determine all exponents. They are left out.
    slopes = [slope[1:] for slope, _, rank, _ in solved if rank == design.shape[1]]
    low, high = np.quantile(slopes, [0.025, 0.975], axis=0)
    exponents = tuple(Interval(-float(m), -float(h), -float(b)) for m, b, h in zip(found[1:], low, high, strict=True))
    explained = 1 - np.var(y - design @ found) / np.var(y)
    return PowerLaw(exponents, float(np.exp(found[0] - middle @ found[1:])), float(explained))
