"""Eyes for tasks: training of the same animals in two tasks, in bright and dim light

python -m experiments.eyes_for_tasks [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

import numpy as np

from experiments import designed, eyes_for_tasks_figure
from experiments.candidates import full_return
from experiments.crossing import RESAMPLES, Crossing, by_light
from experiments.designed import Trained
from experiments.eye_shapes import (
    BRIGHT,
    CONTROLS,
    FOV_DEG,
    SHAPES,
    TASKS,
    designs,
    eyes_of,
    lights,
    shape_name,
    with_rows,
    with_squares,
)
from experiments.page import Figure, Page, markdown_table
from experiments.store import Origin

__all__ = ["controls_table", "crossings_table", "designs", "page"]

NAME = "eyes_for_tasks"
SETTINGS = ("learning.total_steps=150000", "learning.eval_interval=50000")


def page(rows: Sequence[Trained], origin: Origin, answer: str) -> Page:
    """Return the page of results, made from stored rows."""
    designed_rows = with_rows(rows)
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": answer,
            "steps": f"{max(row.steps for row in rows):,}",
            "lives": ", ".join(_lives(designed_rows, sigma) for sigma in lights(rows)),
            "fitness": _table(designed_rows, lambda row: row.fitness),
            "success": _table(designed_rows, lambda row: row.success_rate),
            "crossings": crossings_table(rows),
            "controls": controls_table(rows),
            "ceiling": f"{full_return('navigation'):.1f}",
            "resamples": f"{RESAMPLES:,}",
        },
        figures=[Figure(NAME, lambda path: eyes_for_tasks_figure.draw(rows, path))],
        origin=origin,
    )


def _lives(rows: Sequence[Trained], sigma: float) -> str:
    """Return the number of training runs per animal in this light as text, without animals that have none."""
    counts = [len(_cell(rows, task, sigma, shape)) for task in TASKS for shape in SHAPES]
    least, most = min(filter(None, counts)), max(counts)
    return f"{least}{f' to {most}' if most > least else ''} at σ = {sigma:g}"


def _table(rows: Sequence[Trained], value: Callable[[Trained], float]) -> str:
    """Return a table of a value, with a row per animal: mean and range over seeds in each task and light."""
    found_lights = lights(rows)
    header = ["eyes", *(f"{task}, σ = {sigma:g}" for task in TASKS for sigma in found_lights)]
    lines = []
    for n, w, arc in SHAPES:
        cells = []
        for task in TASKS:
            for sigma in found_lights:
                found = [value(row) for row in _cell(rows, task, sigma, (n, w, arc))]
                cells.append(f"{np.mean(found):.3g} [{min(found):.3g}, {max(found):.3g}]" if found else "-")
        lines.append([_named(n, w, arc), *cells])
    return markdown_table(header, lines)


def _cell(rows: Sequence[Trained], task: str, sigma: float, shape: tuple[int, int, float]) -> list[Trained]:
    return [
        row
        for row in rows
        if not row.failed
        and row.task == task
        and row.noise_sigma == sigma
        and (row.n_eyes, row.width, row.placement_range_deg) == shape
    ]


def _named(n: int, w: int, arc: float) -> str:
    return f"{n} of {w} over {arc:g}°" if n > 1 else f"{n} of {w}"


def crossings_table(rows: Sequence[Trained]) -> str:
    """Return the table of differences between camera eyes and compound eyes.

    The first row has square eyes in both tasks. In the other rows, one for each light, navigators' eyes are one row of
    receptors, so that their fineness and their height differ together.
    """
    square = by_light(with_squares(rows)).get(BRIGHT)
    lines = [[f"σ = {BRIGHT:g}, square eyes in both tasks", *_cells(square)]]
    crossings = by_light(with_rows(rows))
    lines += [[f"σ = {sigma:g}, navigators with rows", *_cells(crossings.get(sigma))] for sigma in lights(rows)]
    header = ["light and eyes", *(f"{task}: two of 15 minus ten of 4" for task in TASKS), "interaction", "p"]
    return markdown_table(header, lines)


def _cells(found: Crossing | None) -> list[str]:
    if found is None:
        return ["-"] * (len(TASKS) + 2)
    return [*(str(found.differences[task]) for task in TASKS), str(found.interaction), f"{found.p:.2g}"]


def controls_table(rows: Sequence[Trained]) -> str:
    """Return a table of navigation in bright light with all tested heights of eyes, including rows."""
    lines = []
    for n, h, w, arc in sorted(
        {(n, 1, w, arc) for n, w, arc in SHAPES} | set(CONTROLS), key=lambda one: (-one[1] / one[2], -one[0], one)
    ):
        found = eyes_of(rows, "navigation", (n, h, w, arc))
        fitness = "-"
        if found:
            values = [row.fitness for row in found]
            fitness = f"{np.mean(values):.3g} [{min(values):.3g}, {max(values):.3g}]"
        success = f"{np.mean([row.success_rate for row in found]):.2f}" if found else "-"
        receptor = FOV_DEG / w
        lines.append(
            [shape_name(n, h, w, arc), f"{h * receptor:.3g}", f"{receptor:.3g}", str(len(found)), fitness, success]
        )
    header = ["eyes", "height of an eye [°]", "of a receptor [°]", "training runs", "fitness", "goal reached"]
    return markdown_table(header, lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Train missing animals if requested; make the page from the stored rows."""
    return designed.main(designed.Experiment(NAME, __doc__ or "", designs, SETTINGS, page), arguments)


if __name__ == "__main__":
    sys.exit(main())
