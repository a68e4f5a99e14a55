"""Estimates of the experiment on factors of eyes: effects of factors, and differences between two kinds of animals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.designed import Trained
from experiments.eye_factors_design import FACTORS, Control, factorial, runs_of
from experiments.factorial import Effects, effects
from experiments.means import Interval, mean_of

__all__ = ["advantage", "differences", "effects_in", "in_units", "spread_of_layouts"]


def effects_in(rows: Sequence[Trained], task: str, confidence: float = 0.95) -> Effects | None:
    """Return the effects of the factors on the return in a task's test set; None if there are too few training runs."""
    mine = [row for cell in factorial() for row in runs_of(rows, task, cell)]
    levels = {name: [2 * high.index(getattr(row, name)) - 1 for row in mine] for name, high in FACTORS.items()}
    try:
        return effects(levels, [row.seed for row in mine], np.array([row.held_out for row in mine]), confidence)
    except ValueError:
        return None


def advantage(rows: Sequence[Trained], task: str, control: Control, confidence: float = 0.95) -> Interval | None:
    """Return the mean return of many coarse eyes minus that of few fine ones; None with fewer than two pairs."""
    pairs = differences(rows, task, control)
    return mean_of(pairs, confidence) if pairs.size > 1 else None


def differences(rows: Sequence[Trained], task: str, control: Control) -> NDArray[np.float64]:
    """Return the return of many coarse eyes minus that of few fine ones in each pair of training runs, (pair,).

    Runs with the same seed have the same layouts. They form pairs, so that differences between layouts cancel.
    """
    many, few = ({row.seed: row.held_out for row in runs_of(rows, task, one)} for one in (control.many, control.few))
    return np.array([many[seed] - few[seed] for seed in sorted(many.keys() & few.keys())])


def spread_of_layouts(rows: Sequence[Trained], task: str) -> float:
    """Return the standard deviation of the return between seeds, and thus between sets of layouts.

    The variance of the seeds' means over the factorial design is corrected for the part that training runs contribute.
    """
    of_cells = [{row.seed: row.held_out for row in runs_of(rows, task, cell)} for cell in factorial()]
    seeds = set.intersection(*(set(one) for one in of_cells))
    table = np.array([[one[seed] for seed in sorted(seeds)] for one in of_cells])
    means = table.mean(axis=0)
    rest = table - table.mean(axis=1, keepdims=True) - means + table.mean()
    of_training = (rest**2).sum() / (rest.size - sum(rest.shape) + 1)
    return math.sqrt(max(float(means.var(ddof=1) - of_training / len(table)), 0.0))


def in_units(interval: Interval, unit: float) -> Interval:
    """Return an interval in multiples of a unit."""
    return Interval(interval.mean / unit, interval.low / unit, interval.high / unit)
