"""Figure of the factors of eyes: effects in each task on the left, the comparison under each control on the right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.eye_factors_design import Control
from experiments.factorial import Effects
from experiments.means import Interval
from experiments.page import new_figure, save

__all__ = ["COLORS", "draw"]

COLORS = {"maze": "#D55E00", "detection": "#0072B2"}
APART = 0.22  # distance between the tasks' marks, in rows


def draw(
    found: Mapping[str, Effects],
    names: Sequence[tuple[tuple[str, ...], str]],
    compared: Sequence[tuple[Control, Mapping[str, Interval]]],
    path: Path,
) -> None:
    """Draw effects and comparisons.

    found: effects by task
    names: effects from top to bottom, with their labels
    compared: controls from top to bottom, with the advantage of many coarse eyes by task, in standard deviations
    """
    tall = 1.6 + 0.36 * max(len(names), len(compared))
    figure, (axes,) = new_figure(13.5, tall, columns=2, width_ratios=(1, 1))
    effects = {task: [one.of[factors] for factors, _ in names] for task, one in found.items()}
    _draw_intervals(axes[0], effects, [label for _, label in names])
    axes[0].set_title("effect of each factor on the mean return")
    advantages = {task: [by_task.get(task) for _, by_task in compared] for task in found}
    _draw_intervals(axes[1], advantages, [control.name for control, _ in compared])
    axes[1].set_title("advantage of many coarse eyes over few fine eyes")
    axes[0].legend(fontsize=8, frameon=False)
    for place in axes:
        place.set_xlabel("standard deviations of training runs")
    save(figure, path)


def _draw_intervals(place: Any, values: Mapping[str, Sequence[Interval | None]], labels: Sequence[str]) -> None:
    """Draw a mark with its 95 % interval per task and row."""
    for n, (task, column) in enumerate(values.items()):
        known = [(row, one) for row, one in enumerate(column) if one is not None]
        y = [row + APART * (n - (len(values) - 1) / 2) for row, _ in known]
        mean = np.array([one.mean for _, one in known])
        reach = [[one.mean - one.low for _, one in known], [one.high - one.mean for _, one in known]]
        place.errorbar(mean, y, xerr=reach, fmt="o", ms=4, lw=1.2, color=COLORS[task], label=task)
    place.axvline(0, color="#777777", lw=0.8)
    place.set_yticks(range(len(labels)), labels, fontsize=8)
    place.invert_yaxis()
