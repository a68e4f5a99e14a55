"""Figure of eyes for tasks: the original design in the upper row, the controls in the lower row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.candidates import full_return
from experiments.crossing import Crossing, by_light
from experiments.designed import Trained
from experiments.eye_shapes import (
    BRIGHT,
    CAMERA,
    COLORS,
    CONTROLS,
    FOV_DEG,
    SHAPES,
    TASKS,
    eyes_of,
    shape_name,
    with_rows,
    with_squares,
)
from experiments.page import new_figure, save

__all__ = ["draw", "height_message", "light_message"]

MATTERS = 0.1  # smallest difference that a title reports, relative to the fitness of a straight path


def draw(rows: Sequence[Trained], path: Path) -> None:
    """Draw two rows of panels: the original design with the difference in each light, and the controls."""
    figure, axes = new_figure(12, 8.6, columns=3, rows=2, width_ratios=(1.2, 1.2, 1))
    first = with_rows(rows)
    rows_of = {"navigation": lambda w: 1, "detection": lambda w: w}
    for place, task in zip(axes[0], TASKS, strict=False):
        shapes = [(n, rows_of[task](w), w, arc) for n, w, arc in SHAPES]
        _draw_fitness(place, rows, task, shapes)
        confounded = "\n(eyes of one row; finer eyes are lower)" if task == "navigation" else "\n(square eyes)"
        place.set_title(f"{task}{confounded}", fontsize=11)
    _draw_lights(axes[0, 2], first)
    squares = [(n, w, w, arc) for n, w, arc in SHAPES]
    _draw_fitness(axes[1, 0], rows, "navigation", squares)
    axes[1, 0].set_title("control, navigation: square eyes, 45° high\n(published default)", fontsize=11)
    _draw_heights(axes[1, 1], rows)
    _draw_difference(axes[1, 2], rows)
    for place in (axes[0, 0], axes[1, 0], axes[1, 1]):
        place.axhline(
            full_return("navigation"), color="#444444", lw=0.9, ls="--", label="ceiling: straight path to the goal"
        )
        place.set_ylim(top=140)
        place.legend(
            fontsize=8,
            framealpha=0.9,
            loc="center right" if place is axes[0, 0] else "lower left" if place is axes[1, 0] else "lower right",
        )
    axes[0, 1].legend(fontsize=8, frameon=False)
    figure.suptitle(height_message(rows))
    save(figure, path)


def height_message(rows: Sequence[Trained]) -> str:
    """Return the title, which states whether fine eyes are worse in navigation if they are low, and if they are high.

    A difference counts only if its interval excludes 0 and its size exceeds MATTERS.
    """
    behind = []
    for mine in (with_rows(rows), with_squares(rows)):
        found = by_light(mine).get(BRIGHT)
        if found is None:
            return "Fitness of eyes in each task"
        difference = found.differences["navigation"]
        behind.append(difference.high < 0 and difference.mean < -MATTERS * full_return("navigation"))
    if behind == [True, False]:
        return "Fine eyes are worse in navigation if they are low, but not if they are 45° high"
    return "Fine eyes are worse in navigation at any height" if all(behind) else "Fitness of eyes in each task"


def _draw_fitness(
    place: Any, rows: Sequence[Trained], task: str, shapes: Sequence[tuple[int, int, int, float]]
) -> None:
    """Draw a bar per animal and a dot per training run."""
    for x, shape in enumerate(shapes):
        found = [row.fitness for row in eyes_of(rows, task, shape)]
        label = ("mean", "one training run") if x == 0 else (None, None)
        height = np.mean(found) if found else 0.0
        place.bar(x, height, color=COLORS[task], alpha=0.35, width=0.7, label=label[0])
        place.plot([x] * len(found), found, "o", color=COLORS[task], ms=4, label=label[1])
    names = [shape_name(*shape).replace(" over ", "\nover ") for shape in shapes]
    place.set_xticks(range(len(shapes)), names, fontsize=8)
    place.set(ylabel="fitness")
    place.axhline(0, color="#777777", lw=0.6)


def _draw_lights(place: Any, rows: Sequence[Trained]) -> None:
    """Draw the difference between the two kinds of eyes in each light, for the original design."""
    crossings = by_light(rows)
    for task in TASKS:
        ahead = [found.differences[task] for found in crossings.values()]
        y = [one.mean for one in ahead]
        error = [[one.mean - one.low for one in ahead], [one.high - one.mean for one in ahead]]
        place.errorbar(list(crossings), y, error, color=COLORS[task], marker="o", capsize=3, label=task)
    place.axhline(0, color="#777777", lw=0.6)
    place.set(
        xscale="log", xlabel="noise σ of a receptor (dimmer light: →)", ylabel="fitness, two of 15 minus ten of 4"
    )
    place.set_title(f"navigators with rows:\n{light_message(crossings)}", fontsize=11)
    place.legend(fontsize=8, frameon=False)


def light_message(crossings: Mapping[float, Crossing]) -> str:
    """Return a title that states whether the better eyes in bright light are significantly worse in dimmer light."""
    if len(crossings) < 2:
        return "in dim light"
    bright, *dim = (crossings[sigma].differences for sigma in sorted(crossings))
    turned = any(
        (one[task].high < 0 < bright[task].mean) or (bright[task].mean < 0 < one[task].low)
        for one in dim
        for task in TASKS
    )
    return "dim light reverses the order" if turned else "dim light does not reverse the order"


def _draw_heights(place: Any, rows: Sequence[Trained]) -> None:
    """Draw the fitness of every navigator over the height of its eyes."""
    shapes = sorted({(n, 1, w, arc) for n, w, arc in SHAPES} | set(CONTROLS))
    for fine, marker in ((True, "s"), (False, "o")):
        mine = [shape for shape in shapes if (shape[2] == CAMERA[1]) == fine]
        found = [
            (FOV_DEG * h / w, row.fitness)
            for n, h, w, arc in mine
            for row in eyes_of(rows, "navigation", (n, h, w, arc))
        ]
        label = "15 receptors across" if fine else "3 to 8 across"
        place.plot(
            *zip(*found, strict=True) if found else ([], []),
            marker,
            color="#D55E00" if fine else "#999999",
            ms=4,
            label=label,
        )
    place.set(xscale="log", xlabel="height of an eye [°]", ylabel="fitness in navigation")
    place.set_xticks([3, 6, 12, 24, 45], ["3", "6", "12", "24", "45"])
    place.minorticks_off()
    place.set_title("all navigators:\nheight of the eye and fitness", fontsize=11)


def _draw_difference(place: Any, rows: Sequence[Trained]) -> None:
    """Draw the fitness with two eyes of 15 receptors minus the fitness with ten eyes of 4.

    It is drawn for rows of receptors and for square eyes, in bright light.
    """
    kinds = {"navigators\nwith rows": with_rows(rows), "square eyes\nin both": with_squares(rows)}
    for task, aside in zip(TASKS, (-0.08, 0.08), strict=True):
        found = [(x, by_light(mine).get(BRIGHT)) for x, mine in enumerate(kinds.values())]
        ahead = [(x + aside, one.differences[task]) for x, one in found if one is not None]
        error = [[d.mean - d.low for _, d in ahead], [d.high - d.mean for _, d in ahead]]
        place.errorbar(
            [x for x, _ in ahead], [d.mean for _, d in ahead], error, color=COLORS[task], fmt="o", capsize=3, label=task
        )
    place.axhline(0, color="#777777", lw=0.6)
    place.set_xticks(range(len(kinds)), list(kinds), fontsize=9)
    place.set(ylabel="fitness, two of 15 minus ten of 4", xlim=(-0.5, len(kinds) - 0.5))
    place.set_title("bright light:\nthe difference in both designs", fontsize=11)
    place.legend(fontsize=8, frameon=False)
