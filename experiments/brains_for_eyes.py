"""Brains for eyes: training of all combinations of eye width and brain size in three tasks

python -m experiments.brains_for_eyes [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from evolve.analysis.acuity import acuity_cpd
from experiments import designed
from experiments.brains_and_acuity import label
from experiments.designed import Design, Trained
from experiments.means import mean_of
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.powers import PowerLaw, power_law
from experiments.store import Origin

__all__ = [
    "DEFINITIONS",
    "best_brains",
    "control_of",
    "designed_for",
    "designs",
    "frontier",
    "missed",
    "needed",
    "over_both",
    "page",
    "shortfall",
]

NAME = "brains_for_eyes"
WIDTHS = (1, 2, 4, 8, 16, 24)
BRAINS = (1, 4, 16, 64, 256)  # units of a hidden layer; encoders have a quarter of them
SEEDS = range(3)
SIGMA = 0.01
# Number of eyes and the arc over which they are spread, chosen so that each task can be learnt.
EYES = {"detection": (2, 45.0), "tracking": (2, 45.0), "navigation": (10, 135.0)}
PUBLISHED = {"navigation": 0.69, "detection": 0.74, "tracking": 0.59}
# Each training run is evaluated only once, because the 320 episodes take a sixth as many steps as the training itself.
# All training runs make ten passes throughout, without the schedule that lowers the number of passes.
SETTINGS = (
    *("learning.total_steps=500000", "learning.eval_interval=500000", "learning.least_epochs=10"),
    "evaluation.episodes=320",
)
# A navigator's eye is a row of receptors, and finer rows are less tall. Eyes of the control are equally wide and 45
# degrees high.
CONTROL_WIDTHS, CONTROL_BRAIN, CONTROL_SEEDS = (4, 8), 64, range(1)
IN_VAIN = {"navigation": "one row: finer eyes are lower"}
GAIN = 0.5  # choice: finer eyes count as better if their error is below this share of the coarsest eyes' error
SHADES = ("#c6dbef", "#9ecae1", "#6baed6", "#2171b5", "#08306b")  # brains from small to large
D = TypeVar("D", bound=Design)
Errors = dict[tuple[int, int], float]  # by width and brain
Definition = Callable[[Sequence[Trained]], Errors]


def designs() -> list[Design]:
    """Return all training runs, sorted by seed, with the control last."""
    n_eyes, arc = EYES["navigation"]
    control = [
        Design("navigation", n_eyes, w, w, arc, SIGMA, seed, neurons=CONTROL_BRAIN)
        for seed in CONTROL_SEEDS
        for w in CONTROL_WIDTHS
    ]
    crossed = [
        Design(task, n_eyes, 1 if task == "navigation" else w, w, arc, SIGMA, seed, neurons=brain)
        for seed in SEEDS
        for task, (n_eyes, arc) in EYES.items()
        for w in WIDTHS
        for brain in BRAINS
    ]
    return crossed + control


def _lives(rows: Iterable[Trained], value: Callable[[Trained], float]) -> dict[tuple[int, int], list[float]]:
    """Return the values of the training runs of each animal, without failed ones, by width and brain."""
    found: dict[tuple[int, int], list[float]] = {}
    for row in rows:
        if not row.failed:
            found.setdefault((row.width, row.neurons), []).append(value(row))
    return found


def missed(rows: Sequence[Trained]) -> Errors:
    """Return the share of episodes in which the goal was missed, by width and brain; see `brains_and_acuity.error`."""
    shares = _lives(rows, lambda row: ((1 - row.success_rate) * row.episodes + 0.5) / (row.episodes + 1))
    return {animal: float(np.mean(values)) for animal, values in shares.items()}


def shortfall(rows: Sequence[Trained]) -> Errors:
    """Return the shortfall in fitness of each animal, by width and brain.

    The shortfall of a training run is 0 for the best of all runs and 1 for the worst. The shortfall of an animal is the
    mean over its training runs and, so that it is never 0, one additional run with the shortfall 1/2.
    """
    fitness = [row.fitness for row in rows if not row.failed]
    high = max(fitness, default=0.0)
    scale = max(high - min(fitness, default=0.0), 1e-9)
    short = _lives(rows, lambda row: (high - row.fitness) / scale)
    return {animal: float((sum(values) + 0.5) / (len(values) + 1)) for animal, values in short.items()}


DEFINITIONS: dict[str, Definition] = {"episodes missed": missed, "fitness missed": shortfall}


def best_brains(errors: Errors) -> dict[int, tuple[int, float]]:
    """Return, for each width, the brain with the least error, and this error."""
    found = {}
    for width in sorted({w for w, _ in errors}):
        brain = min((b for w, b in errors if w == width), key=lambda b: errors[width, b])
        found[width] = brain, errors[width, brain]
    return found


def frontier(rows: Sequence[Trained], definition: Definition) -> PowerLaw | None:
    """Return the power law of the best brains' error over acuity; None if it cannot be fitted."""
    least = best_brains(definition(rows))
    return _law([error for _, error in least.values()], [_acuities(rows)[width] for width in least])


