"""Searches for eyes in mazes and in detection, as preregistered in docs/results/eye_searches_plan.md

python -m experiments.eye_searches --list
python -m experiments.eye_searches DIR [--workers N]

DIR holds the runs, each in its own folder. The second command continues unfinished runs and starts missing ones, one
after another, until all are complete. It can be interrupted at any time and called again.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evolve.cli.main import main as evolve
from evolve.config.assemble import assemble
from evolve.config.run_config import RunConfig
from experiments.eye_factors_design import LEARNER, TASKS

__all__ = ["KINDS", "PRICES", "SEEDS", "Search", "command", "main", "searches"]

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
    def config(self) -> RunConfig:
        """Settings of the run."""
        return assemble(self.task, PRESET, assignments=self.assignments)


def searches() -> list[Search]:
    """Return all searches in the order in which they run: one kind after the other, both tasks of each seed."""
    seeds = {kind: SEEDS[:1] if kind == "random" else SEEDS for kind in KINDS}
    return [Search(task, kind, seed) for kind in KINDS for seed in seeds[kind] for task in TASKS]


def command(search: Search, folder: Path, workers: int) -> list[str]:
    """Return the arguments of `evolve` that start a search, or continue it if its run directory exists."""
    out = folder / search.name
    if out.exists():
        return ["resume", str(out)]
    settings = (*search.assignments, f"workers={workers}")
    pairs = (part for text in settings for part in ("--set", text))
    return ["run", search.task, "--preset", PRESET, *pairs, "--out", str(out)]


def main(arguments: Sequence[str] | None = None) -> int:
    """List the searches, or carry them out."""
    lines = (__doc__ or "").split("\n")
    options = ArgumentParser(
        description=lines[0], epilog="\n".join(lines[2:]), formatter_class=RawDescriptionHelpFormatter
    )
    options.add_argument("folder", metavar="DIR", type=Path, nargs="?", help="directory of the runs")
    options.add_argument("--list", action="store_true", help="print the commands that start the searches, then stop")
    options.add_argument("--workers", type=int, default=1, help="processes of a new run (default: 1)")
    chosen = options.parse_args(arguments)
    if chosen.list:
        for one in searches():
            print("evolve", *command(one, Path("runs"), chosen.workers))
        return 0
    if chosen.folder is None:
        options.error("DIR: missing; name the directory of the runs, or use --list")
    for one in searches():
        code = evolve(command(one, chosen.folder, chosen.workers))
        if code:
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
