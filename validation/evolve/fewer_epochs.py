"""Fewer epochs late in training: less CPU time at the same return

Do fewer epochs late in training save time without loss of return? Yes: they save 8 % of the CPU time in detection, 8 %
in tracking and 16 % in navigation. The mean returns in these tasks change by +4.2 ± 1.6, +6.9 ± 3.0 and -0.0 ± 0.2,
respectively.

**Method.** An epoch is one pass over the samples of an update. After `decay_after` training steps, learning slows down:
the change of the weights per update has to fall in inverse proportion to the number of steps so far. There are two ways
to achieve this: smaller optimiser steps in the same number of epochs, or optimiser steps of the same size in fewer
epochs. The second way moves the weights about as far in less time. Up to 150,000 training steps, both ways reduce the
optimiser step to half its initial size, and give bit-identical results. From then on, the first way reduces the
optimiser step further. The second way reduces the number of epochs instead, from 10 to 3 (`least_epochs`).

Each row compares the same training runs (task, seed, eyes) with a constant and with a falling number of epochs. All
runs have 500,000 steps, a receptor noise of σ = 0.01, eyes 45° wide with perfect lenses, and networks of 64 units. In
detection and tracking the animals have two eyes of 8 x 8 receptors, in navigation ten eyes of 1 x 4. All runs were made
on the same machine, which did other work as well.

**Table.** "runs" is the number of training runs of each kind. "return" is the mean over all evaluations (96 episodes
every 50,000 steps), which measures the area under the learning curve. "goal first" is the fraction of the final
evaluation's episodes in which the goal is reached, and reached before any adversary. Arrows lead from a constant to a
falling number of epochs. Differences have standard errors over the training runs. "CPU s" is the CPU time of a whole
training run, evaluations included. The figure shows CPU time within a training run, computed from the two totals and
the number of epochs.

**Bounds.** In no task does the mean return fall by more than two standard errors. In every task, CPU time falls by at
least a twentieth.

**Limits.** The saving is limited, because on average only three of ten epochs are omitted over a training run of this
length. Everything else takes as long as before, including the ten evaluations of a training run. In navigation, the
animals have learnt the task after 150,000 steps and the return cannot rise further, so only the time differs. In a
training run of a million steps, updates have five epochs on average.

Training runs take minutes each, so their results are stored (`docs/validation/data/fewer_epochs.csv`). The page is
written from the stored results.

    python -m validation.evolve.fewer_epochs [--train] [--seeds N ...] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import csv
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from evolve.config.assemble import assemble
from evolve.genome.phenotype import Phenotype
from evolve.learning.fitness import evaluate
from evolve.learning.schedule import mean_passes
from validation.pages.page import Page, parser
from validation.pages.tables import write_table
from validation.pages.work_precision_chart import MUTED, OURS

STORED = Path("docs/validation/data/fewer_epochs.csv")
EYES = {"detection": (2, (8, 8), 45.0), "tracking": (2, (8, 8), 45.0), "navigation": (10, (1, 4), 135.0)}
THROUGHOUT, FEWER = 10, 3  # fewest epochs
INTERVAL = 50_000  # steps between evaluations
SETTINGS = (
    *("eye.optics=false", "eye.noise_sigma=0.01", "learning.total_steps=500000", f"learning.eval_interval={INTERVAL}"),
    *("learning.patience=1000", "evaluation.episodes=96"),
)
LEAST_SAVED = 0.05  # share of the CPU time


@dataclass(frozen=True)
class Life:
    """A training run.

    curve: mean returns of its evaluations, one every INTERVAL steps.
    """

    task: str
    seed: int
    least_epochs: int
    cpu_seconds: float
    fitness: float
    success_rate: float
    curve: tuple[float, ...]


def lived(task: str, seed: int, least_epochs: int) -> Life:
    """Run a training and return its results."""
    n_eyes, resolution, arc = EYES[task]
    animal = Phenotype(n_eyes, arc, 45.0, resolution, None, None, None, memory_frames=5, neurons=64)
    config = assemble(task, assignments=(*SETTINGS, f"learning.least_epochs={least_epochs}"))
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        outcome = evaluate(animal, config, seed, Path(folder) / "policy.safetensors")
    curve = tuple(value for _, value in outcome.curve)
    return Life(task, seed, least_epochs, time.process_time() - began, outcome.fitness, outcome.success_rate, curve)


def read(path: Path) -> list[Life]:
    """Return all stored training runs."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [_life(line) for line in csv.DictReader(file)]


def _life(line: Mapping[str, str]) -> Life:
    return Life(
        task=line["task"],
        seed=int(line["seed"]),
        least_epochs=int(line["least_epochs"]),
        cpu_seconds=float(line["cpu_seconds"]),
        fitness=float(line["fitness"]),
        success_rate=float(line["success_rate"]),
        curve=tuple(map(float, line["curve"].split())),
    )


def write(lives: Sequence[Life], path: Path) -> None:
    """Write all training runs atomically."""
    ordered = sorted(lives, key=lambda life: (life.task, life.seed, -life.least_epochs))
    numbers = ("cpu_seconds", "fitness", "success_rate")
    rows = [
        asdict(life)
        | {name: f"{getattr(life, name):.5g}" for name in numbers}
        | {"curve": " ".join(f"{value:.5g}" for value in life.curve)}
        for life in ordered
    ]
    write_table(path, rows)


def pairs(lives: Sequence[Life], task: str) -> list[tuple[Life, Life]]:
    """Return pairs of training runs for every seed that was trained in both ways: constant epochs, and fewer epochs."""
    found = {(life.seed, life.least_epochs): life for life in lives if life.task == task}
    seeds = sorted({seed for seed, _ in found})
    both = [(found.get((seed, THROUGHOUT)), found.get((seed, FEWER))) for seed in seeds]
    return [(old, new) for old, new in both if old is not None and new is not None]


