"""Means over candidates, generations and seeds, with intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from evolve.search.null_model import LAST
from experiments.candidates import Row

__all__ = ["LAST", "Interval", "difference", "last_mean", "last_values", "mean_of", "of_generation"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A mean and its interval, of 95 % unless stated otherwise.

    `low` and `high` are NaN for a mean without an interval.
    """

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3g}" + (f" [{self.low:.3g}, {self.high:.3g}]" if math.isfinite(self.low) else "")


def mean_of(values: Floats, confidence: float = 0.95) -> Interval:
    """Return the mean of independent values with Student's interval; a single value has no interval."""
    n = values.size
    half = t.ppf((1 + confidence) / 2, n - 1) * values.std(ddof=1) / math.sqrt(n) if n > 1 else math.nan
    return Interval(float(values.mean()), float(values.mean() - half), float(values.mean() + half))


def difference(of: Floats, less: Floats) -> Interval:
    """Return the difference of two samples' means with Welch's 95 % interval for unequal variances (Welch 1947).

    Raises:
        ValueError: a sample has fewer than two values.
    """
    if min(of.size, less.size) < 2:
        raise ValueError("an interval of a difference needs at least two values in each sample")
    mean = float(of.mean() - less.mean())
    parts = [one.var(ddof=1) / one.size for one in (of, less)]
    variance = sum(parts)
    if variance == 0:
        return Interval(mean, mean, mean)
    freedom = variance**2 / sum(part**2 / (one.size - 1) for part, one in zip(parts, (of, less), strict=True))
    half = t.ppf(0.975, freedom) * math.sqrt(variance)
    return Interval(mean, float(mean - half), float(mean + half))


def of_generation(rows: Iterable[Row], value: Callable[[Row], float]) -> tuple[Floats, Floats]:
    """Return the generations, and the mean of a quantity over the candidates of each generation, (generation,) each.

    Failed candidates and values that are not finite are ignored.
    """
    found: dict[int, list[float]] = {}
    for row in rows:
        if not row.failed and math.isfinite(value(row)):
            found.setdefault(row.generation, []).append(value(row))
    generations = sorted(found)
    return np.array(generations, float), np.array([np.mean(found[g]) for g in generations])


def last_mean(rows: Sequence[Row], value: Callable[[Row], float]) -> Interval | None:
    """Return the mean of a quantity at the end of runs; None without finite values.

    The quantity is averaged over the last LAST generations of each seed, and then over the seeds.

    The interval is Student's over the seeds. Candidates of one search descend from one another and are not independent,
    so each seed counts once.
    """
    means = [values.mean() for values in last_values(rows, value)]
    return mean_of(np.array(means)) if means else None


def last_values(rows: Sequence[Row], value: Callable[[Row], float]) -> Iterator[Floats]:
    """Yield, for each seed, the finite values of a quantity in its last LAST generations."""
    for seed in sorted({row.seed for row in rows}):
        mine = [row for row in rows if row.seed == seed]
        first = max(row.generation for row in mine) - LAST + 1
        values = [value(row) for row in mine if row.generation >= first and not row.failed]
        finite = np.array([v for v in values if math.isfinite(v)])
        if finite.size:
            yield finite
