"""Means over candidates, generations and seeds, with intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evolve.search.null_model import LAST
from experiments.candidates import Row

__all__ = ["LAST", "Interval", "interval_of", "last_mean", "last_values", "of_generation", "resampled_difference"]

Floats = NDArray[np.float64]
RESAMPLES = 4000


@dataclass(frozen=True)
class Interval:
    """A mean and its 95 % bootstrap interval."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3g} [{self.low:.3g}, {self.high:.3g}]"


def resampled_difference(of: Floats, less: Floats, resamples: int, chance: np.random.Generator) -> Floats:
    """Mean of one sample less that of another, each drawn anew with replacement, (resamples,)."""
    drawn = [one[chance.integers(one.size, size=(resamples, one.size))].mean(axis=1) for one in (less, of)]
    return np.asarray(drawn[1] - drawn[0])


def interval_of(mean: float, drawn: Floats) -> Interval:
    """95 % of what was drawn, around a mean."""
    low, high = np.quantile(drawn, [0.025, 0.975])
    return Interval(mean, float(low), float(high))


def of_generation(rows: Iterable[Row], value: Callable[[Row], float]) -> tuple[Floats, Floats]:
    """Generations, and the mean of a finite value over the candidates of each that succeeded."""
    found: dict[int, list[float]] = {}
    for row in rows:
        if not row.failed and math.isfinite(value(row)):
            found.setdefault(row.generation, []).append(value(row))
    generations = sorted(found)
    return np.array(generations, float), np.array([np.mean(found[g]) for g in generations])


def last_mean(rows: Sequence[Row], value: Callable[[Row], float], seed: int = 0) -> Interval | None:
    """Mean over the seeds of the mean over each seed's last LAST generations, with a bootstrap over seeds and, within
    each, candidates (Davison and Hinkley 1997, §3.8); None where there is no finite value.

    Few seeds make it narrow: of two, a quarter of all resamples hold one alone, whichever it is.
    """
    groups = list(last_values(rows, value))
    if not groups:
        return None
    chance, shape = np.random.default_rng(seed), (RESAMPLES, len(groups))
    # Of each seed a mean for every place that it may be drawn for: a seed drawn twice has its candidates drawn twice.
    drawn = np.stack([v[chance.integers(v.size, size=(*shape, v.size))].mean(axis=-1) for v in groups])
    means = np.take_along_axis(drawn, chance.integers(len(groups), size=(1, *shape)), axis=0)[0].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return Interval(float(np.mean([values.mean() for values in groups])), float(low), float(high))


def last_values(rows: Sequence[Row], value: Callable[[Row], float]) -> Iterator[Floats]:
    """Finite values of each seed's last generations."""
    for seed in sorted({row.seed for row in rows}):
        mine = [row for row in rows if row.seed == seed]
        first = max(row.generation for row in mine) - LAST + 1
        values = [value(row) for row in mine if row.generation >= first and not row.failed]
        finite = np.array([v for v in values if math.isfinite(v)])
        if finite.size:
            yield finite
