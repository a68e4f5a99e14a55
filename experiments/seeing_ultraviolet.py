"""Ultraviolet vision: evolution of pigments if goal and adversary differ only in the ultraviolet

python -m experiments.seeing_ultraviolet [--runs foraging=DIR ...] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import scipy.stats

import optics
from experiments import evolved
from experiments.candidates import NO_NUMBER, Row
from experiments.drift import SEEDS, shade
from experiments.evolved import Store, conduct_table, null_model, null_table
from experiments.means import LAST, last_mean, of_generation
from experiments.page import Figure, Page, markdown_table, new_figure, save
from sim.worlds.foraging import ULTRAVIOLET, petal

__all__ = ["contrast", "difference", "page"]

NAME = "seeing_ultraviolet"
BANDS = 16
RANGES = (330, 365, 400, 435, 470, 650)  # ranges of the shortest peak [nm]
FITNESS = "#0072B2"


@cache  # peaks are stored to a tenth of a nanometre, so that values repeat
def difference(peak_nm: float) -> float:
    """Return the difference of a receptor's signals for goal and adversary in daylight, relative to white.

    peak_nm: peak of the receptor's pigment
    """
    eye = optics.Eye(resolution=(1, 1), bands=BANDS, receptors=(peak_nm,))
    wavelengths = eye.spectral_bands.wavelengths
    daylight = optics.illuminant("D65").at(wavelengths)
    goal, adversary = (
        eye.see((petal(share).at(wavelengths) * daylight)[:, None, None], 1).item() for share in ULTRAVIOLET.values()
    )
    return abs(goal - adversary)


def contrast(row: Row) -> float:
    """Return the largest difference between the signals of goal and adversary among a candidate's receptor types."""
    return max((difference(peak) for peak in peaks(row)), default=NO_NUMBER)


def peaks(row: Row) -> list[float]:
    """Return the peaks of a candidate's receptor types [nm], shortest first."""
    return sorted(float(text) for text in row.peaks_nm.split())


def shortest(row: Row) -> float:
    """Return the shortest peak of a candidate's receptor types [nm]."""
    return min(peaks(row), default=NO_NUMBER)


def middle(row: Row) -> float:
    """Return the median peak of a candidate's receptor types [nm]."""
    return float(np.median(peaks(row))) if row.peaks_nm else NO_NUMBER


def longest(row: Row) -> float:
    """Return the longest peak of a candidate's receptor types [nm]."""
    return max(peaks(row), default=NO_NUMBER)


NAMES = ("shortest peak", "middle peak", "longest peak")
COLORS = {shortest: "#6A3D9A", middle: "#009E73", longest: "#D55E00"}
QUANTITIES = {
    "shortest peak [nm]": shortest,
    "middle peak [nm]": middle,
    "longest peak [nm]": longest,
    "difference of goal and adversary": contrast,
    "fitness": lambda row: row.fitness,
    "goal reached first": lambda row: row.success_rate,
}


def page(store: Store) -> Page:
    """Return the page of results, made from stored runs."""
    return Page(
        name=NAME,
        command=(
            "evolve run --preset ultraviolet --set search.active=true --seed 0    # and others\n"
            "python -m experiments.seeing_ultraviolet --runs foraging=DIR foraging=DIR"
        ),
        values={
            "answer": store.answer,
            "last": str(LAST),
            "searches": str(SEEDS),
            "means": table(store),
            "rank_correlation": f"{rank_correlation(store.rows):.2f}",
            "by_peak": table_by_peak(store.rows),
            "p_of_runs": null_table(store, QUANTITIES),
            "runs": conduct_table(store),
        },
        figures=[Figure(NAME, lambda path: draw(store, path))],
        origin=store.origin,
    )


def table(store: Store) -> str:
    """Return a table of the quantities in the first and in the last generations, and under the null model."""
    first = [row for row in store.rows if row.generation == 0]
    header = ["mean", "first generation", f"last {LAST} generations", "null model"]
    lines = []
    for name, value in QUANTITIES.items():
        drift = null_model(store, store.groups[0], name, store.rows)
        lines.append([name, str(last_mean(first, value)), str(last_mean(store.rows, value)), str(drift or "")])
    return markdown_table(header, lines)


def rank_correlation(rows: Sequence[Row]) -> float:
    """Return Spearman's rank correlation of shortest peak and fitness."""
    done = [row for row in rows if not row.failed]
    return float(scipy.stats.spearmanr([shortest(row) for row in done], [row.fitness for row in done]).statistic)


def table_by_peak(rows: Sequence[Row]) -> str:
    """Return a table of fitness and success, with a row per range of the shortest peak."""
    lines = []
    for low, high in itertools.pairwise(RANGES):
        mine = [row for row in rows if not row.failed and low <= shortest(row) < high]
        if mine:
            means = (np.mean([value(row) for row in mine]) for value in (lambda r: r.success_rate, lambda r: r.fitness))
            lines.append([f"{low} to {high} nm", str(len(mine)), *(f"{mean:.3g}" for mean in means)])
    return markdown_table(["shortest peak", "candidates", "goal reached first", "fitness"], lines)


def draw(store: Store, path: Path) -> None:
    """Draw the signal difference over the peak, and peaks and success over the generations."""
    rows = store.rows
    figure, axes = new_figure(11, 4.0, columns=3)
    seen, moved, worth = axes[0]
    nm = np.linspace(330, 650, 65)
    seen.semilogy(nm, [difference(float(peak)) for peak in nm], color="#222222", lw=1.2)
    seen.set(xlabel="peak of the pigment [nm]", title="difference of goal and adversary")
    for name, color in zip(QUANTITIES, COLORS.values(), strict=False):
        shade(moved, store.drift_of(store.groups[0], name), color)
    for seed in sorted({row.seed for row in rows}):
        mine = [row for row in rows if row.seed == seed]
        last = [row for row in mine if row.generation > max(r.generation for r in mine) - LAST]
        for value, color in COLORS.items():
            found = [value(row) for row in last]
            seen.semilogy(found, [difference(peak) for peak in found], "o", color=color, ms=4, alpha=0.5, mec="none")
            moved.plot(*of_generation(mine, value), color=color, lw=1.2)
        worth.plot(*of_generation(mine, lambda row: row.success_rate), color=FITNESS, lw=1.2)
    moved.axhline(400, color="#777777", lw=1, ls="--")
    moved.set(xlabel="generation", title="peaks [nm]")
    worth.axhline(1 / 3, color="#999999", lw=0.8, ls=":")
    worth.set(xlabel="generation", title="goal reached before any adversary", ylim=(0, 1))
    lines = [moved.plot([], [], color=color, label=name)[0] for name, color in zip(NAMES, COLORS.values(), strict=True)]
    figure.legend(handles=lines, loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle("The shortest peak evolves into the ultraviolet, in which goal and adversary differ")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect runs if requested, and make the page."""
    return evolved.main(NAME, __doc__ or "", page, arguments, QUANTITIES)


if __name__ == "__main__":
    sys.exit(main())
