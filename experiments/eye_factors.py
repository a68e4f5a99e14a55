"""Factors of eyes: number, resolution, arc and height, crossed in unseen layouts and in detection, with controls

python -m experiments.eye_factors [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments import designed, eye_factors_figure
from experiments.designed import Design, Trained
from experiments.eye_factors_design import (
    FACTORS,
    LEARNER,
    OTHERS,
    TASKS,
    Control,
    controls,
    designs,
    factorial,
    runs_of,
)
from experiments.eye_prices import PRICES, fittest, probability_of_finer
from experiments.factorial import Effects, effects
from experiments.means import Interval, mean_of
from experiments.page import Figure, Page, markdown_table
from experiments.store import Origin

__all__ = ["advantage", "effects_in", "page"]

NAME = "eye_factors"
NAMES = {
    "n_eyes": "ten eyes instead of two",
    "width": "15 x 15 receptors instead of 4 x 4",
    "placement_range_deg": "over 135° instead of 45°",
    "vertical_fov_deg": "45° high instead of 11.25°",
}


def page(rows: Sequence[Trained], origin: Origin, answer: str) -> Page:
    """Return the page of results, made from stored rows."""
    counts = sorted({len(runs_of(rows, task, cell)) for task in TASKS for cell in factorial()} - {0})
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": answer,
            "runs": " to ".join(str(count) for count in dict.fromkeys((counts[0], counts[-1]))),
            "steps": f"{max(row.steps for row in rows):,}",
            "fitness": _fitness_table(rows),
            "effects": _effects_table(rows),
            "controls": _controls_table(rows),
            "prices": _prices_table(rows),
        },
        figures=[Figure(NAME, lambda path: _draw(rows, path))],
        origin=origin,
    )


def _draw(rows: Sequence[Trained], path: Path) -> None:
    found = {task: one for task in TASKS if (one := effects_in(rows, task)) is not None}
    names = [(names, factor_name(names)) for names in next(iter(found.values())).of] if found else []
    compared = []
    for control in controls():
        by_task = {task: advantage(rows, task, control) for task in found}
        compared.append((control, {task: _in_units(one, found[task].spread) for task, one in by_task.items() if one}))
    eye_factors_figure.draw(found, names, compared, path)


def _in_units(interval: Interval, unit: float) -> Interval:
    return Interval(interval.mean / unit, interval.low / unit, interval.high / unit)


def effects_in(rows: Sequence[Trained], task: str) -> Effects | None:
    """Return the effects of the factors on the return in a task's test set; None if there are too few training runs."""
    mine = [row for cell in factorial() for row in runs_of(rows, task, cell)]
    levels = {name: [2 * high.index(getattr(row, name)) - 1 for row in mine] for name, high in FACTORS.items()}
    try:
        return effects(levels, [row.seed for row in mine], np.array([row.held_out for row in mine]))
    except ValueError:
        return None


def advantage(rows: Sequence[Trained], task: str, control: Control) -> Interval | None:
    """Return the mean return of many coarse eyes minus that of few fine ones; None with fewer than two pairs of runs.

    Runs with the same seed have the same layouts. They form pairs, so that differences between layouts cancel.
    """
    many, few = ({row.seed: row.held_out for row in runs_of(rows, task, one)} for one in (control.many, control.few))
    pairs = np.array([many[seed] - few[seed] for seed in sorted(many.keys() & few.keys())])
    return mean_of(pairs) if pairs.size > 1 else None


def factor_name(names: Sequence[str]) -> str:
    """Return the name of a factor, or of an interaction, for tables and figures."""
    return " x ".join(NAMES[name] if len(names) == 1 else NAMES[name].split(" instead")[0] for name in names)


def _fitness_table(rows: Sequence[Trained]) -> str:
    """Return a table of the mean return of each animal of the factorial design, and of the other animals."""
    lines = []
    for cell in (*factorial(), *OTHERS):
        found = [np.array([row.held_out for row in runs_of(rows, task, cell)]) for task in TASKS]
        eyes = [f"{cell.n_eyes}", f"{cell.height} x {cell.width}", f"{cell.placement_range_deg:g}"]
        means = [str(mean_of(one)) if one.size else "-" for one in found]
        lines.append([*eyes, f"{cell.vertical_fov_deg:g}", *means])
    return markdown_table(["eyes", "receptors of each", "over [°]", "height [°]", *TASKS], lines)


def _effects_table(rows: Sequence[Trained]) -> str:
    found = {task: effects_in(rows, task) for task in TASKS}
    known = {task: one for task, one in found.items() if one is not None}
    if not known:
        return "Too few training runs."
    names = next(iter(known.values())).of
    lines = [[factor_name(one), *(str(known[task].of[one]) for task in known)] for one in names]
    lines.append(["standard deviation of training runs [return]", *(f"{known[task].spread:.3g}" for task in known)])
    return markdown_table(["effect [standard deviations]", *known], lines)


def _controls_table(rows: Sequence[Trained]) -> str:
    lines = []
    for control in controls():
        found = [advantage(rows, task, control) for task in TASKS]
        lines.append([control.name, *("-" if one is None else str(one) for one in found)])
    return markdown_table(["comparison", *TASKS], lines)


def _prices_table(rows: Sequence[Trained]) -> str:
    """Return a table of the animal with the highest mean return minus costs in each task, for several prices."""
    returns = {task: _returns(rows, task) for task in TASKS}
    if not all(returns.values()):
        return "Too few training runs."
    lines, rng = [], np.random.default_rng(0)
    for prices in PRICES:
        best = [_eyes_of(fittest(returns[task], prices)) for task in TASKS]
        finer, coarser = probability_of_finer(returns["detection"], returns["maze"], prices, rng)
        lines.append([f"{prices.per_eye:g}", f"{prices.per_receptor:g}", *best, f"{finer:.2f}", f"{coarser:.2f}"])
    return markdown_table(["per eye", "per receptor", *TASKS, "finer", "coarser"], lines)


def _returns(rows: Sequence[Trained], task: str) -> dict[Design, np.ndarray]:
    """Return the returns of the training runs of each animal of the factorial design, by animal.

    Animals with fewer than two training runs are omitted.
    """
    found = {one: np.array([row.held_out for row in runs_of(rows, task, one)]) for one in (*factorial(), *OTHERS)}
    return {animal: values for animal, values in found.items() if values.size > 1}


def _eyes_of(animal: Design) -> str:
    size = f"{animal.n_eyes} of {animal.height} x {animal.width}"
    return f"{size} over {animal.placement_range_deg:g}°, {animal.vertical_fov_deg:g}° high"


EXPERIMENT = designed.Experiment(NAME, __doc__ or "", designs, LEARNER, page, tested=True)

if __name__ == "__main__":
    sys.exit(designed.main(EXPERIMENT))
