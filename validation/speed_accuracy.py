"""The chart of speed against accuracy: its points, its front, its table and its figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import sim
from validation.scenes import SIGMA

__all__ = ["Chart", "Point", "Setting", "draw", "rows_of", "table"]


@dataclass(frozen=True)
class Setting:
    """One way to render. rays: per receptor, or samples per cell of the reference renderer; None: auto."""

    back_end: str
    rays: float | None
    bands: int = 4
    light: str = "direct"
    layers: int = 1

    def __str__(self) -> str:
        rays = "auto" if self.rays is None else f"{self.rays:g}"
        return f"{self.back_end:<12}{rays:>6}{self.bands:>7}  {self.light:<8}{self.layers:>6}"


@dataclass(frozen=True)
class Point:
    """What a setting is worth. error: to the path-traced reference; sampling: to the same light to the end, both in σ.
    speed: agent-steps per CPU second; fidelity: what was rendered with, None for the reference renderer."""

    setting: Setting
    error: float
    sampling: float
    speed: float
    fidelity: sim.Fidelity | None = None

    @property
    def light(self) -> str:
        return self.fidelity.light if self.fidelity else self.setting.light

    def __str__(self) -> str:
        """As the setting, with what auto picked in its place."""
        f = self.fidelity
        if f is None or self.setting.rays is not None:
            return str(self.setting)
        return f"{'auto':<12}{f.rays_per_receptor:>6g}{f.bands:>7}  {f.light:<8}{f.depth.count:>6}"


@dataclass(frozen=True)
class Chart:
    """All points of a scene; of the reference, its own standard error; how far each light's end is from it. In σ."""

    scene: str
    points: tuple[Point, ...]
    reference_error: float
    left: Mapping[str, float]

    @property
    def front(self) -> tuple[Point, ...]:
        """Points that no other beats in both, fastest first."""
        ranked = sorted(self.points, key=lambda p: (-p.speed, p.error))
        least, found = np.inf, []
        for point in ranked:
            if point.error < least:
                found.append(point)
                least = point.error
        return tuple(found)

    @property
    def auto(self) -> Point:
        return next(p for p in self.points if p.setting.rays is None)

    @property
    def rival(self) -> Point:
        """The fastest point that is at least as exact as auto's."""
        return max((p for p in self.points if p.error <= self.auto.error), key=lambda p: p.speed)


def table(charts: Sequence[Chart]) -> str:
    lines = []
    for chart in charts:
        front, auto, rival = chart.front, chart.auto, chart.rival
        ends = ", ".join(f"{light} light {error:.2f} σ" for light, error in chart.left.items())
        lines.append(f"{chart.scene}; reference good to {chart.reference_error:.2f} σ; to the end, {ends} from it")
        if auto.fidelity and auto.fidelity.predicted_error:
            predicted = auto.fidelity.predicted_error / SIGMA
            lines.append(f"auto predicted {predicted:.2f} σ; {auto.speed / rival.speed:.2f} of the front's speed")
        lines.append("back end      rays  bands  light   layers   steps/s   error [σ]  beside its light [σ]")
        for p in sorted(chart.points, key=lambda p: -p.speed):
            speed = f"{p.speed:.3g}" if p.speed < 100 else f"{p.speed:.0f}"
            lines.append(f"{p}{speed:>10}{p.error:>12.3f}{p.sampling:>12.3f}{'  front' if p in front else ''}")
        lines.append("")
    return "\n".join(lines).rstrip()


def rows_of(charts: Sequence[Chart]) -> list[dict[str, Any]]:
    """One row per point, for the stored table."""
    rows = []
    for chart in charts:
        for p in chart.points:
            s, f = p.setting, p.fidelity
            row: dict[str, Any] = {"scene": chart.scene, "back_end": s.back_end, "auto": s.rays is None}
            row |= {"rays": f.rays_per_receptor if f else s.rays, "bands": f.bands if f else s.bands, "light": p.light}
            row |= {"layers": f.depth.count if f else s.layers, "steps_per_cpu_second": f"{p.speed:.5g}"}
            rows.append(row | {"error_sigma": f"{p.error:.4g}", "beside_its_light_sigma": f"{p.sampling:.4g}"})
    return rows


