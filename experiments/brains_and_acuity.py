"""Brains and acuity: error against what eyes resolve and brains hold

python -m experiments.brains_and_acuity [--runs TASK=DIR ...] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from experiments import evolved
from experiments.candidates import Row
from experiments.evolved import Store, conduct_table
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.powers import PowerLaw, power_law

__all__ = ["error", "factors", "fitted", "page"]

NAME = "brains_and_acuity"
COLORS = {"navigation": "#D55E00", "detection": "#0072B2", "tracking": "#009E73"}
PUBLISHED = {"navigation": 0.69, "detection": 0.74, "tracking": 0.59}
CLASSES = 4  # of acuity
Size = Callable[[Row], float]
FACTORS: dict[str, Size] = {
    "acuity": lambda row: row.cpd,
    "parameters": lambda row: row.parameters,
    "memory": lambda row: row.memory_frames,
}


def error(row: Row) -> float:
    """Share of episodes in which the goal did not come first, (k + 1/2) / (n + 1), so that no error has no logarithm
    (Jeffreys' mean). In a maze, whose goal nobody reaches: the share of a full return that was missed."""
    if math.isfinite(row.full_return):
        return 1 - row.fitness / row.full_return
    return ((1 - row.success_rate) * row.episodes + 0.5) / (row.episodes + 1)


def size(row: Row) -> float:
    """Acuity x parameters x memory [cycles/degree · frames]."""
    return row.cpd * row.parameters * row.memory_frames


def fitted(rows: Sequence[Row], *sizes: Size) -> PowerLaw | None:
    """The power law of candidates' errors; None where there is none."""
    try:
        return power_law(np.array([error(row) for row in rows]), *(np.array([f(row) for row in rows]) for f in sizes))
    except ValueError:
        return None


def trained(store: Store, group: str) -> list[Row]:
    """Candidates that have a policy."""
    return [row for row in store.group(group) if not row.failed and row.parameters]


def page(store: Store) -> Page:
    """The page of stored runs."""
    return Page(
        name=NAME,
        title="Brains and acuity",
        question=(
            "How does error fall with acuity, parameters and memory? Published: as a power of their product, with "
            "exponents 0.69 for navigation, 0.74 for detection, 0.59 for tracking, and with ceilings for each acuity."
        ),
        answer=store.answer,
        method=(
            "Candidates are spread evenly over receptors, memory and neurons, each trained once from its own seed. "
            "Error: the share of evaluation episodes in which the goal did not come first; in navigation, where within "
            "such budgets it is never reached, the share that is missing of what a straight way to it without any "
            "contact would return. Power laws by least "
            "squares in logarithms, of the product and of its three factors each; 95 % intervals by a bootstrap over "
            "candidates. Parameters are all of a policy's, "
            "critic included. The best of an acuity is the mean of its best quarter, "
            "chosen by the same episodes and so told a little too good."
        ),
        command=(
            "evolve run --preset scaling\n"
            "evolve run tracking --preset scaling\n"
            "evolve run navigation --preset scaling\n"
            "python -m experiments.brains_and_acuity --runs detection=DIR navigation=DIR tracking=DIR"
        ),
        figures=[Figure(NAME, lambda path: draw(store, path), "Each dot is a candidate, darker for finer acuity.")],
        tables=[exponents(store), factors(store), ceilings(store), conduct_table(store)],
        origin=store.origin,
    )


def exponents(store: Store) -> str:
    """A row per task."""
    lines = []
    for group in store.groups:
        rows = trained(store, group)
        law, published = fitted(rows, size), f"{PUBLISHED[group]:g}" if group in PUBLISHED else "-"
        exponent, explained = ("-", "-") if law is None else (str(law.exponents[0]), f"{law.explained:.2f}")
        lines.append([group, str(len(rows)), exponent, published, explained])
    return markdown_table(["task", "candidates", "exponent", "published", "variance explained"], lines)


def factors(store: Store) -> str:
    """Exponents of each factor on its own, fitted together: a row per task."""
    header = ["task", *(f"exponent of {name}" for name in FACTORS), "variance explained"]
    lines = []
    for group in store.groups:
        law = fitted(trained(store, group), *FACTORS.values())
        found = ["-"] * (len(FACTORS) + 1)
        if law is not None:
            found = [*map(str, law.exponents), f"{law.explained:.2f}"]
        lines.append([group, *found])
    return markdown_table(header, lines)


def ceilings(store: Store) -> str:
    """Mean error and that of the best quarter, by class of acuity."""
    lines = []
    for group in store.groups:
        rows = sorted(trained(store, group), key=lambda row: row.cpd)
        for part in np.array_split(np.arange(len(rows)), CLASSES):
            mine = [rows[i] for i in part]
            if mine:
                errors = np.sort([error(row) for row in mine])
                best = errors[: max(1, len(errors) // 4)].mean()
                acuity = f"{mine[0].cpd:.2g} to {mine[-1].cpd:.2g}"
                lines.append([group, acuity, str(len(mine)), f"{errors.mean():.2f}", f"{best:.2f}"])
    return markdown_table(["task", "acuity [cycles/°]", "candidates", "mean error", "of the best quarter"], lines)


def draw(store: Store, path: Path) -> None:
    """A panel per task."""
    figure, axes = new_figure(3.6 * len(store.groups) + 0.5, 3.6, columns=len(store.groups), sharey=True)
    for place, group in zip(axes[0], store.groups, strict=True):
        rows, color = trained(store, group), COLORS.get(group, "#777777")
        ranks = np.argsort(np.argsort([row.cpd for row in rows])) / max(len(rows) - 1, 1)
        for row, rank in zip(rows, ranks, strict=True):
            place.loglog(size(row), error(row), "o", color=color, alpha=0.2 + 0.75 * rank, ms=5, mec="none")
        if (law := fitted(rows, size)) is not None:
            ends = np.array([min(map(size, rows)), max(map(size, rows))])
            place.loglog(ends, law.error(ends), color="#222222", lw=1.2)
        place.set_title(f"{group}: exponent {'-' if law is None else law.exponents[0]}", fontsize=10)
        place.set_xlabel("acuity x parameters x memory")
    axes[0, 0].set_ylabel("error")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect runs if asked, and make the page."""
    return evolved.main(NAME, __doc__ or "", page, arguments)


if __name__ == "__main__":
    sys.exit(main())
