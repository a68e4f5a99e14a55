"""Searches for eyes in mazes and in detection, as preregistered in docs/results/eye_searches_plan.md

python -m experiments.eye_searches --list
python -m experiments.eye_searches DIR [--workers N]

DIR holds the runs, each in its own folder. The second command continues unfinished runs and starts missing ones, one
after another, until all are complete. It can be interrupted at any time and called again.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

from evolve.config.run_config import RunConfig
from experiments import planned_searches
from experiments.eye_factors_design import LEARNER, TASKS
from experiments.planned_searches import PlannedSearch

__all__ = ["KINDS", "PRICES", "SEEDS", "Search", "main", "searches"]

SEEDS = (20, 21, 22)  # their layouts are in no other experiment
KINDS = ("free", "priced", "random")
PRICES = ("costs.per_receptor=0.01", "costs.per_eye=2")
PRESET = "bifurcation-detection"  # for both tasks, so that the genomes are equal
# Square eyes, 45° high and wide; 16 candidates in each of 12 generations. The training runs are the first 106,496 steps
# of those in the experiment on factors of eyes, with one evaluation at the end (docs/results/training_length.md).
LENGTH = {"learning.total_steps": 105_000, "learning.eval_interval": 105_000}
SETTINGS = (
    *("eye.square=true", "eye.noise_sigma=0.01", "search.population=16", "search.generations=12"),
    *("search.active=false", *(one for one in LEARNER if one.partition("=")[0] not in LENGTH)),
    *(f"{name}={value}" for name, value in LENGTH.items()),
)


@dataclass(frozen=True)
class Search:
    """A search of the plan.

    kind: "free" (no costs), "priced" (receptors and eyes have prices) or "random" (random search without costs:
        genomes from a Latin hypercube, uniform over the range of each gene)
    """

    task: str
    kind: str
    seed: int

    @property
    def name(self) -> str:
        return f"eyes-105k-{self.kind}-{self.task}-{self.seed}"

    @property
    def assignments(self) -> tuple[str, ...]:
        """Settings that differ from the preset's. Each seed of navigators has its own family of mazes."""
        layouts = (f"world.layouts=family world.family_seed={self.seed}",) if self.task == "maze" else ()
        own = {"free": (), "priced": PRICES, "random": ("search.optimizer=LHSSearch",)}[self.kind]
        return (*SETTINGS, *" ".join(layouts).split(), *own, f"seed={self.seed}")

    @property
    def planned(self) -> PlannedSearch:
        """Name, preset and settings of the search."""
        return PlannedSearch(self.name, self.task, PRESET, self.assignments)

    @property
    def config(self) -> RunConfig:
        """Settings of the run."""
        return self.planned.config


def searches() -> list[Search]:
    """Return all searches in the order in which they run: one kind after the other, both tasks of each seed."""
    seeds = {kind: SEEDS[:1] if kind == "random" else SEEDS for kind in KINDS}
    return [Search(task, kind, seed) for kind in KINDS for seed in seeds[kind] for task in TASKS]


def main(arguments: Sequence[str] | None = None) -> int:
    """List the searches, or carry them out."""
    return planned_searches.main(__doc__ or "", [one.planned for one in searches()], arguments)


if __name__ == "__main__":
    sys.exit(main())
