"""Test for selection: final gene values of runs are compared with those of searches whose fitness is random.

If the values of the runs are within the range of the values of the random searches, the genes may have changed by
chance (drift). If eyes and brain have costs in the runs, the random searches subtract the same costs from a random task
fitness (`evolve.search.null_model`). The test then shows selection by the task, and not by the costs.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import takewhile
from typing import Any

import numpy as np

from evolve.analysis.acuity import acuity_cpd, acuity_vertical_cpd
from evolve.analysis.statistics import gene_values, succeeded
from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.report.comparison import differing_settings
from evolve.search import successive_halving
from evolve.search.null_model import fitness_spread, last_generations, null_model, p_value
from evolve.store.directory import Run, RunError

__all__ = ["Drift", "QuantityDrift", "drift_of"]

SEARCHES, MOST_SEARCHES = 200, 100_000  # default and maximum number of searches with random fitness
ALLOWED_TO_DIFFER = ("seed", "workers")  # settings in which the runs of a comparison may differ


@dataclass(frozen=True)
class QuantityDrift:
    """One quantity at the end of runs and at the end of searches with random fitness.

    The value of a run or a search is a mean over its candidates.

    quantity: name of the quantity
    runs: value of each run
    low, median, high: quantiles of the values of the searches; 95 % of the values lie between low and high
    p: two-sided p-value of the mean of the runs, see `evolve.search.null_model.p_value`
    """

    quantity: str
    runs: tuple[float, ...]
    low: float
    median: float
    high: float
    p: float

    @property
    def mean(self) -> float:
        return float(np.mean(self.runs))


@dataclass(frozen=True)
class Drift:
    """Comparison of the animals of runs with the animals of searches whose fitness is random.

    Each compared quantity, such as a gene, has one value per run and one per search: its mean over the candidates of
    the last generations.

    of: number of runs
    generations: these last generations, counted from 0
    searches: number of searches with random fitness
    moved: the quantities, each with its values in the runs and a summary of its values in the searches
    costs: True if the searches subtract the costs of eyes and brain from a random task fitness
    """

    of: int
    generations: range
    searches: int
    moved: tuple[QuantityDrift, ...]
    costs: bool = False

    @property
    def random(self) -> str:
        """Name of the quantity that the searches maximise: "fitness" or "task fitness minus costs".

        "fitness" is a random number. If there are costs, only the task fitness is random.
        """
        return "task fitness minus costs" if self.costs else "fitness"

    def as_plain_values(self) -> dict[str, Any]:
        """Return this comparison of runs with searches whose fitness is random, as JSON values."""
        first, last = self.generations[0], self.generations[-1]
        moved = [asdict(one) for one in self.moved]
        return {"generations": [first, last], "searches": self.searches, "random": self.random, "moved": moved}

    def lines(self) -> list[str]:
        """Return the comparison as the lines of a table, followed by two notes.

        A row compares the values of one quantity in the runs and in the searches with random fitness.
        """
        rows = [("", "run" if self.of == 1 else f"mean of {self.of} runs", "null model", "95 % of its searches", "p")]
        for one in self.moved:
            numbers = (f"{one.mean:.4g}", f"{one.median:.4g}", f"{one.low:.4g} to {one.high:.4g}", f"{one.p:.2g}")
            rows.append((one.quantity, *numbers))
        widths = [max(len(row[place]) for row in rows) for place in range(len(rows[0]))]
        table = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        first, last = self.generations[0], self.generations[-1]
        return [
            *table,
            f"Means over candidates of generations {first} to {last}; null model: {self.searches} searches with random "
            f"{self.random}.",
            f"p is two-sided and at least {2 / (self.searches + 1):.2g}; by chance alone it is below 0.05 in one of "
            "twenty rows.",
        ]


def drift_of(runs: Sequence[Run], searches: int = SEARCHES, done: Callable[[float], None] = lambda _: None) -> Drift:
    """Compare the animals of runs with the animals of searches whose fitness is random (`evolve.search.null_model`).

    The runs may differ only in seeds and numbers of workers. The compared quantities are the genes that the search
    varies, the horizontal and vertical acuity [cycles/degree], and the number of receptor positions in all eyes. The
    vertical acuity is omitted if the setting `eye.vertical_fov` is "receptors". Quantities that do not vary between the
    searches, or that at least one run lacks, are omitted as well. The value of a quantity is its mean over the last 3
    generations that all runs have completed. If a gene began to vary in the second or third of these generations, the
    mean is only over the generations from then on.

    searches: number of searches
    done: function that is called with the completed fraction of the searches

    Raises:
        RunError: the runs differ in other settings than seed and number of workers, two runs have the same seed, or a
            run has no complete generation.
        ValueError: there are fewer than two searches, or more than 100,000.
    """
    if not 2 <= searches <= MOST_SEARCHES:
        raise ValueError(f"searches = {searches}: must be from 2 to {MOST_SEARCHES:,}")
    _require_alike(runs)
    config, generations = runs[0].config, min(_complete(run) for run in runs)
    spread = fitness_spread(runs, generations)
    model = null_model(config, lambda animal: _measured(animal, config), generations, searches, done, spread)
    last, moved = last_generations(config, generations)[-1], []
    run_ends = [_ends(run, last) for run in runs]
    for quantity in model.means:
        found, ends = [end[quantity] for end in run_ends], model.ends(quantity, last)
        if all(map(math.isfinite, found)) and ends.size and np.ptp(ends) > 0:
            low, median, high = (float(q) for q in np.quantile(ends, [0.025, 0.5, 0.975]))
            moved.append(QuantityDrift(quantity, tuple(found), low, median, high, p_value(found, ends)))
    return Drift(len(runs), last, searches, tuple(moved), not config.costs.free)


def _require_alike(runs: Sequence[Run]) -> None:
    """Check that runs differ in their seeds, and in no other setting but the number of workers.

    Raises:
        RunError: the runs differ in other settings, or two of them have the same seed.
    """
    differing = set(differing_settings(runs)) - set(ALLOWED_TO_DIFFER)
    if differing:
        raise RunError(
            f"{runs[0].path} and others differ in {', '.join(sorted(differing))}: runs in one comparison may differ "
            "only in their seeds"
        )
    seeds = [run.config.seed for run in runs]
    if twice := [seed for seed in seeds if seeds.count(seed) > 1]:
        raise RunError(f"two of these runs have seed {twice[0]}: they are the same search, and count as one")


def _complete(run: Run) -> int:
    """Return the number of generations that are complete, counted from the start of the run.

    Raises:
        RunError: no generation is complete.
    """
    known = (successive_halving.complete(run, generation) for generation in range(run.config.search.generations))
    done = sum(takewhile(bool, known))
    if not done:
        raise RunError(f"{run.path}: no generation is complete yet")
    return done


def _measured(animal: Phenotype, config: RunConfig) -> Mapping[str, float]:
    height, width = animal.resolution
    genes = {name: value for name, value in gene_values(animal, config.eye).items() if _open(name, config)}
    upwards = {} if config.eye.vertical_fov == "receptors" else {"acuity_vertical_cpd": acuity_vertical_cpd(animal)}
    return {**genes, "acuity_cpd": acuity_cpd(animal), **upwards, "receptors": float(animal.n_eyes * height * width)}


def _open(name: str, config: RunConfig) -> bool:
    return name in config.genome and config.genome[name].open


def _ends(run: Run, generations: range) -> dict[str, float]:
    """Return the mean of each quantity that `drift_of` compares over the successful candidates of these generations.

    The mean is NaN for a quantity that no candidate has.
    """
    values: dict[str, list[float]] = defaultdict(list)
    for candidate in run.candidates:
        if candidate.generation in generations and succeeded(candidate):
            for quantity, value in _measured(candidate.phenotype, run.config).items():
                values[quantity].append(value)
    finite = {quantity: [value for value in found if math.isfinite(value)] for quantity, found in values.items()}
    means = {quantity: float(np.mean(found)) for quantity, found in finite.items() if found}
    return defaultdict(lambda: math.nan, means)
