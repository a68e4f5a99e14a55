"""Best animals of the searches for eyes, trained again with new seeds, and random search for comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evolve.genome.phenotype import Phenotype
from experiments.candidates import Row
from experiments.designed import Design, Trained
from experiments.evolved import Store
from experiments.eye_factors_design import SIGMA, TASKS, in_task
from experiments.eye_search_tests import group
from experiments.eye_searches import Search, searches
from experiments.means import mean_of
from experiments.page import markdown_table
from experiments.store import rounded

__all__ = ["best", "best_table", "designs", "random_table"]

BEST = 3  # best animals of a search
NEW_SEEDS = (100, 101, 102)  # of their new training runs
BUDGETS = (48, 96, 192)  # numbers of candidates after which random search is compared


def best(store: Store, search: Search) -> list[tuple[Row, Design]]:
    """Return the fittest animals of a search, after costs, as rows and as designs without a seed of their own.

    Animals with the same eyes count once.
    """
    config = search.config
    found: dict[Design, tuple[float, Row]] = {}
    for row in _rows(store, search):
        design = _design(row)
        net = row.fitness - config.costs.total(design.animal, config.eye)
        if design not in found or net > found[design][0]:
            found[design] = net, row
    order = sorted(found, key=lambda design: -found[design][0])
    return [(found[design][1], design) for design in order[:BEST]]


def _rows(store: Store, search: Search) -> list[Row]:
    """Return the rows of the candidates of a search that did not fail."""
    return [row for row in store.group(group(search.task, search.kind)) if row.seed == search.seed and not row.failed]


def _design(row: Row) -> Design:
    """Return an animal with the eyes of a row."""
    arc = rounded(row.placement_range_deg)
    return Design("maze", row.n_eyes, row.height, row.width, arc, SIGMA, 0, rounded(row.fov_deg))


def designs(store: Store) -> list[Design]:
    """Return the training runs of the best animals of all stored searches, with the full number of training steps."""
    trained = [
        _trained(one, search, seed) for seed in NEW_SEEDS for search in searches() for _, one in best(store, search)
    ]
    return list(dict.fromkeys(trained))


def _trained(animal: Design, search: Search, seed: int) -> Design:
    """Return a training run of an animal in the layouts of its search."""
    return replace(in_task(animal, search.task, search.seed), seed=seed)


def best_table(store: Store, trained: Sequence[Trained]) -> str:
    """Return a table of the best animals of each search, with their returns after new training runs."""
    known = {row.design: row for row in trained if not row.failed}
    lines = []
    for search in searches():
        name = f"{search.task}, {search.kind}, seed {search.seed}"
        for row, animal in best(store, search):
            again = [known[one] for seed in NEW_SEEDS if (one := _trained(animal, search, seed)) in known]
            means = [
                str(mean_of(np.array(values))) for values in zip(*((r.fitness, r.held_out) for r in again), strict=True)
            ]
            lines.append([name, _eyes(animal.animal), f"{row.fitness:.3g}", *(means or ["-", "-"])])
    header = ["search", "eyes", "fitness in the search", "fitness after new training runs", "return in the test set"]
    return markdown_table(header, lines)


def _eyes(animal: Phenotype) -> str:
    height, width = animal.resolution
    over = f" over {animal.placement_range_deg:.0f}°" if animal.n_eyes > 1 else ""
    return f"{animal.n_eyes} of {height} x {width}{over}"


def random_table(store: Store) -> str:
    """Return a table of the best fitness after equal numbers of candidates in random search and in free searches."""
    lines = []
    for search in searches():
        rows = _rows(store, search)
        if search.kind == "priced" or not rows:
            continue
        so_far = [max(row.fitness for row in rows if _number(row, search) < budget) for budget in BUDGETS]
        kind = "random search" if search.kind == "random" else "CMA-ES"
        lines.append([f"{search.task}, {kind}, seed {search.seed}", *(f"{one:.3g}" for one in so_far)])
    header = ["best fitness after", *(f"{budget} candidates" for budget in BUDGETS)]
    return markdown_table(header, sorted(lines, key=lambda line: [line[0].startswith(task) for task in TASKS[::-1]]))


def _number(row: Row, search: Search) -> int:
    """Return the position of a candidate in its search, counted from 0."""
    return row.generation * search.config.search.population + row.index