def over_both(rows: Sequence[Trained], definition: Definition) -> PowerLaw | None:
    """Return the power law of all errors over acuity and units of the brain; None if it cannot be fitted."""
    errors, acuity = definition(rows), _acuities(rows)
    return _law(list(errors.values()), [acuity[w] for w, _ in errors], [float(b) for _, b in errors])


def _law(errors: Sequence[float], *sizes: Sequence[float]) -> PowerLaw | None:
    try:
        return power_law(np.array(errors), *map(np.array, sizes))
    except ValueError:
        return None


def _acuities(rows: Iterable[Trained]) -> dict[int, float]:
    """Return the acuity of each width [cycles/degree]."""
    return {row.width: acuity_cpd(row.animal) for row in rows}


def page(rows: Sequence[Trained], origin: Origin, answer: str) -> Page:
    """Return the page of results, made from stored rows."""
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": answer,
            "steps": f"{max(row.steps for row in rows):,}",
            "episodes": str(min(row.episodes for row in rows)),
            "errors": _errors_table(rows),
            "exponents": _exponents(rows),
            "lives": ", ".join(f"{len(designed_for(rows, task))} in {task}" for task in _tasks(rows)),
        },
        figures=[Figure(NAME, lambda path: draw(rows, path))],
        origin=origin,
    )


def designed_for(rows: Iterable[D], task: str) -> list[D]:
    """Return the rows of a task without the control."""
    return [row for row in rows if row.task == task and (task != "navigation" or row.height == 1)]


def control_of(rows: Iterable[D]) -> list[D]:
    """Return the rows of the control: navigators whose eyes are 45 degrees high at any width."""
    return [row for row in rows if row.task == "navigation" and row.height == row.width > 1]


def _tasks(rows: Iterable[Trained]) -> list[str]:
    return [task for task in EYES if designed_for(rows, task)]


def _errors_table(rows: Sequence[Trained]) -> str:
    """Return a table of errors, with a row per task and brain and a column per width of the eyes."""
    lines = []
    for task in _tasks(rows):
        errors = missed(designed_for(rows, task))
        for brain in BRAINS:
            shown = [f"{errors[w, brain]:.3f}" if (w, brain) in errors else "-" for w in WIDTHS]
            lines.append([task, str(brain), *shown])
    control = missed(control_of(rows))
    shown = [f"{control[w, CONTROL_BRAIN]:.3f}" if (w, CONTROL_BRAIN) in control else "-" for w in WIDTHS]
    lines.append(["control: navigation, square eyes", str(CONTROL_BRAIN), *shown])
    return markdown_table(["task", "units", *(f"{w} across" for w in WIDTHS)], lines)


def _exponents(rows: Sequence[Trained]) -> str:
    """Return a table of the exponents of power laws, with a row per task and definition of the error."""
    lines = []
    for task in _tasks(rows):
        for name, definition in DEFINITIONS.items():
            mine = designed_for(rows, task)
            best, both = frontier(mine, definition), over_both(mine, definition)
            found = ["-", "-", "-"] if both is None else [*map(str, both.exponents), f"{both.explained:.2f}"]
            first = ["-" if best is None else str(best.exponents[0]), _over_runs(mine, definition)]
            lines.append([task, name, *first, *found, f"{PUBLISHED[task]:g}"])
    of_all = ("of acuity", "of units", "variance explained")
    return markdown_table(
        ["task", "error", "of acuity, best brains", "over training runs", *of_all, "published"], lines
    )