COLORS = {"closed_form": "#0072B2", "mitsuba": "#E69F00", "reference": "#888888"}
NAMES = {"closed_form": "closed form", "mitsuba": "batched, Mitsuba's rays", "reference": "Mitsuba + convolution"}
MARKS = {1: "v", 3: "^", 4: "o", 8: "s", 16: "D"}


def draw(charts: Sequence[Chart], path: Path) -> None:
    """One panel per scene: error over speed, the front as a line, auto as a star."""
    from matplotlib.figure import Figure

    columns = min(2, len(charts))
    rows = -(-len(charts) // columns)
    figure = Figure(figsize=(5.2 * columns, 3.9 * rows + 0.9), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axes, chart in zip(panels.ravel(), charts, strict=False):
        _panel(axes, chart)
    errors = [p.error for chart in charts for p in chart.points]
    panels[0, 0].set_ylim(0.7 * min(errors), 1.6 * max(errors))
    for axes in panels[-1]:
        axes.set_xlabel("agent-steps per CPU second")
    for axes in panels[:, 0]:
        axes.set_ylabel("error [σ of the receptors' noise]")
    _legend(figure, 2 * columns)
    figure.savefig(path, dpi=110)


def _panel(axes: Any, chart: Chart) -> None:
    front = chart.front
    axes.axhspan(1e-3, 0.5, color="#009E73", alpha=0.08, lw=0)
    axes.step([p.speed for p in front], [p.error for p in front], where="post", color="black", lw=0.9, zorder=1)
    for p in chart.points:
        s = p.setting
        if s.rays is None:
            continue
        color = COLORS[s.back_end]
        fill = "white" if p.light == "direct" else color
        axes.plot(p.speed, p.error, MARKS[s.bands], color=color, mfc=fill, ms=4.5 + 2 * (s.layers > 1), mew=1)
    for light, style in (("direct", ":"), ("bounce", "--")):
        series = [p for p in chart.points if p.setting.rays and p.setting == _plain(p.setting.rays, light)]
        axes.plot([p.speed for p in series], [p.error for p in series], style, color=COLORS["closed_form"], lw=0.8)
    for p in (p for p in chart.points if p.setting.rays and p.setting == _plain(p.setting.rays, "direct")):
        axes.annotate(f"{p.setting.rays:g}", (p.speed, p.error), xytext=(3, 5), textcoords="offset points", fontsize=7)
    axes.plot(chart.auto.speed, chart.auto.error, "*", color="#D55E00", ms=16, mec="white", mew=0.8, zorder=5)
    axes.set(xscale="log", yscale="log")
    axes.margins(x=0.08)
    axes.set_title(chart.scene, fontsize=10)


def _plain(rays: float, light: str) -> Setting:
    return Setting("closed_form", rays, light=light)


def _legend(figure: Any, columns: int) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def mark(label: str, marker: str, **style: Any) -> Any:
        return Line2D([], [], ls="", marker=marker, label=label, **style)

    entries = [
        mark('what "auto" picks', "*", color="#D55E00", ms=12),
        Line2D([], [], color="black", lw=0.9, label="Pareto front"),
        Patch(color="#009E73", alpha=0.15, label="below half the noise"),
        *(mark(NAMES[name], "o", color=color) for name, color in COLORS.items()),
        mark("direct light (number: rays)", "o", color="black", mfc="white"),
        mark("reflected light, too", "o", color="black"),
        *(mark(f"{bands} band{'s' * (bands > 1)}", m, color="black", mfc="none") for bands, m in MARKS.items()),
    ]
    figure.legend(handles=entries, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
