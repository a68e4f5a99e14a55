"""Null model of the searches on a page, as rows that are stored with the page's numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evolve.config.run_config import EyeConfig, RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.search.null_model import last_generations, null_model, p_value
from experiments.candidates import NO_NUMBER, Row, anatomy

__all__ = ["SEEDS", "Drift", "drifted", "of_the_end", "shade"]

SEEDS = 1000


@dataclass(frozen=True)
class Drift:
    """Distribution of a quantity under the null model, in one generation.

    The quantity is averaged over the candidates of the generation. The end of a phase has an additional row, in which
    the quantity is averaged over the final LAST generations of the phase.

    median: median over the searches
    low, high: ends of the range that contains 95 % of the searches
    ends: results of all searches, separated by spaces, only in the additional rows
    """

    group: str
    quantity: str
    generation: int
    low: float
    median: float
    high: float
    ends: str = ""

    @property
    def held(self) -> bool:
        """True if the quantity is constant because its gene is frozen."""
        return self.low == self.high

    def p(self, *values: float) -> float:
        """Return the two-sided p-value of a run's value, or of several runs' values together."""
        return p_value(values, np.array(self.ends.split(), float))

    def __str__(self) -> str:
        return f"fixed at {self.median:.3g}" if self.held else f"{self.median:.3g} [{self.low:.3g}, {self.high:.3g}]"


def drifted(
    config: RunConfig,
    group: str,
    quantities: Mapping[str, Callable[[Row], float]],
    generations: int,
    spread: Sequence[float] = (),
) -> list[Drift]:
    """Return the null model of quantities, from SEEDS searches with these settings and this number of generations.

    Quantities that need a training run are omitted.

    group: group of runs with which the null model is compared
    quantities: functions of a candidate's row, by name
    spread: see `evolve.search.null_model.null_model`
    """

    def measure(animal: Phenotype) -> dict[str, float]:
        row = _row(animal, config.eye)
        return {name: value(row) for name, value in quantities.items()}

    model, rows = null_model(config, measure, generations, SEEDS, spread=spread), []
    for name, means in model.means.items():
        if np.isfinite(means).any(axis=0).all():
            rows += [_drift(group, name, generation, means[:, generation]) for generation in range(generations)]
            for last in last_generations(config, generations):
                ends = model.ends(name, last)  # computed like `last_values`
                told = " ".join(f"{one:.6g}" for one in ends)
                rows.append(replace(_drift(group, name, last[-1], ends), ends=told))
    return rows


def of_the_end(drift: list[Drift], generation: int) -> Drift | None:
    """Return the row for the end of the phase that ends in this generation; None if no phase ends in it."""
    return next((one for one in drift if one.ends and one.generation == generation), None)


def shade(axes: Any, drift: list[Drift], color: str) -> None:
    """Shade the range of the null model over generations, unless the gene is frozen."""
    rows = [one for one in drift if not one.ends and not one.held]
    if rows:
        x, low, high = ([getattr(one, name) for one in rows] for name in ("generation", "low", "high"))
        axes.fill_between(x, low, high, color=color, alpha=0.1, lw=0)
        for edge in (low, high):  # lines at the edges distinguish the overlapping ranges of several groups
            axes.plot(x, edge, color=color, alpha=0.4, lw=0.6)


def _drift(group: str, quantity: str, generation: int, means: NDArray[np.float64]) -> Drift:
    low, median, high = (float(q) for q in np.nanquantile(means, [0.025, 0.5, 0.975]))
    return Drift(group, quantity, generation, low, median, high)


def _row(animal: Phenotype, eye: EyeConfig) -> Row:
    """Return the row of an untrained animal."""
    none: dict[str, Any] = {
        "failed": 0,
        "fitness": NO_NUMBER,
        "success_rate": NO_NUMBER,
        "episodes": 0,
        "parameters": 0,
    }
    return Row(group="", seed=0, generation=0, phase=0, index=0, **none, **anatomy(animal, eye))