def _over_runs(rows: Sequence[Trained], definition: Definition) -> str:
    """Return as text the best brains' exponent of acuity: mean and Student's interval of fits to single seeds."""
    laws = [frontier([row for row in rows if row.seed == seed], definition) for seed in sorted({r.seed for r in rows})]
    found = np.array([law.exponents[0].mean for law in laws if law is not None])
    return str(mean_of(found)) if found.size > 1 else "-"


def draw(rows: Sequence[Trained], path: Path) -> None:
    """Draw a panel per task: error over acuity with a line per brain, and the power law of the best brains."""
    tasks = _tasks(rows)
    figure, axes = new_figure(3.6 * len(tasks) + 0.5, 4.2, columns=len(tasks), sharey=True)
    for place, task in zip(axes[0], tasks, strict=True):
        mine = designed_for(rows, task)
        errors, acuity = missed(mine), _acuities(mine)
        for brain, shade in zip(BRAINS, SHADES, strict=True):
            widths = [w for w in WIDTHS if (w, brain) in errors]
            ends = [errors[w, brain] for w in widths]
            place.loglog([acuity[w] for w in widths], ends, "o-", color=shade, ms=4, lw=1)
        _draw_frontier(place, mine)
        if task == "navigation" and (control := control_of(rows)):
            errors = missed(control)
            ends = [(acuity[w], error) for (w, _), error in sorted(errors.items())]
            place.loglog(*zip(*ends, strict=True), "s--", color="#009E73", ms=5, lw=1)
        place.set(title=_of_task(task, mine), xlabel="acuity [cycles/°]")
        label(place.xaxis, place.get_xlim())
        label(place.yaxis, place.get_ylim())
    axes[0, 0].set_ylabel("fraction of episodes missed")
    figure.legend(handles=_key(), loc="outside lower center", ncols=7, frameon=False)
    figure.suptitle(_message(rows))
    save(figure, path)


def needed(rows: Sequence[Trained]) -> int | None:
    """Return the smallest brain for which finer eyes are better; None if there is none.

    With this brain and all larger ones, the finest eyes miss less than half of the episodes that the coarsest eyes miss
    with their best brain.
    """
    errors, found = missed(rows), None
    _, coarsest = min(best_brains(errors).items())[1]
    for brain in sorted({b for _, b in errors}, reverse=True):
        widths = [w for w, b in errors if b == brain]
        if errors[max(widths), brain] >= GAIN * coarsest:
            break
        found = brain
    return found


def _of_task(task: str, rows: Sequence[Trained]) -> str:
    brain = needed(rows)
    return (
        f"{task}\n{IN_VAIN.get(task, 'finer eyes are not better')}"
        if brain is None
        else f"{task}\nfiner eyes better with ≥ {brain} units"
    )


def _message(rows: Sequence[Trained]) -> str:
    least = min(row.neurons for row in rows)
    brains = {task: needed(designed_for(rows, task)) for task in _tasks(rows)}
    in_vain = [task for task, brain in brains.items() if brain is None]
    if len(in_vain) == len(brains) or least in brains.values():
        return "Error over acuity for brains of each size"
    besides = f"; not in {' and '.join(in_vain)}" if in_vain else ""
    besides += ", where finer eyes are lower" if "navigation" in in_vain else ""
    return f"Finer eyes are better only with a sufficiently large brain{besides}"


def _draw_frontier(place: Any, rows: Sequence[Trained]) -> None:
    """Draw the power law of the best brains, if error falls with acuity."""
    law, acuity = frontier(rows, missed), np.array(sorted(_acuities(rows).values()))
    if law is not None and law.exponents[0].low > 0:
        place.loglog(acuity, law.error(acuity), color="#D55E00", lw=1.4, ls="--")


def _key() -> list[Any]:
    from matplotlib.lines import Line2D

    brains = [
        Line2D([], [], color=shade, marker="o", ms=4, label=f"{brain} unit{'s' * (brain > 1)}")
        for brain, shade in zip(BRAINS, SHADES, strict=True)
    ]
    law = Line2D([], [], color="#D55E00", ls="--", label="power law of the best")
    square = f"control: square eyes, {CONTROL_BRAIN} units"
    return [*brains, law, Line2D([], [], color="#009E73", marker="s", ls="--", label=square)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Train missing animals if requested; make the page from the stored rows."""
    return designed.main(designed.Experiment(NAME, __doc__ or "", designs, SETTINGS, page), arguments)


if __name__ == "__main__":
    sys.exit(main())
