"""Error over acuity and brain size, with short training

python -m experiments.brains_and_acuity [--runs TASK=DIR ...] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

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
CLASSES = 4  # number of acuity classes
TICKS = (1.0, 2.0, 3.0, 5.0, 7.0)  # ticks in a decade
FEW = (1.0, 3.0)  # ticks in a decade on axes that span several decades
MANY = 30.0  # ratio of an axis's ends above which the axis has FEW ticks
Size = Callable[[Row], float]
FACTORS: dict[str, Size] = {
    "acuity": lambda row: row.cpd,
    "parameters": lambda row: row.parameters,
    "memory": lambda row: row.memory_frames,
}


def error(row: Row) -> float:
    """Return the share of episodes in which the animal did not reach the goal, or reached an adversary first.

    If these are k of n episodes, the share is estimated as (k + 1/2) / (n + 1) (Jeffreys' mean), which is never 0, so
    that its logarithm exists. In a maze, no animal reaches the goal. The error is then 1 minus the ratio of the fitness
    to the full return.
    """
    if math.isfinite(row.full_return):
        return 1 - row.fitness / row.full_return
    return ((1 - row.success_rate) * row.episodes + 0.5) / (row.episodes + 1)


def size(row: Row) -> float:
    """Return acuity x parameters x memory [cycles/degree · frames]."""
    return row.cpd * row.parameters * row.memory_frames


def fitted(rows: Sequence[Row], *sizes: Size) -> PowerLaw | None:
    """Return the power law of candidates' errors over these sizes; None if it cannot be fitted."""
    try:
        return power_law(np.array([error(row) for row in rows]), *(np.array([f(row) for row in rows]) for f in sizes))
    except ValueError:
        return None


def trained(store: Store, group: str) -> list[Row]:
    """Return the candidates of a group that have a trained policy."""
    return [row for row in store.group(group) if not row.failed and row.parameters]


def page(store: Store) -> Page:
    """Return the page of results, made from stored runs."""
    return Page(
        name=NAME,
        command=(
            "SETTINGS='--set genome.neurons.low=4 --set genome.neurons.high=128 --set learning.least_epochs=10'\n"
            "evolve run --preset scaling $SETTINGS\n"
            "evolve run tracking --preset scaling $SETTINGS\n"
            "evolve run maze --preset scaling $SETTINGS --set learning.least_epochs=8\n"
            "python -m experiments.brains_and_acuity --runs detection=DIR tracking=DIR navigation=DIR"
        ),
        values={
            "answer": store.answer,
            "exponents": exponents(store),
            "factors": factors(store),
            "ceilings": ceilings(store),
            "runs": conduct_table(store),
        },
        figures=[Figure(NAME, lambda path: draw(store, path))],
        origin=store.origin,
    )


def exponents(store: Store) -> str:
    """Return a table of the exponents with which error falls over `size`, with a row per task."""
    lines = []
    for group in store.groups:
        rows = trained(store, group)
        law, published = fitted(rows, size), f"{PUBLISHED[group]:g}" if group in PUBLISHED else "-"
        exponent, explained = ("-", "-") if law is None else (str(law.exponents[0]), f"{law.explained:.2f}")
        lines.append([group, str(len(rows)), exponent, published, explained])
    return markdown_table(["task", "candidates", "exponent", "published", "variance explained"], lines)


def factors(store: Store) -> str:
    """Return a table of the exponents of acuity, parameters and memory, fitted together, with a row per task."""
    header = ["task", *(f"exponent of {name}" for name in FACTORS), "variance explained"]
    lines = []
    for group in store.groups:
        law = fitted(trained(store, group), *FACTORS.values())
        found = ["-"] * (len(FACTORS) + 1)
        if law is not None:
            found = [*map(str, law.exponents), f"{law.explained:.2f}"]
        lines.append([group, *found])
    return markdown_table(header, lines)


def classes(rows: Sequence[Row]) -> list[list[Row]]:
    """Return the candidates in CLASSES classes of equal size, from coarse to fine acuity; empty classes are omitted."""
    ordered = sorted(rows, key=lambda row: row.cpd)
    parts = [[ordered[i] for i in part] for part in np.array_split(np.arange(len(ordered)), CLASSES)]
    return [part for part in parts if part]


def best_quarter(rows: Sequence[Row]) -> float:
    """Return the mean error of the quarter of candidates with the lowest errors."""
    errors = np.sort([error(row) for row in rows])
    return float(errors[: max(1, len(errors) // 4)].mean())


def ceilings(store: Store) -> str:
    """Return a table of mean errors and mean errors of the best quarter, by acuity class."""
    lines = []
    for group in store.groups:
        for mine in classes(trained(store, group)):
            mean = np.mean([error(row) for row in mine])
            acuity = f"{mine[0].cpd:.2g} to {mine[-1].cpd:.2g}"
            lines.append([group, acuity, str(len(mine)), f"{mean:.2f}", f"{best_quarter(mine):.2f}"])
    return markdown_table(["task", "acuity [cycles/°]", "candidates", "mean error", "of the best quarter"], lines)


def draw(store: Store, path: Path) -> None:
    """Draw two panels per task: error over `size`, and error over acuity alone."""
    count = len(store.groups)
    figure, axes = new_figure(3.4 * count + 0.5, 6.2, columns=count, rows=2, sharey=True)
    for column, group in zip(axes.T, store.groups, strict=True):
        rows, color = trained(store, group), COLORS.get(group, "#777777")
        dots(column[0], rows, (size, FACTORS["acuity"]), color)
        law = fitted(rows, size)
        if law is not None:
            ends = np.array([min(map(size, rows)), max(map(size, rows))])
            column[0].plot(ends, law.error(ends), color="#222222", lw=1.2)
        column[0].set(title=f"{group}: exponent {'-' if law is None else law.exponents[0]}")
        column[0].set_xlabel("acuity x parameters x memory")
        dots(column[1], rows, (FACTORS["acuity"], brain), color)
        for mine in classes(rows):
            level = best_quarter(mine)
            column[1].plot([mine[0].cpd, mine[-1].cpd], [level, level], color="#222222", lw=1.2)
        column[1].set_xlabel("acuity [cycles/°]")
    for place in axes[:, 0]:
        place.set_ylabel("error")
    for place in axes.flat:
        place.title.set_fontsize(10)
        label(place.yaxis, place.get_ylim())
    for place in axes[1]:
        label(place.xaxis, place.get_xlim())
    figure.legend(handles=_key(), loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle("Finer eyes lower the ceiling of error in detection and tracking; larger brains do not")
    save(figure, path)


def _key() -> list[Any]:
    """Return the legend of dots, shades and lines."""
    from matplotlib.lines import Line2D

    dots = {"marker": "o", "ls": "", "color": "#555555"}
    return [
        Line2D([], [], alpha=0.3, label="animal with a small value of the other quantity", **dots),
        Line2D([], [], alpha=0.95, label="animal with a large value", **dots),
        Line2D([], [], color="#222222", label="top: power law; bottom: best quarter of a class"),
    ]


def label(axis: Any, ends: tuple[float, float]) -> None:
    """Label a logarithmic axis with plain numbers."""
    of_decade = TICKS if ends[1] < MANY * ends[0] else FEW
    decades = range(math.floor(math.log10(ends[0])), math.ceil(math.log10(ends[1])))
    ticks = [tick for n in decades for k in of_decade if ends[0] <= (tick := k * 10.0**n) <= ends[1]]
    axis.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axis.set_tick_params(which="minor", labelleft=False, labelbottom=False)


def brain(row: Row) -> float:
    """Return the number of parameters times the number of frames in memory."""
    return row.parameters * row.memory_frames


def dots(place: Any, rows: Sequence[Row], sizes: tuple[Size, Size], color: str) -> None:
    """Draw a dot for each candidate: its error over the first size; the darkness is the rank in the second size."""
    across, shade = sizes
    ranks = np.argsort(np.argsort([shade(row) for row in rows])) / max(len(rows) - 1, 1)
    for row, rank in zip(rows, ranks, strict=True):
        place.loglog(across(row), error(row), "o", color=color, alpha=0.2 + 0.75 * rank, ms=5, mec="none")


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect runs if requested, and make the page."""
    return evolved.main(NAME, __doc__ or "", page, arguments)


if __name__ == "__main__":
    sys.exit(main())
