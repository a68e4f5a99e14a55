"""The page of the two searches for a lens."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.lens_search import BOUNDS, METHODS, POPULATION, RADIUS, RELIEF_HEIGHT, SPOTS, WAVELENGTH, Row
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.store import Origin

__all__ = ["found_after", "page"]

GOOD = 0.8  # Strehl ratio from which an image counts as diffraction-limited (Maréchal)
COMPARED = ("gradient, shrinking spot", "gradient, Strehl ratio", "CMA-ES, Strehl ratio")
COLORS = ("#0072B2", "#56B4E9", "#D55E00", "#E69F00")


def searches(rows: Sequence[Row], method: str) -> list[list[Row]]:
    """A method's searches, seed by seed, in the order in which they went."""
    seeds = sorted({row.seed for row in rows if row.method == method})
    return [sorted((r for r in rows if (r.method, r.seed) == (method, s)), key=lambda r: r.evaluations) for s in seeds]


def found_after(search: Sequence[Row]) -> Row | None:
    """Where on the record a search has a good lens and keeps it; None if it has none in the end."""
    kept = None
    for row in reversed(search):
        if row.strehl < GOOD:
            break
        kept = row
    return kept


def page(rows: Sequence[Row], origin: Origin) -> Page:
    """The page of stored searches."""
    paraboloid, refined = (next(row.strehl for row in rows if row.method == bound) for bound in BOUNDS)
    ours, direct, theirs = (searches(rows, method) for method in COMPARED)
    (evaluations, seconds), (their_evaluations, their_seconds) = (_medians(runs) for runs in (ours, theirs))
    stuck = sum(found_after(search) is None for search in direct)
    return Page(
        name="lens_search",
        title="A lens by gradient, and one by evolution strategy",
        question=(
            "Evolution finds its lens by trial. Optics with derivatives can walk to it. How much is that worth, in the "
            "same space of 17 genes?"
        ),
        answer=(
            f"Both find a lens. By gradient it takes {evaluations:.0f} pictures and {seconds:.1f} s (medians over "
            f"{len(ours)} seeds) until the Strehl ratio stays above {GOOD:g}, by CMA-ES {their_evaluations:.0f} and "
            f"{their_seconds:.0f} s; the gradient also gets nearer to the best that the genes hold, "
            f"{refined:.5f}. But a gradient needs a slope to walk on: of the searches that follow the Strehl ratio "
            f"itself, which is flat far from focus, {stuck} of {len(direct)} never arrived. Light within a spot that "
            "shrinks in steps has a slope everywhere. CMA-ES needs no such help."
        ),
        method=(
            f"A pupil of radius {1e6 * RADIUS:g} µm (a = 0.25), 241 µm before the retina of a default eye; one "
            f"wavelength, {1e9 * WAVELENGTH:g} nm. Genes: 16 control points of the relief, up to "
            f"{1e6 * RELIEF_HEIGHT:g} µm, and the index, 1 to 2. All methods begin from the same rough glass, another "
            "for each seed. *Strehl ratio*: its logarithm, with the peak within 8 µm. *Shrinking spot*: the logarithm "
            "of the light in a Gaussian spot on the axis, of standard deviation "
            f"{', '.join(f'{1e6 * s:g}' for s in SPOTS)} µm, one after the other. Gradient: L-BFGS-B with derivatives "
            "by Dr.Jit; a picture with its derivatives counts as one. CMA-ES: evolution's own, population "
            f"{POPULATION}. Time is one core's, for pictures and search; both are told to 15 %, the "
            "step in which searches were looked at. The bound: the paraboloid in focus has "
            f"{paraboloid:.5f}, from it a gradient reaches {refined:.5f}."
        ),
        command="python -m experiments.lens_search --run 0 1 2 3 4",
        figures=[
            Figure(
                "lens_search", lambda path: draw(rows, path), f"Every seed is a line; dotted: Strehl ratio {GOOD:g}."
            )
        ],
        tables=[table(rows)],
        origin=origin,
    )


def _medians(runs: Sequence[Sequence[Row]]) -> tuple[float, float]:
    """Evaluations and seconds to a good lens, over the searches that found one."""
    found = [row for search in runs if (row := found_after(search))]
    if not found:
        return float("nan"), float("nan")
    return statistics.median(row.evaluations for row in found), statistics.median(row.cpu_seconds for row in found)


def table(rows: Sequence[Row]) -> str:
    """A row per method."""
    lines = []
    for method in METHODS:
        runs = searches(rows, method)
        if not runs:
            continue
        evaluations, seconds = _medians(runs)
        good = sum(found_after(search) is not None for search in runs)
        of = "" if good == len(runs) else f" (of the {good})"
        ends = ", ".join(f"{search[-1].strehl:.3f}" for search in runs)
        lines.append([method, f"{good} of {len(runs)}", f"{evaluations:.0f}{of}", f"{seconds:.1f}{of}", ends])
    header = ["method", f"above {GOOD:g}", "pictures until then", "core seconds", "Strehl ratio in the end, all seeds"]
    return markdown_table(header, lines)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Strehl ratio over pictures and over time."""
    figure, axes = new_figure(10, 3.8, columns=2, sharey=True)
    for method, color in zip(METHODS, COLORS, strict=True):
        for number, search in enumerate(searches(rows, method)):
            strehl = np.array([row.strehl for row in search])
            for place, cost in zip(axes[0], ("evaluations", "cpu_seconds"), strict=True):
                spent = [getattr(row, cost) for row in search]
                place.semilogx(spent, strehl, color=color, lw=1.3, label=method if number == 0 else None)
    for place in axes[0]:
        place.axhline(GOOD, color="#777777", ls=":", lw=1)
    axes[0, 0].set(xlabel="pictures computed", ylabel="Strehl ratio", ylim=(0, 1.03))
    axes[0, 1].set(xlabel="time of one core [s]", xlim=(0.3, None))
    axes[0, 0].legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0.0, 0.77))
    save(figure, path)
