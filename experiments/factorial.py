"""Effects of factors with two levels in a blocked factorial design, by least squares.

Source: Box, Hunter and Hunter 2005, ch. 5.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from experiments.means import Interval

__all__ = ["Effects", "effects", "interaction_with_task"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Effects:
    """Effects of factors and of their interactions of order two, in units of the residual standard deviation.

    of: effect of each set of one or two factors. For one factor, it is the mean at the high level minus the mean at the
        low level. For two factors, it is half of this: the first factor's effect at the second factor's high level,
        minus its effect at the low level
    spread: residual standard deviation, in units of the response
    freedom: degrees of freedom of the residual
    """

    of: Mapping[tuple[str, ...], Interval]
    spread: float
    freedom: int


def effects(
    levels: Mapping[str, Sequence[int]], blocks: Sequence[int], response: Floats, confidence: float = 0.95
) -> Effects:
    """Return the effects of the factors on the response.

    levels: -1 or +1 for each run, by the name of the factor
    blocks: block of each run, whose mean is removed
    response: result of each run
    confidence: coverage of the intervals

    Interactions of three and more factors are fitted, so that they do not enter the residual, but are not returned.

    Raises:
        ValueError: some effects cannot be separated, or no degree of freedom is left for the residual.
    """
    terms = [names for order in range(1, len(levels) + 1) for names in itertools.combinations(levels, order)]
    columns = [np.prod([np.asarray(levels[name], float) for name in names], axis=0) for names in terms]
    dummies = [(np.asarray(blocks) == block).astype(float) for block in sorted(set(blocks))]
    design = np.stack([*columns, *dummies], axis=1)
    freedom = len(response) - design.shape[1]
    if np.linalg.matrix_rank(design) < design.shape[1] or freedom < 1:
        raise ValueError(f"{len(response)} runs are too few for {len(terms)} effects and {len(dummies)} blocks")
    inverse = np.linalg.inv(design.T @ design)
    coefficients = inverse @ design.T @ response
    spread = math.sqrt(float(((response - design @ coefficients) ** 2).sum()) / freedom)
    reach = float(t.ppf((1 + confidence) / 2, freedom))
    found = {}
    for n, names in enumerate(terms):
        if len(names) <= 2:
            mean, half = 2 * float(coefficients[n]) / spread, 2 * reach * math.sqrt(float(inverse[n, n]))
            found[names] = Interval(mean, mean - half, mean + half)
    return Effects(found, spread, freedom)


def interaction_with_task(one: Effects, other: Effects) -> dict[tuple[str, ...], Interval]:
    """Return each effect in the one task minus that in the other task, with intervals of the same coverage.

    The tasks' runs are independent, so the variances add. Each effect has its own unit, the residual standard deviation
    in its task, because the tasks' rewards have different units.
    """
    found = {}
    for names in one.of:
        a, b = one.of[names], other.of[names]
        half = math.hypot(a.high - a.mean, b.high - b.mean)
        found[names] = Interval(a.mean - b.mean, a.mean - b.mean - half, a.mean - b.mean + half)
    return found
