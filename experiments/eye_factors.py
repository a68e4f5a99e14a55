"""Factors of eyes: number, resolution, arc and height, combined in unseen mazes and in detection, with controls

python -m experiments.eye_factors [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments import designed, eye_factors_figure
from experiments.designed import Design, Trained
from experiments.eye_factors_design import LEARNER, OTHERS, TASKS, Control, controls, designs, factorial, runs_of
from experiments.eye_factors_estimates import advantage, differences, effects_in, in_units, spread_of_layouts
from experiments.eye_factors_power import BETWEEN, LOOKS, Claim, claims, needed, runs_for, verdict
from experiments.eye_prices import PRICES, fittest, probability_of_finer
from experiments.factorial import interaction_with_task
from experiments.means import mean_of
from experiments.page import Figure, Page, markdown_table
from experiments.store import Origin

__all__ = ["page"]

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
            "power": _power_table(rows),
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
        known = {task: in_units(one, found[task].spread) for task, one in by_task.items() if one}
        compared += [(control, known)] if known else []
    eye_factors_figure.draw(found, names, compared, path)


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
    """Return a table of effects in each task and between the tasks, with the state of each claim."""
    found = [effects_in(rows, task) for task in TASKS]
    if None in found:
        return "Too few training runs."
    first, second = (one for one in found if one is not None)
    between = interaction_with_task(first, second)
    decided = {(claim.task, claim.of): _decided(claim, rows) for claim in claims()}
    lines = []
    for names, effect in first.of.items():
        columns = zip((*TASKS, BETWEEN), (effect, second.of[names], between[names]), strict=True)
        lines.append([factor_name(names), *(f"{one}{decided.get((task, names), '')}" for task, one in columns)])
    spreads = (f"{one.spread:.3g}" for one in (first, second))
    lines.append(["standard deviation of training runs [return]", *spreads, ""])
    return markdown_table(["effect [standard deviations]", *TASKS, BETWEEN], lines)


def _decided(claim: Claim, rows: Sequence[Trained]) -> str:
    """Return the state of a claim, as the end of a table's cell."""
    found = verdict(claim, rows)
    states = {"negligible": "decided: small", "open": f"open, needs {runs_for(claim)}"}
    return f" ({states.get(found.state, 'decided')})"


def _controls_table(rows: Sequence[Trained]) -> str:
    decided = {(claim.task, claim.of): _decided(claim, rows) for claim in claims()}
    lines = []
    for control in controls():
        found = [(task, advantage(rows, task, control)) for task in TASKS]
        cells = ["-" if one is None else f"{one}{decided[task, control]}" for task, one in found]
        lines.append([control.name, *cells])
    return markdown_table(["comparison", *TASKS], lines)


def _power_table(rows: Sequence[Trained]) -> str:
    """Return a table: standard deviations in each task after the first planned tests, and training runs needed."""
    first = [row for row in rows if row.seed < LOOKS[0]]
    lines = []
    for task in TASKS:
        effects = effects_in(first, task)
        if effects is None:
            return "Too few training runs."
        pairs = [differences(first, task, one) for one in controls()]
        of_pairs = math.sqrt(float(np.mean([one.var(ddof=1) for one in pairs if one.size > 1])))
        needs = {kind: max(runs_for(one) for one in claims() if type(one.of) is kind) for kind in (tuple, Control)}
        lines.append(
            [
                task,
                *(f"{one:.3g}" for one in (effects.spread, spread_of_layouts(first, task), of_pairs)),
                *(str(runs) for runs in needs.values()),
            ]
        )
    header = [
        "training runs",
        "sets of layouts",
        "differences of pairs",
        "needed for effects",
        "needed for comparisons",
    ]
    return markdown_table(["task", *header], lines)


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
    """Return the returns of the training runs of each animal of the factorial design and of OTHERS, by animal.

    Animals with fewer than two training runs are omitted.
    """
    found = {one: np.array([row.held_out for row in runs_of(rows, task, one)]) for one in (*factorial(), *OTHERS)}
    return {animal: values for animal, values in found.items() if values.size > 1}


def _eyes_of(animal: Design) -> str:
    size = f"{animal.n_eyes} of {animal.height} x {animal.width}"
    return f"{size} over {animal.placement_range_deg:g}°, {animal.vertical_fov_deg:g}° high"


EXPERIMENT = designed.Experiment(NAME, __doc__ or "", designs, LEARNER, page, tested=True, needed=needed)

if __name__ == "__main__":
    sys.exit(designed.main(EXPERIMENT))
