"""Fewer passes late in a training cost less and teach no less (E3)

After `decay_after` steps a learner slows down as one over the steps. It can take smaller steps in as many passes over
the samples of an update, or steps as large as before in fewer passes, which move the weights about as far for less
time. The learner does the second as soon as its steps are half as large as at first, after 150,000 steps, until
`least_epochs` (3) of its 10 passes are left. Up to there both ways are one, to the last bit.

Every line compares the same lives (task, seed, eyes) trained in both ways: 500,000 steps, σ = 0.01, perfect lenses 45°
wide, brains of 64 units; two eyes of 8 x 8 in detection and tracking, ten of 1 x 4 in navigation. "Return" is the mean
over the evaluations of 96 episodes each, every 50,000 steps: the area under the learning curve. Differences have
standard errors over the lives. CPU is that of a whole training, evaluations included; both ways ran on the same
machine, which did other work as well. How it is spread over a training follows from the two totals and the passes.
Navigators know their way after 150,000 steps and can earn no more, so that there only the time differs. The ten
evaluations of a training take as long in both ways; a training of a million steps makes five passes on average.

Bounds: no task's mean return falls by more than two standard errors, and CPU time falls by a twentieth at least.
A tenth was hoped for, and is missed in two tasks: three in ten passes are spared, and the rest takes its time.

Trainings are stored (`docs/validation/data/fewer_epochs.csv`), because they take minutes each; the page comes from the
store.

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
THROUGHOUT, FEWER = 10, 3  # passes that are left
INTERVAL = 50_000  # steps between evaluations
SETTINGS = (
    *("eye.optics=false", "eye.noise_sigma=0.01", "learning.total_steps=500000", f"learning.eval_interval={INTERVAL}"),
    *("learning.patience=1000", "evaluation.episodes=96"),
)
LEAST_SAVED = 0.05  # of the CPU time


@dataclass(frozen=True)
class Life:
    """A training; curve: mean returns of its evaluations, one every INTERVAL steps."""

    task: str
    seed: int
    least_epochs: int
    cpu_seconds: float
    fitness: float
    success_rate: float
    curve: tuple[float, ...]


def lived(task: str, seed: int, least_epochs: int) -> Life:
    """The training, carried out."""
    n_eyes, resolution, arc = EYES[task]
    animal = Phenotype(n_eyes, arc, 45.0, resolution, None, None, None, memory_frames=5, neurons=64)
    config = assemble(task, assignments=(*SETTINGS, f"learning.least_epochs={least_epochs}"))
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        outcome = evaluate(animal, config, seed, Path(folder) / "policy.safetensors")
    curve = tuple(value for _, value in outcome.curve)
    return Life(task, seed, least_epochs, time.process_time() - began, outcome.fitness, outcome.success_rate, curve)


def read(path: Path) -> list[Life]:
    """All that are stored."""
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
    """All of them, whole or not at all."""
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
    """Of every seed that was trained in both ways: as many passes throughout, and fewer."""
    found = {(life.seed, life.least_epochs): life for life in lives if life.task == task}
    seeds = sorted({seed for seed, _ in found})
    both = [(found.get((seed, THROUGHOUT)), found.get((seed, FEWER))) for seed in seeds]
    return [(old, new) for old, new in both if old is not None and new is not None]


@dataclass(frozen=True)
class Comparison:
    """Of a task's lives: returns under both ways, the difference with its standard error, goals first, and CPU."""

    returns: tuple[float, float]
    gain: float
    error: float
    goals: tuple[float, float]
    cpu: tuple[float, float]


def compared(both: Sequence[tuple[Life, Life]]) -> Comparison:
    """Two pairs or more."""
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
    """A line per task."""
    lines = [f"{'task':12}{'lives':>6}{'return':>16}{'difference':>14}{'goal first':>16}{'CPU s':>14}{'saved':>7}"]
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
    """Every bound that the stored trainings break, in words."""
    broken = []
    for task in EYES:
        both = pairs(lives, task)
        if len(both) < 5:
            broken.append(f"{task}: {len(both)} lives in both ways, five are wanted")
            continue
        found = compared(both)
        if found.gain < -2 * found.error:
            broken.append(f"{task}: fewer passes teach less, by {-found.gain:.1f} ± {found.error:.1f}")
        if found.cpu[1] > (1 - LEAST_SAVED) * found.cpu[0]:
            broken.append(f"{task}: fewer passes save less than {LEAST_SAVED:.0%} of the time")
    return broken


def passes_until(task: str, least_epochs: int, evaluations: int) -> np.ndarray:
    """Mean number of passes in the updates before each evaluation, (evaluation,)."""
    learning = assemble(task, assignments=(*SETTINGS, f"learning.least_epochs={least_epochs}")).learning
    return np.array([mean_passes(learning, n * INTERVAL, (n + 1) * INTERVAL) for n in range(evaluations)])


def seconds(task: str, cpu: tuple[float, float], evaluations: int) -> np.ndarray:
    """CPU time until each evaluation, (way, evaluation): every pass takes the same, and so does all else."""
    passes = np.array([passes_until(task, least, evaluations) for least in (THROUGHOUT, FEWER)])
    (old, new), saved = passes.mean(axis=1), cpu[0] - cpu[1]
    per_pass = saved / (old - new)
    return np.cumsum((cpu[0] - per_pass * old + per_pass * passes) / evaluations, axis=1)


def draw(lives: Sequence[Life], path: Path) -> None:
    """A panel per task: return over CPU time, lives thin and their means thick."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(EYES), figsize=(11, 3.8), layout="constrained")
    for place, task in zip(axes, EYES, strict=True):
        both = pairs(lives, task)
        if len(both) > 1:
            curves = np.array([[life.curve for life in pair] for pair in both])
            times = seconds(task, compared(both).cpu, curves.shape[2])
            for way, (colour, label) in enumerate(((MUTED, "ten passes, smaller steps"), (OURS, "fewer passes"))):
                place.plot(times[way], curves[:, way].T, color=colour, lw=0.5, alpha=0.6)
                place.plot(times[way], curves[:, way].mean(axis=0), color=colour, lw=2, label=label)
        place.set(title=task, xlabel="CPU time [s]", xlim=(0, None))
        place.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("mean return of an evaluation")
    axes[0].legend(frameon=False, loc="lower right")
    figure.suptitle("Fewer passes late in a training: the same skill, sooner")
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Train what is missing if asked, then make the page of all that is stored."""
    options_parser = parser(__doc__ or "")
    options_parser.add_argument("--train", action="store_true", help="the trainings that the store lacks")
    options_parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2, 3, 4], help="of the trainings")
    options_parser.add_argument("--stored", type=Path, default=STORED, help="file of the stored trainings")
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
