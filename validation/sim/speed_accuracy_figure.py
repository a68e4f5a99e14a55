"""Figure of speed against accuracy: a row for each eye and population of receptors, a column for each world."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from validation.sim.speed_accuracy_points import PROMISED, Chart, Errors, Point

__all__ = ["draw", "message"]

COLORS = {"closed_form": "#0072B2", "areas": "#CC79A7", "mitsuba": "#E69F00", "reference": "#888888"}
NAMES = {
    "closed_form": "rays, closed form",
    "areas": "areas",
    "mitsuba": "rays, Mitsuba's ray tracing",
    "reference": "Mitsuba's renderings",
}
STAR = "#D55E00"
STYLES = {"direct": ":", "bounce": "--", "all": "-"}
MARKS = {"direct": "v", "bounce": "o", "all": "s", "path": "s"}
PER_ROW = 3  # worlds


def everywhere(errors: Errors) -> float | None:
    return errors.everywhere


def on_objects(errors: Errors) -> float | None:
    return errors.on_objects


POPULATIONS = (("all receptors", everywhere), ("receptors that see an object", on_objects))


def message(charts: Sequence[Chart]) -> str:
    """Return the title of the figure."""
    worst = max(chart.auto.error.worst for chart in charts)
    if not any(chart.missed for chart in charts):
        return f'The error of "auto" is below σ/2, also on objects: at most {worst:.2f} σ'
    missed = sum(bool(chart.missed) for chart in charts)
    return f'The error of "auto" exceeds σ/2 in {missed} of {len(charts)} charts: up to {worst:.3f} σ'


def draw(charts: Sequence[Chart], path: Path) -> None:
    """Draw the error over speed, fronts as lines, auto as a star. Worlds without objects have no second panel."""
    from matplotlib.figure import Figure

    columns = min(PER_ROW, len(charts))
    groups = [charts[at : at + columns] for at in range(0, len(charts), columns)]
    figure = Figure(figsize=(4.1 * columns + 0.2, 5.2 * len(groups) + 1.5), layout="constrained")
    panels = figure.subplots(2 * len(groups), columns, squeeze=False, sharex=True, sharey=True)
    for i, group in enumerate(groups):
        for row, (name, error) in enumerate(POPULATIONS, 2 * i):
            for axes, chart in zip(panels[row], group, strict=False):
                _panel(axes, chart, error)
                axes.set_title(chart.scene if error is everywhere else "", fontsize=9.5)
            panels[row, 0].set_ylabel(f"error [σ], {name}")
            for axes in panels[row, len(group) :]:
                axes.set_axis_off()
    values = [e for c in charts for p in c.points for _, error in POPULATIONS if (e := error(p.error))]
    panels[0, 0].set_ylim(0.7 * min(values), 1.6 * max(values))
    for column, chart in enumerate(groups[-1]):
        axes = panels[-1 if chart.has_objects else -2, column]
        axes.set_xlabel("agent-steps per CPU second")
        axes.xaxis.set_tick_params(labelbottom=True)
    _legend(figure, 4)
    figure.suptitle(message(charts), fontsize=12)
    figure.savefig(path, dpi=110)


def _panel(axes: Any, chart: Chart, error: Any) -> None:
    axes.set(xscale="log", yscale="log")
    if error(chart.auto.error) is None:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no objects in this world", transform=axes.transAxes, ha="center", color="#555555")
        return
    front = chart.front_of(error)
    axes.axhspan(1e-4, PROMISED, color="#009E73", alpha=0.08, lw=0)
    axes.step([p.speed for p in front], [error(p.error) for p in front], where="post", color="black", lw=0.9, zorder=1)
    series: dict[tuple[str, str], list[Point]] = {}
    for p in chart.points:
        s = p.setting
        if s.samples is None:
            continue
        fill = "white" if p.light == "direct" else COLORS[p.kind]
        axes.plot(p.speed, error(p.error), MARKS[p.light], color=COLORS[p.kind], mfc=fill, ms=4.5, mew=1)
        if s.bands == 4 and s.layers == 1 and p.kind in ("closed_form", "areas"):
            series.setdefault((p.kind, p.light), []).append(p)
    for (kind, light), points in series.items():
        speeds, errors = [p.speed for p in points], [error(p.error) for p in points]
        axes.plot(speeds, errors, STYLES[light], color=COLORS[kind], lw=0.8)
        if (kind, light) in (("closed_form", "bounce"), ("areas", "all")):
            for p in points:
                _numbered(axes, p, error(p.error))
    axes.plot(chart.auto.speed, error(chart.auto.error), "*", color=STAR, ms=15, mec="white", mew=0.8, zorder=5)


def _numbered(axes: Any, point: Point, error: float) -> None:
    style = {"xytext": (-3, -10), "textcoords": "offset points", "fontsize": 7, "color": COLORS[point.kind]}
    axes.annotate(f"{point.setting.samples:g}", (point.speed, error), **style)


def _legend(figure: Any, columns: int) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def mark(label: str, marker: str, **style: Any) -> Any:
        return Line2D([], [], ls="", marker=marker, label=label, **style)

    entries = [
        mark('choice of "auto"', "*", color=STAR, ms=12),
        Line2D([], [], color="black", lw=0.9, label="Pareto front"),
        Patch(color="#009E73", alpha=0.15, label="bound of auto: σ/2"),
        *(
            mark(f"{name} (number: per receptor)" if k < 2 else name, "o", color=color)
            for k, (name, color) in enumerate(zip(NAMES.values(), COLORS.values(), strict=True))
        ),
        mark("direct light", MARKS["direct"], color="black", mfc="white"),
        mark("with one bounce", MARKS["bounce"], color="black"),
        mark("all light", MARKS["all"], color="black"),
    ]
    figure.legend(handles=entries, loc="outside lower center", ncols=columns, frameon=False, fontsize=8.5)
