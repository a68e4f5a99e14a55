"""Evolved facets: the eye parameter of compound eyes that evolve in bright and in dim light

python -m experiments.evolved_facets [--records DIR] [--answer TEXT] [--docs DIR]

DIR holds the records of experiments.facet_searches. The test is computed for the largest number of complete pairs for
which docs/results/evolved_facets_plan.md plans a test. Later pairs are ignored.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import optics
from evolve.store.directory import Run
from experiments.candidates import Row
from experiments.contrast import Contrast, contrast
from experiments.drift import SEEDS, shade
from experiments.evolved import Store, collect, conduct_table, stored
from experiments.facet_searches import FIRST_SEEDS, LIGHTS, LOOKS, searches
from experiments.means import LAST, last_values, of_generation
from experiments.page import Figure, Page, exit_code, markdown_table, new_figure, parser, save
from experiments.planned_searches import finished_run
from experiments.store import RECORDS, write_answer

__all__ = ["LEVEL", "PRIMARY", "QUANTITIES", "compared", "complete_pairs", "main", "outcome", "page"]

NAME = "evolved_facets"
BRIGHT, DIM = LIGHTS
WAVELENGTH = 500e-9  # unit of eye parameters [m]
LEVEL = 0.0221  # of each test, so that all three together have a level of 0.05 (Pocock 1977, table 1)
PRIMARY = "ln(p / λ)"
COLORS = {BRIGHT: "#E69F00", DIM: "#0072B2"}
TICKS = (0.75, 1, 1.5, 2, 3, 4, 6)  # eye parameters


def spacing_deg(row: Row) -> float:
    """Return the interommatidial angle [deg]."""
    return row.fov_deg / row.width


def eye_parameter(row: Row) -> float:
    """Return Snyder's eye parameter in units of WAVELENGTH."""
    return float(optics.eye_parameter(1e-6 * row.facet_diameter_um, spacing_deg(row))) / WAVELENGTH


QUANTITIES: dict[str, Callable[[Row], float]] = {
    PRIMARY: lambda row: math.log(eye_parameter(row)),
    "ln(D / µm)": lambda row: math.log(row.facet_diameter_um),
    "ln(Δφ / °)": lambda row: math.log(spacing_deg(row)),
    "ln(ommatidia of an eye)": lambda row: math.log(row.height * row.width),
    "ln(rhabdom / µm)": lambda row: math.log(row.rhabdom_diameter_um),
}


def complete_pairs(folder: Path) -> list[tuple[str, Run]]:
    """Return the records of the first complete pairs of searches, each with the name of its group.

    The number of pairs is the largest number in LOOKS for which all pairs are complete.

    Raises:
        ValueError: a record has other settings than the plan, or too few pairs are complete.
        RunError: a record is damaged.
    """
    runs = [(one.name, finished_run(folder, one)) for one in searches()]
    missing = next((i for i, (_, run) in enumerate(runs) if run is None), len(runs))
    complete = missing // len(LIGHTS)
    if complete < LOOKS[0]:
        raise ValueError(
            f"{folder}: {runs[missing][0]} is missing or unfinished; complete pairs of searches: {complete}, "
            f"must be at least {LOOKS[0]}"
        )
    used = len(LIGHTS) * max(look for look in LOOKS if look <= complete)
    groups = [light for _ in range(max(LOOKS)) for light in LIGHTS]
    return [(group, run) for group, (_, run) in zip(groups, runs[:used], strict=False) if run is not None]


def compared(store: Store, look: int, name: str = PRIMARY) -> Contrast | None:
    """Return a quantity in dim light minus that in bright light, over the first `look` pairs of searches."""
    rows = [row for row in store.rows if row.seed - FIRST_SEEDS[row.group] < look]
    return contrast(replace(store, rows=rows), name, QUANTITIES[name], less=BRIGHT, more=DIM)


def looks(store: Store) -> list[tuple[int, Contrast]]:
    """Return the planned tests up to the first significant one, each with its number of pairs."""
    pairs = min(len({row.seed for row in store.group(light)}) for light in LIGHTS)
    tests: list[tuple[int, Contrast]] = []
    for look in LOOKS:
        test = compared(store, look) if look <= pairs else None
        if test is not None:
            tests.append((look, test))
            if test.p <= LEVEL:
                break
    return tests


def outcome(store: Store) -> str:
    """Return the conclusion by the rules of the plan."""
    tests = looks(store)
    if tests and tests[-1][1].p <= LEVEL:
        return "larger in dim light" if tests[-1][1].value > 0 else "smaller in dim light"
    return "no difference found" if len(tests) == len(LOOKS) else "open"


