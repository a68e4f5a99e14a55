"""Difference between two groups of searches, compared with its distribution under the null model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evolve.search.null_model import SEVERAL
from experiments.candidates import Row
from experiments.evolved import Store, null_model
from experiments.means import last_values

__all__ = ["Contrast", "contrast", "holm"]


@dataclass(frozen=True)
class Contrast:
    """A difference of means over searches, and its distribution under the null model.

    value: mean of the second group minus mean of the first group
    median: median under the null model
    low, high: ends of the range that contains 95 % of the differences under the null model
    p: two-sided p-value
    """

    value: float
    median: float
    low: float
    high: float
    p: float

    def __str__(self) -> str:
        return f"{self.value:.2f} (null model: {self.median:.2f} [{self.low:.2f}, {self.high:.2f}]; p = {self.p:.2g})"


def contrast(store: Store, name: str, quantity: Callable[[Row], float], less: str, more: str) -> Contrast | None:
    """Return the difference of a quantity between two groups of searches.

    The quantity is averaged over the last generations of each search, and then over the searches of a group. Each draw
    from the null model has the same number of searches per group as there were runs. As for a single run, p is at least
    2 / (searches of the null model + 1). The result is None if the null model was not computed, or if runs of a group
    ended in different generations.

    name: name of the quantity in the stored null model
    less, more: groups; the difference is that of `more` minus that of `less`
    """
    found = {group: list(last_values(store.group(group), quantity)) for group in (less, more)}
    null = {group: null_model(store, group, name, store.group(group)) for group in found}
    together = all(len(_ends(store, group)) == 1 for group in found)
    if not all(found.values()) or not all(null.values()) or not together:
        return None
    value = {group: float(np.mean([seed.mean() for seed in found[group]])) for group in found}
    ends = {group: np.array(one.ends.split(), float) for group, one in null.items() if one is not None}
    chance = np.random.default_rng(0)
    drawn = {group: chance.choice(ends[group], (SEVERAL, len(found[group]))).mean(axis=1) for group in ends}
    return _compared(value[more] - value[less], drawn[more] - drawn[less], min(one.size for one in ends.values()))


def _compared(apart: float, random: NDArray[np.float64], searches: int) -> Contrast:
    """Return a difference and its p-value, given random differences that were drawn from this number of searches."""
    low, median, high = np.quantile(random, [0.025, 0.5, 0.975])
    p = (1 + int((np.abs(random - random.mean()) >= abs(apart - random.mean())).sum())) / (1 + random.size)
    return Contrast(apart, float(median), float(low), float(high), max(p, 2 / (1 + searches)))


def _ends(store: Store, group: str) -> set[int]:
    """Return the generations in which a group's runs ended."""
    last: dict[int, int] = {}
    for row in store.group(group):
        last[row.seed] = max(row.generation, last.get(row.seed, 0))
    return set(last.values())


def holm(ps: Sequence[float]) -> list[float]:
    """Return p-values adjusted for the number of tests (Holm 1979).

    If all tests with an adjusted p-value of at most α are called significant, the probability of one or more false
    positives is at most α.
    """
    order = sorted(range(len(ps)), key=lambda test: ps[test])
    adjusted, largest = [0.0] * len(ps), 0.0
    for rank, test in enumerate(order):
        largest = max(largest, min(1.0, (len(ps) - rank) * ps[test]))
        adjusted[test] = largest
    return adjusted