@dataclass(frozen=True)
class Comparison:
    """Results of a task's training runs with constant and with fewer epochs. Pairs of numbers are in this order.

    returns: mean returns.
    gain, error: mean difference of the returns, and its standard error.
    goals: fractions of episodes in which the goal was reached first.
    cpu: CPU times [s].
    """

    returns: tuple[float, float]
    gain: float
    error: float
    goals: tuple[float, float]
    cpu: tuple[float, float]


def compared(both: Sequence[tuple[Life, Life]]) -> Comparison:
    """Compare two or more pairs of training runs."""
    areas = np.array([[np.mean(life.curve) for life in pair] for pair in both])
    gains = areas[:, 1] - areas[:, 0]
    goals, cpu = (
        np.mean([[getattr(life, name) for life in pair] for pair in both], axis=0)
        for name in ("success_rate", "cpu_seconds")
    )
    return Comparison(
        tuple(areas.mean(axis=0)), gains.mean(), gains.std(ddof=1) / len(gains) ** 0.5, tuple(goals), tuple(cpu)
    )


def table(lives: Sequence[Life]) -> str:
    """Return a line per task."""
    lines = [f"{'task':12}{'runs':>6}{'return':>16}{'difference':>14}{'goal first':>16}{'CPU s':>14}{'saved':>7}"]
    for task in EYES:
        both = pairs(lives, task)
        if len(both) < 2:
            continue
        found = compared(both)
        shown = [
            f"{a:.{digits}f} -> {b:.{digits}f}"
            for (a, b), digits in zip((found.returns, found.goals, found.cpu), (1, 2, 0), strict=True)
        ]
        saved = 1 - found.cpu[1] / found.cpu[0]
        lines.append(
            f"{task:12}{len(both):6}{shown[0]:>16}{f'{found.gain:+.1f} ± {found.error:.1f}':>14}{shown[1]:>16}"
            f"{shown[2]:>14}{saved:>7.0%}"
        )
    return "\n".join(lines)


def verdicts(lives: Sequence[Life]) -> list[str]:
    """Return the descriptions of the bounds that the stored training runs violate."""
    broken = []
    for task in EYES:
        both = pairs(lives, task)
        if len(both) < 5:
            broken.append(f"{task}: {len(both)} training runs in both ways, five are required")
            continue
        found = compared(both)
        if found.gain < -2 * found.error:
            broken.append(f"{task}: fewer epochs reduce the return, by {-found.gain:.1f} ± {found.error:.1f}")
        if found.cpu[1] > (1 - LEAST_SAVED) * found.cpu[0]:
            broken.append(f"{task}: fewer epochs save less than {LEAST_SAVED:.0%} of the time")
    return broken


def passes_until(task: str, least_epochs: int, evaluations: int) -> np.ndarray:
    """Return the mean number of epochs in the updates before each evaluation, (evaluation,)."""
    learning = assemble(task, assignments=(*SETTINGS, f"learning.least_epochs={least_epochs}")).learning
    return np.array([mean_passes(learning, n * INTERVAL, (n + 1) * INTERVAL) for n in range(evaluations)])


def seconds(task: str, cpu: tuple[float, float], evaluations: int) -> np.ndarray:
    """Return the CPU time until each evaluation, (way, evaluation).

    The ways are constant and fewer epochs. All epochs are assumed to take the same time, and so is all other work per
    step.
    """
    passes = np.array([passes_until(task, least, evaluations) for least in (THROUGHOUT, FEWER)])
    (old, new), saved = passes.mean(axis=1), cpu[0] - cpu[1]
    per_pass = saved / (old - new)
    return np.cumsum((cpu[0] - per_pass * old + per_pass * passes) / evaluations, axis=1)


def draw(lives: Sequence[Life], path: Path) -> None:
    """Draw a panel per task: return over CPU time, training runs thin and their means thick."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(EYES), figsize=(11, 3.8), layout="constrained")
    for place, task in zip(axes, EYES, strict=True):
        both = pairs(lives, task)
        if len(both) > 1:
            curves = np.array([[life.curve for life in pair] for pair in both])
            times = seconds(task, compared(both).cpu, curves.shape[2])
            for way, (colour, label) in enumerate(((MUTED, "ten epochs, smaller steps"), (OURS, "fewer epochs"))):
                place.plot(times[way], curves[:, way].T, color=colour, lw=0.5, alpha=0.6)
                place.plot(times[way], curves[:, way].mean(axis=0), color=colour, lw=2, label=label)
        place.set(title=task, xlabel="CPU time [s]", xlim=(0, None))
        place.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("mean return of an evaluation")
    axes[0].legend(frameon=False, loc="lower right")
    figure.suptitle("Fewer epochs late in training: the same return in less time")
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Train missing runs on request, then write the page of all stored results."""
    options_parser = parser(__doc__ or "")
    options_parser.add_argument("--train", action="store_true", help="run the training that is missing in the store")
    options_parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2, 3, 4], help="seeds of training runs")
    options_parser.add_argument("--stored", type=Path, default=STORED, help="file of the stored training runs")
    options = options_parser.parse_args(arguments)
    lives = read(options.stored)
    wanted = [(t, s, p) for s in options.seeds for t in EYES for p in (THROUGHOUT, FEWER)] if options.train else []
    for each in wanted:
        if each not in {(life.task, life.seed, life.least_epochs) for life in lives}:
            lives.append(lived(*each))
            write(lives, options.stored)
            print(lives[-1], flush=True)
    page = Page("fewer_epochs", __doc__ or "", table(lives), verdicts(lives))
    return page.publish(options, lambda path: draw(lives, path))


if __name__ == "__main__":
    sys.exit(main())
