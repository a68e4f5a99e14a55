"""Early ranking: does fitness after little training predict final fitness?

Does the order of animals after part of a training run predict their order after all of it? After half of the training,
the rank correlation with the final order is 0.86. The order after less training does not predict the final order well:
the correlation is 0.64 after an eighth of the training and -0.33 after a quarter.

**Method.** Successive halving (`search.rungs`, `evolve.search.successive_halving`) trains the whole generation for a
short time and continues only with the better animals. The parts of such a training run are called rungs. Successive
halving saves time only if the early order resembles the final order. For this test, animals with one to four eyes of 1
x 1 to 15 x 15 receptors behind a perfect lens are drawn from the genome. They learn detection over four rungs, as in an
evolutionary run, but no animal is stopped at a rung.

**First table.** The table compares the order of the animals after each rung with their order after the last rung. Cells
state Spearman's rank correlation, and its 90 % confidence interval from a bootstrap over animals. In the column "32
episodes", the fitness of both rungs comes from the 32 evaluation episodes that a run uses. In the column "128
episodes", it comes from 128 episodes of the same policies in other worlds. The last line states the correlation between
the two measures of fitness after the last rung.

**Second table.** The table lists possible schedules of successive halving, applied to these animals as one generation.
"CPU time" is relative to training all animals to the end. "0.5 promoted" means that half of the animals continue to the
next rung. The last two columns state the final rank of the animal that the schedule selects as the best. The final rank
is the rank after the last rung by the fitness in 128 episodes. In the column "by 32 episodes", the schedule decides
from the fitness in 32 episodes which animals continue, and in the last column from the fitness in 128 episodes.

**Result.** Two rungs save a fifth of the time if half of the animals continue to the second rung. Schedules that select
animals earlier save more time but may lose the best animal. Successive halving is off by default. Thirty-two episodes
measure fitness well enough: their correlation with 128 episodes is 0.99.

**Limits.** 16 animals are too few for further conclusions. An eighth of the training predicted the final order better
(0.64) than a quarter (-0.33), and both confidence intervals are wide.

Training runs take minutes each, so their results are stored (`docs/validation/data/early_ranking.csv`). The page is
written from the stored results.

    python -m validation.evolve.early_ranking [--train N] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import csv
import io
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

import sim
from evolve.config.assemble import assemble
from evolve.config.run_config import RunConfig, SearchConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.fitness import evaluate
from evolve.learning.played_episodes import play
from evolve.learning.policy import load_policy
from evolve.learning.training_rung import TrainingRung
from evolve.search.successive_halving import budgets, promoted
from evolve.search.worker import prepare_device
from evolve.store.atomic_files import write_whole
from validation.pages.page import Page, parser
from validation.pages.work_precision_chart import MUTED, OURS, OURS_TOO

STORED = Path("docs/validation/data/early_ranking.csv")
TOTAL = 163_840  # steps of a full training run: 40 rollouts
RUNGS = 4
FEW = 32  # episodes of each rung's own evaluation, a run's default
MANY = 128  # episodes of the longer evaluation
HOLDS = 0.8  # rank correlation at which a rung can be trusted
LADDERS = ((2, 0.5), (2, 0.25), (3, 0.5), (4, 0.5))  # (rungs, promoted share)
UNSEEN = 10_000  # added to an animal's number: the longer evaluation uses unseen worlds
RAYS = 96  # rays of an eye, and at least one per receptor


@dataclass(frozen=True)
class Row:
    """One animal on one rung, with its fitness in FEW and in MANY episodes. Early stopping makes `steps` < `budget`."""

    animal: int
    eyes: int
    height: int
    width: int
    budget: int
    steps: int
    fitness: float
    fitness_many: float
    cpu_seconds: float


def animals(count: int) -> list[Phenotype]:
    """Return the first `count` of a sequence of random animals."""
    found = []
    for number in range(count):
        chance = np.random.default_rng([2, number])
        found.append(
            Phenotype(
                n_eyes=int(chance.integers(1, 5)),
                placement_range_deg=float(chance.uniform(30, 120)),
                fov_deg=float(chance.uniform(20, 90)),
                resolution=(int(chance.integers(1, 16)), int(chance.integers(1, 16))),
                relative_aperture=None,
                relief=None,
                refractive_index=None,
                memory_frames=int(chance.integers(1, 6)),
                neurons=int(chance.integers(16, 65)),
            )
        )
    return found


def config(animal: Phenotype) -> RunConfig:
    """Return the configuration of a run of detection with RUNGS rungs and enough rays for this animal's eyes."""
    rays = max(1, RAYS // (animal.resolution[0] * animal.resolution[1]))
    settings = (f"learning.total_steps={TOTAL}", f"learning.eval_interval={TOTAL // 2 ** (RUNGS - 1)}")
    optics = ("eye.optics=false", f"eye.rays_per_receptor={rays}")
    more = (f"search.rungs={RUNGS}", f"evaluation.episodes={FEW}")
    return assemble("detection", assignments=[*settings, *optics, *more])


def climbed(number: int, animal: Phenotype) -> list[Row]:
    """Return the rows of an animal on all rungs, from the first to the last."""
    run, rows = config(animal), []
    worlds = sim.make_vec_env(
        run.task,
        animal.eyes(run.eye),
        MANY,
        UNSEEN + number,
        memory=animal.memory_frames,
        mode="evaluation",
        rays_per_receptor=run.eye.rays_per_receptor,
    )
    with tempfile.TemporaryDirectory() as folder, closing(worlds):
        policy = Path(folder) / "policy"
        kept = tuple(Path(folder) / f"rung-{rung}" for rung in range(RUNGS))
        ends = budgets(run.search, run.learning)
        for rung in range(RUNGS):
            began = time.process_time()
            outcome = evaluate(animal, run, number, policy, rung=TrainingRung(ends[: rung + 1], kept[: rung + 1]))
            spent = time.process_time() - began
            if outcome.failure is not None:
                raise RuntimeError(f"animal {number}: {outcome.failure}")
            many = float(play(load_policy(policy), worlds, UNSEEN + number).returns.mean())
            place = (number, animal.n_eyes, *animal.resolution, ends[rung], outcome.steps)
            rows.append(Row(*place, outcome.fitness, many, round(spent, 1)))
    return rows


def read_rows(path: Path) -> list[Row]:
    """Return the stored rows; [] without a file."""
    if not path.exists():
        return []
    kinds = {f.name: {"int": int, "float": float}[str(f.type)] for f in fields(Row)}
    with path.open(encoding="utf-8", newline="") as file:
        return [Row(**{name: kinds[name](value) for name, value in row.items()}) for row in csv.DictReader(file)]


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """Write all rows atomically."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [f.name for f in fields(Row)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text.getvalue().encode())


def store(count: int, path: Path) -> None:
    """Train the animals that are missing in the file."""
    rows = read_rows(path)
    for number, animal in enumerate(animals(count)):
        if any(row.animal == number for row in rows):
            continue
        rows += climbed(number, animal)
        write_rows(rows, path)
        for row in rows[-RUNGS:]:
            print(row, flush=True)


def columns(rows: Sequence[Row], name: str) -> np.ndarray:
    """Return one column of the rows, (animal, rung)."""
    values = [getattr(row, name) for row in sorted(rows, key=lambda row: (row.animal, row.budget))]
    return np.array(values).reshape(-1, RUNGS)


def correlation(a: np.ndarray, b: np.ndarray) -> tuple[float, float, float]:
    """Return Spearman's rank correlation, and the ends of its 90 % confidence interval."""
    draws = np.random.default_rng(0).integers(len(a), size=(2000, len(a)))
    (whole,), drawn = _of_ranks(a[None], b[None]), _of_ranks(a[draws], b[draws])
    low, high = np.quantile(drawn[np.isfinite(drawn)], [0.05, 0.95])
    return float(whole), float(low), float(high)


def _of_ranks(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return, for each row, Pearson's correlation of the ranks in `a` with those in `b`; NaN for constant rows."""
    x, y = (rankdata(values, axis=1) - (values.shape[1] + 1) / 2 for values in (a, b))
    with np.errstate(invalid="ignore"):
        return (x * y).sum(axis=1) / np.sqrt((x**2).sum(axis=1) * (y**2).sum(axis=1))


@dataclass(frozen=True)
class Halving:
    """Result of successive halving, with all stored animals as one generation.

    cost: CPU time relative to full training of all animals.
    place: final rank of the selected animal, by its fitness in MANY episodes after full training; 1 is the best.
    """

    rungs: int
    promoted: float
    cost: float
    place: int


def halving(rows: Sequence[Row], rungs: int, share: float, by: str = "fitness") -> Halving:
    """Apply successive halving to the stored results.

    share: promoted fraction of the animals: 1/2 at every stored rung, or 1/4 at every other one.
    by: fitness that decides on promotion, "fitness" (FEW episodes) or "fitness_many".
    """
    fitness, many, spent = (columns(rows, name) for name in (by, "fitness_many", "cpu_seconds"))
    search = replace(SearchConfig(), population=len(fitness), rungs=rungs, promoted=share)
    stride = round(-np.log2(share))
    stored = [RUNGS - 1 - stride * above for above in range(rungs - 1, -1, -1)]
    reached, total, below = set(range(len(fitness))), 0.0, 0
    for rung, place in enumerate(stored):
        total += spent[sorted(reached), below : place + 1].sum()
        below = place + 1
        told = [(number, float(fitness[number, place])) for number in sorted(reached)]
        reached = promoted(search, rung, told) or reached
    best = max(reached, key=lambda number: (fitness[number, -1], -number))
    place = 1 + int((many[:, -1] > many[best, -1]).sum())
    return Halving(rungs, share, total / spent.sum(), place)


def table(rows: Sequence[Row]) -> str:
    """Return a line per rung, then a line per variant of successive halving."""
    fitness, many, spent = (columns(rows, name) for name in ("fitness", "fitness_many", "cpu_seconds"))
    lines = [f"{len(fitness)} animals", f"{'steps':>9}{'CPU time':>10}{f'{FEW} episodes':>26}{f'{MANY} episodes':>26}"]
    share = spent.cumsum(axis=1).sum(axis=0) / spent.sum()
    for rung, budget in enumerate(columns(rows, "budget")[0]):
        cells = "".join(_shown(correlation(measured[:, rung], measured[:, -1])) for measured in (fitness, many))
        last = _shown(correlation(fitness[:, -1], many[:, -1])) + f"  ({FEW} against {MANY} episodes)"
        lines.append(f"{budget:9,}{share[rung]:10.0%}" + (cells if rung < RUNGS - 1 else last))
    lines += ["", f"{'rungs':26}{'CPU time':>10}{f'rank of selected, by {FEW} episodes':>36}{f'by {MANY}':>8}"]
    for rungs, share in LADDERS:
        by_few, by_many = (halving(rows, rungs, share, by) for by in ("fitness", "fitness_many"))
        name = f"{rungs} rungs, {share:g} promoted"
        lines.append(f"{name:26}{by_few.cost:10.0%}{by_few.place:36}{by_many.place:8}")
    return "\n".join(lines)


def verdicts(rows: Sequence[Row]) -> list[str]:
    """Return the descriptions of the bounds that the stored training runs violate."""
    many = columns(rows, "fitness_many")
    return [] if len(many) >= 16 else [f"{len(many)} animals are too few"]


def _shown(found: tuple[float, float, float]) -> str:
    return f"{found[0]:12.2f} [{found[1]:5.2f}, {found[2]:4.2f}]"


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the fitness on each rung over the fitness on the last rung, both from MANY episodes."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    many, ends = columns(rows, "fitness_many"), columns(rows, "budget")[0]
    figure, axes = pyplot.subplots(1, RUNGS - 1, figsize=(9, 3.2), layout="constrained", sharey=True)
    for rung, one in enumerate(axes):
        one.plot(many[:, rung], many[:, -1], "o", ms=4, color=OURS if rung == RUNGS - 2 else OURS_TOO)
        rho = float(_of_ranks(many[None, :, rung], many[None, :, -1])[0])
        one.annotate(f"rank correlation {rho:.2f}", (0.03, 0.93), xycoords="axes fraction", fontsize=8, color=MUTED)
        one.set(xlabel=f"fitness after {ends[rung]:,} steps")
        one.spines[["top", "right"]].set_visible(False)
    axes[0].set(ylabel=f"fitness after {ends[-1]:,} steps")
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested training, then write the page of all stored results."""
    options_parser = parser(__doc__ or "")
    options_parser.add_argument("--train", type=int, default=0, metavar="N", help="number of animals to be stored")
    options_parser.add_argument("--stored", type=Path, default=STORED, help="file of the stored training runs")
    options = options_parser.parse_args(arguments)
    if options.train:
        prepare_device()
        store(options.train, options.stored)
    rows = read_rows(options.stored)
    page = Page("early_ranking", __doc__ or "", table(rows), verdicts(rows))
    return page.publish(options, lambda path: draw(rows, path))


if __name__ == "__main__":
    sys.exit(main())
