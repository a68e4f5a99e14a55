"""Goals shape eyes: evolution from one photoreceptor for navigation and for detection

python -m experiments.goals_shape_eyes [--runs navigation=DIR ... detection=DIR ...] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from experiments import evolved
from experiments.candidates import Row, full_return
from experiments.contrast import contrast
from experiments.designed import Trained
from experiments.drift import SEEDS, shade
from experiments.evolved import Store, conduct_table, null_model, null_table
from experiments.eye_shapes import eyes_of
from experiments.means import LAST, last_mean, last_values, of_generation
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.store import read_rows

__all__ = ["page"]

NAME = "goals_shape_eyes"
COLORS = {"navigation": "#D55E00", "detection": "#0072B2"}
TOGETHER = "ln(width / eyes)"  # chosen before the runs; large for fine eyes, small for many eyes
QUANTITIES: dict[str, Callable[[Row], float]] = {
    TOGETHER: lambda row: math.log(row.width / row.n_eyes),
    "eyes": lambda row: row.n_eyes,
    "receptors per eye, across": lambda row: row.width,
    "receptors per eye, up": lambda row: row.height,
    "placement range [°]": lambda row: row.placement_range_deg if row.n_eyes > 1 else float("nan"),
    "field of view [°]": lambda row: row.fov_deg,
    "acuity [cycles/°]": lambda row: row.cpd,
    "fitness": lambda row: row.fitness,
    "success rate": lambda row: row.success_rate,
}
COLUMNS = 4  # columns of panels
CONTRASTED = ("navigation", "detection")
# Ceiling of navigation: a straight path to the goal region. An animal that overshoots earns a little more.
CEILINGS: dict[str, Callable[[], float]] = {
    "fitness": lambda: full_return("navigation"),
    "success rate": lambda: 1.0,
}
# Published eyes, 10 of 4 x 4 around the head and 2 of 15 x 15 ahead, trained by experiments.eyes_for_tasks.
CONTROL = Path(__file__).parents[1] / "docs/results/data/eyes_for_tasks.csv"
CONTROL_EYES = ((10, 4, 135.0), (2, 15, 45.0))
QUANTITIES_OF_TRAININGS: dict[str, Callable[[Trained], float]] = {
    "fitness": lambda row: row.fitness,
    "success rate": lambda row: row.success_rate,
}
PUBLISHED = {
    "navigation": ("-0.92", "10", "4", "4 (secondary sources)", "135", "", "", "", ""),
    "detection": ("2.01", "2", "15", "15", "forward", "", "", "", ""),
}


def page(store: Store) -> Page:
    """Return the page of results, made from stored runs."""
    return Page(
        name=NAME,
        command=(
            "evolve run --preset bifurcation-navigation --set search.active=true --seed 0    # and 1, 2\n"
            "evolve run --preset bifurcation-detection --set search.active=true --seed 0    # and 1, 2\n"
            "python -m experiments.goals_shape_eyes --runs navigation=DIR navigation=DIR navigation=DIR"
            " detection=DIR detection=DIR detection=DIR"
        ),
        values={
            "answer": store.answer,
            "legend": _legend(store),
            "last": str(LAST),
            "searches": str(SEEDS),
            "means": table(store),
            "seeds": seeds_table(store),
            "p_of_runs": null_table(store, QUANTITIES),
            "contrast": str(contrast(store, TOGETHER, QUANTITIES[TOGETHER], *CONTRASTED) or "-"),
            "runs": conduct_table(store),
        },
        figures=[Figure(NAME, lambda path: draw(store, path))],
        origin=store.origin,
    )


def _legend(store: Store) -> str:
    names = {"navigation": "orange", "detection": "blue"}
    return ", ".join(f"{group} {names.get(group, 'grey')}" for group in store.groups)


def table(store: Store) -> str:
    """Return a table with a row per quantity: results, null model and published values of each group."""
    kinds = ("", ", null model", ", published")
    header = ["mean of the last generations", *(f"{g}{what}" for g in store.groups for what in kinds)]
    lines = []
    for place, (name, value) in enumerate(QUANTITIES.items()):
        line = [name]
        for g in store.groups:
            drift = null_model(store, g, name, store.group(g))
            line += [_shown(store.group(g), value), str(drift or ""), PUBLISHED[g][place] if g in PUBLISHED else ""]
        lines.append(line)
    return markdown_table(header, lines)


def seeds_table(store: Store) -> str:
    """Return a table of results, with a row per run."""
    lines = []
    for group in store.groups:
        for seed in sorted({row.seed for row in store.group(group)}):
            rows = [row for row in store.group(group) if row.seed == seed]
            found = [last_mean(rows, value) for value in QUANTITIES.values()]
            lines.append([f"{group}, seed {seed}", *("-" if f is None else f"{f.mean:.3g}" for f in found)])
    return markdown_table(["run", *QUANTITIES], lines)


def _shown(rows: Sequence[Row], value: Callable[[Row], float]) -> str:
    found = last_mean(rows, value)
    return "-" if found is None else str(found)


def message(store: Store) -> str:
    """Return the figure's title: a result that all seeds have in common, if there is one."""
    ends = {
        group: [float(v.mean()) for v in last_values(store.group(group), QUANTITIES[TOGETHER])] for group in CONTRASTED
    }
    if all(ends.values()) and max(ends["navigation"]) < min(ends["detection"]):
        return "Fine eyes evolve for detection, coarse eyes for navigation, where fine eyes have a low field of view"
    return "Evolution from one photoreceptor in each task"