def page(store: Store) -> Page:
    """Return the page of results, made from stored searches."""
    tests = looks(store)
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --records {RECORDS.parent.name}/{RECORDS.name}",
        values={
            "answer": store.answer,
            "outcome": outcome(store),
            "tests": _tests_table(tests),
            "pairs": str(tests[-1][0]) if tests else "0",
            "searches": _searches_table(store),
            "others": _others_table(store, tests[-1][0] if tests else 0),
            "runs": conduct_table(store),
            "failed": str(sum(row.failed for row in store.rows)),
            "candidates": str(len(store.rows)),
            "last": str(LAST),
            "level": f"{LEVEL:g}",
            "random": f"{SEEDS:,}",
        },
        figures=[Figure(NAME, lambda path: draw(store, path))],
        origin=store.origin,
    )


def _tests_table(tests: Sequence[tuple[int, Contrast]]) -> str:
    lines = [
        [str(look), f"{test.value:.2f}", f"{math.exp(test.value):.2f}", f"[{test.low:.2f}, {test.high:.2f}]",
         f"{test.p:.2g}"]
        for look, test in tests
    ]  # fmt: skip
    return markdown_table(["pairs", "dim - bright, ln p", "ratio of p", "null model, ln p", "p-value"], lines)


def _searches_table(store: Store) -> str:
    """Return a table of the eye parameter at the end of each search (geometric mean)."""
    found = {light: list(last_values(store.group(light), QUANTITIES[PRIMARY])) for light in LIGHTS}
    lines = [
        [str(pair + 1), *(f"{math.exp(values.mean()):.2f}" for values in both)]
        for pair, both in enumerate(zip(*found.values(), strict=True))
    ]
    return markdown_table(["pair", *(f"p in {light} light [λ]" for light in LIGHTS)], lines)


def _others_table(store: Store, look: int) -> str:
    """Return a table of the other quantities, whose tests are exploratory."""
    lines = []
    for name in QUANTITIES:
        test = compared(store, look, name)
        if name != PRIMARY and test is not None:
            lines.append([name, f"{test.value:.2f}", f"[{test.low:.2f}, {test.high:.2f}]", f"{test.p:.2g}"])
    return markdown_table(["quantity", "dim - bright", "null model", "p-value"], lines)


def draw(store: Store, path: Path) -> None:
    """Draw the eye parameter over the generations of each search, and the fitness of all animals over it."""
    figure, axes = new_figure(10.5, 4.2, columns=2)
    left, right = axes[0]
    shade(left, store.drift_of(BRIGHT, PRIMARY), "#777777")  # equal in both lights, apart from chance
    for light, color in COLORS.items():
        rows = store.group(light)
        for seed in sorted({row.seed for row in rows}):
            label = f"{LIGHTS[light]:,g} lx" if seed == FIRST_SEEDS[light] else None
            of_seed = [row for row in rows if row.seed == seed]
            left.plot(*of_generation(of_seed, QUANTITIES[PRIMARY]), color=color, lw=1.4, label=label)
        trained = [row for row in rows if not row.failed]
        points = [(QUANTITIES[PRIMARY](row), row.fitness) for row in trained]
        right.plot(*np.transpose(points), "o", color=color, ms=3.5, alpha=0.5, mec="none")
    left.set(xlabel="generation", ylabel="eye parameter DΔφ / λ")
    left.set_xticks(range(1 + max(row.generation for row in store.rows)))
    left.set_yticks(np.log(TICKS), labels=[f"{tick:g}" for tick in TICKS])
    left.legend(frameon=False, title="light")
    right.set(xlabel="eye parameter DΔφ / λ", ylabel="fitness")
    right.set_xticks(np.log(TICKS), labels=[f"{tick:g}" for tick in TICKS])
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect the complete pairs of searches if requested; make the page from stored rows."""
    options = parser(__doc__ or "")
    options.add_argument("--records", type=Path, metavar="DIR", help="collect the complete pairs of searches in DIR")
    options.add_argument("--answer", help="answer on the page, in Markdown; stored until the numbers change")
    chosen = options.parse_args(arguments)
    return exit_code(NAME, lambda: _made(chosen))


def _made(chosen: Namespace) -> None:
    stem = chosen.docs / "data" / NAME
    if chosen.records:
        collect(complete_pairs(chosen.records), stem, QUANTITIES)
    if chosen.answer:
        write_answer(stem, chosen.answer)
    page(stored(stem)).publish(chosen.docs)


if __name__ == "__main__":
    sys.exit(main())
