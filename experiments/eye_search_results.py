"""Results of the searches for eyes in mazes and in detection, from their records

python -m experiments.eye_search_results [--records DIR] [--seeds N ...] [--compute] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from experiments.designed import Trained, train_all
from experiments.drift import SEEDS as RANDOM_SEARCHES
from experiments.drift import shade
from experiments.evolved import Store, collect, conduct_table, stored
from experiments.eye_factors_design import LEARNER, TASKS
from experiments.eye_search_best import best_table, designs, random_table
from experiments.eye_search_records import complete_groups
from experiments.eye_search_tests import (
    CLAIMS,
    COMPARED,
    LEVEL,
    TESTED,
    adjusted,
    compared,
    exploratory,
    group,
    outcome,
    seeds,
)
from experiments.eye_searches import SEEDS
from experiments.means import LAST, last_mean, of_generation
from experiments.page import Figure, Page, exit_code, markdown_table, new_figure, parser, save
from experiments.store import RECORDS, read_rows, write_answer

__all__ = ["main", "page"]

NAME = "eye_searches"
SHADED = {"maze": "#D55E00", "detection": "#0072B2"}
STYLES = {"free": "-", "priced": "--"}


def page(store: Store, trained: Sequence[Trained]) -> Page:
    """Return the page of results, made from stored searches and from the new training runs of their best animals."""
    return Page(
        name=NAME,
        command=f"python -m experiments.eye_search_results --records {RECORDS.name} --compute",
        values={
            "answer": store.answer,
            "outcome": outcome(store),
            "tests": tests_table(store),
            "claims": claims_table(store),
            "means": means_table(store),
            "random": random_table(store),
            "best": best_table(store, trained),
            "runs": conduct_table(store),
            "failed": str(sum(row.failed for row in store.rows)),
            "candidates": f"{len(store.rows):,}",
            "last": str(LAST),
            "level": f"{LEVEL:g}",
            "searches": f"{RANDOM_SEARCHES:,}",
        },
        figures=[Figure(NAME, lambda path: draw(store, path))],
        origin=store.origin,
    )


def tests_table(store: Store) -> str:
    """Return a table of the two planned tests."""
    ps, lines = adjusted(store), []
    for kind in TESTED:
        found = compared(store, kind)
        shown = "not computed" if found is None else str(found)
        lines.append([kind, seeds(store, kind), shown, "-" if found is None else f"{ps[kind]:.2g}"])
    return markdown_table(["group", "complete searches", "detection - maze", "adjusted p"], lines)


def claims_table(store: Store) -> str:
    """Return a table of the exploratory tests."""
    lines = []
    for claim in CLAIMS:
        for kind in TESTED:
            found = exploratory(store, claim, kind)
            if found is not None:
                numbers = (f"{one:.3g}" for one in (found.value, found.median))
                lines.append([claim.text, kind, *numbers, f"{found.p:.2g}", found.state])
    return markdown_table(["claim", "group", "mean", "null model", "p", "state"], lines)


def means_table(store: Store) -> str:
    """Return a table of means over the last generations, for each search and for each group."""
    lines = []
    for name in store.groups:
        rows = store.group(name)
        parts = {
            f"seed {seed}": [row for row in rows if row.seed == seed] for seed in sorted({row.seed for row in rows})
        }
        for label, part in (parts | {"all seeds": rows}).items():
            found = [last_mean(part, value) for value in COMPARED.values()]
            lines.append([f"{name}, {label}", *("-" if one is None else str(one) for one in found)])
    return markdown_table([f"mean of the last {LAST} generations", *COMPARED], lines)


def draw(store: Store, path: Path) -> None:
    """Draw each quantity over the generations, with a line per search and the range of the null model."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    figure, axes = new_figure(11, 6.5, columns=2, rows=2, sharex=True)
    for place, (name, value) in zip(axes.flat, COMPARED.items(), strict=True):
        for task in TASKS:
            for kind in TESTED:
                rows = store.group(group(task, kind))
                shade(place, store.drift_of(group(task, kind), name), SHADED[task])
                for seed in sorted({row.seed for row in rows}):
                    of_seed = of_generation([row for row in rows if row.seed == seed], value)
                    place.plot(*of_seed, color=SHADED[task], ls=STYLES[kind], lw=1.2)
        place.set_title(name, fontsize=10)
    for place in axes[-1]:
        place.set_xlabel("generation")
    lines = [
        Line2D([], [], color=SHADED[task], ls=STYLES[kind], label=group(task, kind))
        for task in TASKS
        for kind in TESTED
    ]
    figure.legend(
        handles=[*lines, Patch(color="#777777", alpha=0.25, label="null model: random fitness")],
        loc="outside lower center", ncols=5, frameon=False,
    )  # fmt: skip
    figure.suptitle(f"Eyes that evolve in mazes and in detection: difference {outcome(store)}")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect complete groups of records and train their best animals if requested; make the page from stored rows."""
    options = parser(__doc__ or "")
    options.add_argument("--records", type=Path, metavar="DIR", help="collect the complete groups of searches in DIR")
    options.add_argument(
        "--seeds", type=int, nargs="+", default=SEEDS, metavar="N", help="seeds of the searches in DIR"
    )
    options.add_argument("--compute", action="store_true", help="train the best animals that the stored numbers lack")
    options.add_argument("--workers", type=int, default=0, help="processes; 0: one per core")
    options.add_argument("--answer", help="answer on the page, in Markdown; stored until the numbers change")
    chosen = options.parse_args(arguments)
    return exit_code(NAME, lambda: _made(chosen))


def _made(chosen: Namespace) -> None:
    stem = chosen.docs / "data" / NAME
    if chosen.records:
        found = [
            (group(search.task, search.kind), run) for search, run in complete_groups(chosen.records, chosen.seeds)
        ]
        collect(found, stem, COMPARED, [group(task, kind) for task in TASKS for kind in TESTED])
    if chosen.answer:
        write_answer(stem, chosen.answer)
    store = stored(stem)
    again = stem.with_name(f"{NAME}_best.csv")
    if chosen.compute:
        train_all(designs(store), LEARNER, again, chosen.workers, tested=True)
    page(store, read_rows(Trained, again)).publish(chosen.docs)


if __name__ == "__main__":
    sys.exit(main())