def draw(store: Store, path: Path) -> None:
    """Draw a panel per quantity that differs between animals, with a line per seed."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.ticker import MaxNLocator

    moved = {name: value for name, value in QUANTITIES.items() if len({value(row) for row in store.rows}) > 1}
    lines_of_panels = math.ceil(len(moved) / COLUMNS)
    figure, axes = new_figure(13, 4.2 + 2.4 * lines_of_panels, columns=COLUMNS, rows=lines_of_panels + 1, sharex="row")
    for place in axes[:-1].flat[len(moved) :]:
        place.set_axis_off()
    _draw_control(axes[-1])
    for place, (name, value) in zip(axes[:-1].flat, moved.items(), strict=False):
        for i, group in enumerate(store.groups):
            rows, color = store.group(group), COLORS.get(group, "#777777")
            shade(place, store.drift_of(group, name), color)
            for seed in sorted({row.seed for row in rows}):
                place.plot(*of_generation([row for row in rows if row.seed == seed], value), color=color, lw=1.2)
            found = last_mean(rows, value)
            if found is not None:
                end = max(row.generation for row in rows) + 1 + 0.5 * i
                place.plot([end, end], [found.low, found.high], color=color, lw=2.5, alpha=0.5)
                place.plot(end, found.mean, "o", color=color, ms=4)
        if name in CEILINGS:
            place.axhline(CEILINGS[name](), color=COLORS["navigation"], lw=0.8, ls="--")
        place.set_title(name, fontsize=10)
        place.xaxis.set_major_locator(MaxNLocator(integer=True))
    for place in axes[-2]:
        place.set_xlabel("generation")
    lines = [Line2D([], [], color=COLORS.get(group, "#777777"), label=group) for group in store.groups]
    lines.append(
        Line2D([], [], color="#444444", marker="o", ms=4, lw=0, label=f"mean of the last {LAST} generations, 95 %")
    )
    lines.append(Patch(color="#777777", alpha=0.25, label="null model: random fitness"))
    lines.append(Line2D([], [], color=COLORS["navigation"], ls="--", lw=0.8, label="navigation's ceiling"))
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines), frameon=False)
    figure.suptitle(message(store))
    save(figure, path)


def _draw_control(axes: Any) -> None:
    """Draw fitness and success of all training runs without evolution, with the published eyes and with other eyes."""
    rows = read_rows(Trained, CONTROL)
    panels = [(task, what) for task in CONTRASTED for what in CEILINGS]
    for place, (task, what) in zip(axes, panels, strict=True):
        for high, fill, label in (
            (True, COLORS[task], "square eyes, 45° high"),
            (False, "none", "one row of receptors"),
        ):
            if task == "detection" and not high:
                continue
            for x, (n, w, arc) in enumerate(CONTROL_EYES):
                found = eyes_of(rows, task, (n, w if high else 1, w, arc))
                aside = x + (0.12 if high else -0.12) * (task == "navigation")
                values = [QUANTITIES_OF_TRAININGS[what](row) for row in found]
                named = label if x == 0 else None
                place.plot([aside] * len(values), values, "o", ms=4, mec=COLORS[task], mfc=fill, alpha=0.8, label=named)
        names = [f"{n} of {w}\nover {arc:g}°" for n, w, arc in CONTROL_EYES]
        place.set_xticks(range(len(CONTROL_EYES)), names, fontsize=8)
        if task == "navigation":
            place.axhline(CEILINGS[what](), color=COLORS[task], lw=0.8, ls="--")
        place.set_ylim(bottom=0)
        place.set_xlim(-0.5, len(CONTROL_EYES) - 0.5)
        place.set_title(f"control, {task}: {what}", fontsize=10)
        place.legend(fontsize=7, frameon=False, loc="center left" if task == "navigation" else "lower right")


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect runs if requested, and make the page."""
    return evolved.main(NAME, __doc__ or "", page, arguments, QUANTITIES)


if __name__ == "__main__":
    sys.exit(main())
