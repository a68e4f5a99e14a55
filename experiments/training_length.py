"""Length of training runs: do shorter ones rank animals as full ones do?

python -m experiments.training_length [--compute] [--workers N] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from experiments import designed
from experiments.designed import Design, Trained
from experiments.eye_factors_design import CAMERA, COMPOUND, LEARNER, TASKS, animals, in_task, runs_of
from experiments.means import mean_of
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.store import RECORDS, Origin, read_rows

__all__ = ["Agreement", "agreement", "page"]

NAME = "training_length"


def _scaled(steps: int, more: str = "") -> str:
    """Return settings of shorter training runs whose schedule is scaled with their length."""
    parts = f"total_steps={steps} eval_interval={steps} contact_ramp={steps // 2} decay_after={steps // 2} {more}"
    return " ".join(f"learning.{part}" for part in parts.split())


SEARCHES = {task: [RECORDS / f"course-{task}-{seed}" for seed in range(3)] for task in ("navigation", "detection")}
FULL = Path(__file__).parents[1] / "docs/results/data/eye_factors.csv"  # full training runs
PAIR, SEED = (COMPOUND, CAMERA), 0
COLORS = ("#D55E00", "#0072B2")
FIRST = "learning.total_steps=105000 learning.eval_interval=105000"  # trains for 106,496 steps
SCHEDULES = {
    "50,000 steps": _scaled(50_000),
    "75,000 steps": _scaled(75_000),
    "75,000 steps, half as many worlds": _scaled(75_000, "n_envs=64 batch_size=512"),
    "first 106,496 steps of a full one": FIRST,
}
EARLY = 6  # generations over which selection is compared; later candidates are too similar


@dataclass(frozen=True)
class Agreement:
    """Agreement of an evaluation during training with the fitness after training, averaged over generations.

    steps: training steps before the evaluation
    correlation: Spearman's rank correlation within a generation
    shared: fraction of a generation's fitter half by this evaluation that is also in the fitter half after training
    selected: mean of ln(receptors across / eyes) of the fitter half by this evaluation, minus that of all candidates,
        in the first EARLY generations
    by_fitness: the same for the fitter half after training
    """

    steps: int
    correlation: float
    shared: float
    selected: float
    by_fitness: float


def agreement(generations: Sequence[Sequence[Candidate]], evaluation: int) -> Agreement:
    """Return the agreement of one evaluation of the learning curve with fitness.

    generations: candidates of each generation
    evaluation: position in the learning curves
    """
    found = []
    for number, generation in enumerate(generations):
        known = [one for one in generation if one.failure is None and len(one.curve) > evaluation]
        before = np.array([one.curve[evaluation][1] for one in known])
        after = np.array([one.task_fitness for one in known])
        shape = np.array([math.log(one.phenotype.resolution[1] / one.phenotype.n_eyes) for one in known])
        first, last = _fitter_half(before), _fitter_half(after)
        shared = np.intersect1d(first, last).size / first.size
        moved = [shape[half].mean() - shape.mean() if number < EARLY else math.nan for half in (first, last)]
        found.append([spearmanr(before, after).statistic, shared, *moved])
    return Agreement(known[0].curve[evaluation][0], *map(float, np.nanmean(found, axis=0)))


def _fitter_half(values: np.ndarray) -> np.ndarray:
    order: np.ndarray = np.argsort(-values, kind="stable")[: values.size // 2]
    return order


def agreements() -> dict[str, list[Agreement]]:
    """Return the agreement of each evaluation in the stored searches, by task, averaged over the searches."""
    found = {}
    for task, folders in SEARCHES.items():
        runs = [Run.open(folder) for folder in folders]
        searches = [[run.generation(g) for g in range(run.config.search.generations)] for run in runs]
        evaluations = range(len(runs[0].candidates[0].curve))
        found[task] = [_mean([agreement(one, evaluation) for one in searches]) for evaluation in evaluations]
    return found


def _mean(found: Sequence[Agreement]) -> Agreement:
    means = (float(np.mean([getattr(one, field.name) for one in found])) for field in fields(Agreement)[1:])
    return Agreement(found[0].steps, *means)


def agreement_table(found: Mapping[str, Sequence[Agreement]]) -> str:
    """Return a table of agreements, with a row per task and evaluation."""
    lines = [
        [f"{task}, {one.steps:,}", *(f"{getattr(one, field.name):.2f}" for field in fields(one)[1:])]
        for task, evaluations in found.items()
        for one in evaluations
    ]
    header = ["steps", "rank correlation", "same half", "selected by evaluation", "selected by fitness"]
    return markdown_table(header, lines)


def draw(found: Mapping[str, Sequence[Agreement]], path: Path) -> None:
    """Draw the rank correlation and the selection on the shape of eyes over the number of training steps."""
    figure, axes = new_figure(9, 3.6, columns=2)
    for (task, evaluations), color in zip(found.items(), COLORS, strict=True):
        steps = [one.steps for one in evaluations]
        axes[0, 0].plot(steps, [one.correlation for one in evaluations], "o-", color=color, label=task)
        axes[0, 1].plot(steps, [one.selected for one in evaluations], "o-", color=color, label=task)
        axes[0, 1].axhline(evaluations[-1].by_fitness, color=color, ls="--", lw=0.8)
    axes[0, 0].set(xlabel="training steps", ylabel="rank correlation with fitness", ylim=(0, 1))
    axes[0, 1].set(xlabel="training steps", ylabel="selected ln(width / eyes)")
    axes[0, 0].legend(frameon=False)
    figure.suptitle("After two thirds of the training steps, the fitter half has almost the final eyes")
    save(figure, path)


def schedules_table(rows: Sequence[Trained], full: Sequence[Trained]) -> str:
    """Return a table of the fitness of two animals after shorter and after full training runs.

    rows, full: stored shorter and full training runs
    """
    lines = []
    for name, own in SCHEDULES.items():
        cells = (_single(rows, task, replace(animal, own=own)) for task in TASKS for animal in PAIR)
        lines.append([name, *("-" if one is None else f"{one:.3g}" for one in cells)])
    known = [np.array([row.fitness for row in runs_of(full, task, animal)]) for task in TASKS for animal in PAIR]
    lines.append(["full", *(str(mean_of(one)) for one in known)])
    eyes = [f"{task}, {one.n_eyes} of {one.height} x {one.width}" for task in TASKS for one in PAIR]
    return markdown_table(["training", *eyes], lines)


def ranked() -> tuple[Design, ...]:
    """Return the animals of the experiment on factors of eyes that could be candidates of a search.

    Their eyes are square, 45° high and wide.
    """
    shape = ("n_eyes", "height", "width", "placement_range_deg")
    return tuple(one for one in animals() if one == replace(COMPOUND, **{name: getattr(one, name) for name in shape}))


def ranks_table(rows: Sequence[Trained], full: Sequence[Trained]) -> str:
    """Return a table of rank correlations between single training runs and the means of full training runs.

    The fitness of a single run is compared with the mean fitness of full runs that have other seeds. In one column, the
    single run consists of the first 106,496 steps of a full one. In the other column, it is a full run.

    rows, full: stored shorter and full training runs
    """
    lines = []
    for task in TASKS:
        short = {animal: _single(rows, task, replace(animal, own=FIRST)) for animal in ranked()}
        known = [animal for animal, fitness in short.items() if fitness is not None]
        if len(known) < 3:
            continue
        others = [np.mean([r.fitness for r in runs_of(full, task, animal) if r.seed != SEED]) for animal in known]
        compared = [[short[animal] for animal in known], [_single(full, task, animal) for animal in known]]
        found = (spearmanr(one, others).statistic for one in compared)
        lines.append([task, str(len(known)), *(f"{one:.2f}" for one in found)])
    return markdown_table(["task", "animals", "106,496 steps", "full"], lines)


def _single(rows: Sequence[Trained], task: str, animal: Design) -> float | None:
    """Return the fitness of the training run with the seed SEED; None if it is not stored."""
    wanted = in_task(animal, task, SEED)
    return next((row.fitness for row in rows if row.design == wanted and not row.failed), None)


def designs() -> list[Design]:
    """Return the shorter training runs in both tasks: two animals per schedule, and more after 106,496 steps."""
    pairs = [in_task(replace(one, own=own), task, SEED) for own in SCHEDULES.values() for task in TASKS for one in PAIR]
    more = [in_task(replace(one, own=FIRST), task, SEED) for one in ranked() for task in TASKS]
    return list(dict.fromkeys([*pairs, *more]))


def page(rows: Sequence[Trained], origin: Origin, answer: str) -> Page:
    """Return the page of results, made from stored rows and from the records of searches."""
    full, found = read_rows(Trained, FULL), agreements()
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": answer,
            "agreement": agreement_table(found),
            "ranks": ranks_table(rows, full),
            "schedules": schedules_table(rows, full),
        },
        figures=[Figure(NAME, lambda path: draw(found, path))],
        origin=origin,
    )


EXPERIMENT = designed.Experiment(NAME, __doc__ or "", designs, LEARNER, page)

if __name__ == "__main__":
    sys.exit(designed.main(EXPERIMENT))
