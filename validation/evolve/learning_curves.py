"""Learning curves: what is learnt, how fast, and with which settings

How many steps does it take to learn the tasks? Animals with two eyes of 15 x 15 receptors solve detection after 86,016
and 143,360 steps (23 and 40 CPU seconds, two seeds) and tracking after 159,744. An animal with a single receptor stays
at chance. In the maze, no animal reaches the goal by the end of its training run.

**Method.** Each row is a training run with `evolve.learning.ppo` in a built-in world. Every 50,000 steps the policy is
evaluated without exploration, in 100 episodes in worlds that were not used for training. Detection counts as solved if
the agent reaches the goal first in 80 % of the episodes. An agent that reaches objects without distinguishing them
finds the goal first in a third of the episodes. Eyes with many receptors use one ray per receptor (four in mazes), and
the single receptor uses 96 rays.

**First table.** "80 % after" is the number of steps after which the task counts as solved, and "CPU s" is the CPU time
of one thread until then, for rollouts and updates but without the evaluations. "update" is the fraction of the CPU time
that the updates take. "steps" is the length of the whole training run. "goal first" and "adversary" are the fractions
of episodes of the last evaluation in which the goal or an adversary is reached first. Brackets contain the 95 %
confidence interval (Wilson). "return" is the undiscounted return per training episode. The animal with a single
receptor often reaches no object. If it reaches one, this object is the goal in one of three cases, as expected by
chance.

**Second table.** This table is for the maze, where the distance travelled measures success. It states the distance from
the start at which an episode ends, the number of actions in contact with a wall, and the return of the episode. The
return is 0.25 per metre of this distance, minus 1 for every action in contact with a wall. The fitness is 1.5 per
metre, minus 2 for every such action. Means have 95 % confidence intervals. For the interval of the fitness, only an
upper bound of the width is known, and the table states this bound.

An animal that stands still has a return of 0, and an animal with one eye learns little more than to stand still.
Animals with ten eyes learn to travel through the maze. For comparison, a hand-written controller receives the true
distances of the walls in eleven directions and steers towards the largest free space. The animals with ten eyes travel
farther than this controller. At 1.5 m/s, that controller travels 21.8 m, with 2.6 actions in contact and a return of
2.8 ± 0.9. At 5 m/s it travels 25.6 m, with a return of -14. The return of the animals with ten eyes is about 0, because
an action in contact with a wall costs as much as four metres of progress earn. Their fitness, on which selection is
based, is above 0.

**Settings.** All settings that are not listed here are the defaults of the task.

- Rows "with tanh" use earlier defaults: 64 worlds x 64 steps, 4 epochs, a constant learning rate of 1e-3, tanh units,
  and mini-batches made of segments of 32 consecutive steps. The detection runs are from the last commit with these
  defaults.
- The other rows use 128 worlds x 32 steps, 10 epochs, leaky rectifiers, and segments of 8 steps. Their learning rate is
  3e-3. After 75,000 steps (in mazes after 200,000), it falls in inverse proportion to the number of steps. In these
  runs the number of epochs is constant. In the present learner, the learning rate first falls to half, and then the
  number of epochs falls instead (`fewer_epochs`).

**Bounds.** Two eyes of 15 x 15 receptors solve detection and tracking. A single receptor is not better than chance. In
the maze, animals with ten eyes have a higher fitness and travel farther than animals with one eye.

**Limits.** Some rows have few steps because the training run was stopped early, and not because learning was finished.
In the rows "with tanh" for tracking and the maze, the learner did not limit the mean of the policy's distribution of
actions. In the maze row "with tanh", contact had its full cost only after 500,000 steps.
`docs/measurements/learning.md` lists other settings that were tried.

Training runs take minutes each, so their results are stored (`docs/validation/data/learning_curves.csv`). The page is
written from the stored results.

    python -m validation.evolve.learning_curves [--train CASE ...] [--seeds N ...] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import sim
from evolve.config.assemble import assemble
from evolve.config.run_config import LearningConfig
from validation.evolve.watched_trainings import Case, Row, read_rows, steps_to, watched, wilson, write_rows
from validation.pages.page import Page, parser
from validation.pages.work_precision_chart import MUTED, OURS, OURS_TOO

STORED = Path("docs/validation/data/learning_curves.csv")
SOLVED = 0.8  # share of the episodes
CHANCE = 1 / 3
PAIR = sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)
ONE_RECEPTOR = sim.Eyes(n_eyes=1, resolution=(1, 1), fov_deg=45)
ROW_OF_EYES = sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=45, placement_range_deg=150)
ONE_EYE = sim.Eyes(n_eyes=1, resolution=(1, 4), fov_deg=45)

CHANGES: tuple[dict[str, Any], ...] = (
    {},
    {"n_epochs": 4},
    {"n_epochs": 6, "batch_size": 512},
    {"n_epochs": 20},
    {"batch_size": 512},
    {"batch_size": 2048},
    {"learning_rate": 1e-3},
    {"learning_rate": 5e-3},
    {"value_weight": 1.0},
    {"value_weight": 16.0},
    {"gamma": 0.95},
    {"gamma": 0.99, "gae_lambda": 0.95},
    {"n_envs": 64, "n_steps": 64},
    {"n_envs": 256, "n_steps": 16},
    {"n_envs": 64, "n_steps": 64, "n_epochs": 4, "learning_rate": 1e-3},
)


def _settings(changes: dict[str, Any]) -> Case:
    """Return the case of detection with two eyes and the default settings, except for these changes."""
    name = ", ".join(f"{key} {value:g}" for key, value in changes.items()) or "detection, 2 x (15 x 15)"
    return Case(name, PAIR, learning=replace(LearningConfig(), **changes))


SETTINGS = tuple(_settings(changes) for changes in CHANGES)
CONTROLS = (
    Case("detection, 1 receptor", ONE_RECEPTOR, rays_per_receptor="auto"),
    Case("tracking, 2 x (15 x 15)", PAIR, task="tracking"),
    Case("tracking, 1 receptor", ONE_RECEPTOR, task="tracking", rays_per_receptor="auto"),
    Case("maze, 10 x (1 x 4)", ROW_OF_EYES, "maze", assemble("maze").learning, rays_per_receptor=4),
    Case("maze, 1 x (1 x 4)", ONE_EYE, "maze", assemble("maze").learning, rays_per_receptor=4),
)
CASES = {case.name: case for case in (*SETTINGS, *CONTROLS)}
# Stored results of earlier learners, which cannot be repeated: the present learner has no such units.
FORMER = tuple(f"{task}, with tanh" for task in ("detection", "tracking", "maze"))


def store(case: Case, seed: int, path: Path) -> None:
    """Train, and replace the rows of this case and seed in the file after every evaluation."""
    others = [row for row in read_rows(path) if (row.case, row.seed) != (case.name, seed)]
    rows = []
    for row in watched(case, seed):
        rows.append(row)
        write_rows([*others, *rows], path)
        print(
            f"{case.name}, seed {seed}: {row.steps} steps, {row.cpu_seconds:.0f} CPU s, "
            f"goal {row.goals}, adversary {row.adversaries} of {row.episodes}, return {row.mean_return:.2f}, "
            f"{row.contacts:.0f} contacts, {row.distance:.1f} m",
            flush=True,
        )


def trainings(rows: Sequence[Row]) -> dict[str, list[list[Row]]]:
    """Return rows by case, in the order of CASES and then FORMER, and by seed."""
    found: dict[str, list[list[Row]]] = {}
    for name in (*CASES, *FORMER):
        seeds = sorted({row.seed for row in rows if row.case == name})
        if seeds:
            found[name] = [[row for row in rows if (row.case, row.seed) == (name, seed)] for seed in seeds]
    return found


def table(rows: Sequence[Row]) -> str:
    """Return the table of training runs: first the tasks with a goal, then the maze."""
    return "\n".join(seeking(rows)) + "\n\n" + "\n".join(travelling(rows))


def travelling(rows: Sequence[Row]) -> list[str]:
    """Return a line per training run in the maze: final results, with 95 % confidence intervals of the means."""
    head = f"{'case':32}{'seed':>5}{'steps':>12}{'CPU s':>7}{'return':>16}{'fitness':>14}{'distance [m]':>14}"
    lines = [head + f"{'contacts':>10}{'goal':>7}{'update':>8}"]
    for name, runs in trainings(rows).items():
        for last in (run[-1] for run in runs if name.startswith("maze")):
            lines.append(
                f"{name:32}{last.seed:5}{last.steps:12,}{last.cpu_seconds:7.0f}"
                f"{last.mean_return:9.2f} ± {1.96 * last.return_error:.2f}"
                f"{last.fitness:9.1f} ± {1.96 * last.fitness_error:.1f}"
                f"{last.distance:8.1f} ± {1.96 * last.distance_error:.1f}"
                f"{last.contacts:10.1f}{last.goals / last.episodes:7.2f}{last.update_seconds / last.cpu_seconds:8.0%}"
            )
    return lines


def seeking(rows: Sequence[Row]) -> list[str]:
    """Return a line per training run with a goal: steps and CPU seconds to the threshold, and final results."""
    found = {name: runs for name, runs in trainings(rows).items() if not name.startswith("maze")}
    width = max(map(len, ("case", *found))) + 1
    head = f"{'case':{width}}{'seed':>5}{'80 % after':>12}{'CPU s':>7}{'steps':>9}{'goal first':>20}"
    lines = [head + f"{'adversary':>11}{'return':>8}{'update':>8}"]
    for name, runs in found.items():
        for run in runs:
            solved, last = steps_to(run, SOLVED), run[-1]
            low, high = wilson(last.goals, last.episodes)
            lines.append(
                f"{name:{width}}{last.seed:5}"
                + (f"{solved.steps:12,}{solved.cpu_seconds:7.0f}" if solved else f"{'never':>12}{'':7}")
                + f"{last.steps:9,}{last.goals / last.episodes:8.2f} [{low:.2f}, {high:.2f}]"
                + f"{last.adversaries / last.episodes:11.2f}{last.mean_return:8.1f}"
                + f"{last.update_seconds / last.cpu_seconds:8.0%}"
            )
    return lines


def verdicts(rows: Sequence[Row]) -> list[str]:
    """Return the descriptions of the bounds that the stored training runs violate."""
    runs = trainings(rows)
    broken = []
    for task in ("detection", "tracking"):
        pair, single = runs.get(f"{task}, 2 x (15 x 15)", []), runs.get(f"{task}, 1 receptor", [])
        broken += [f"{task}, seed {r[0].seed}: not solved" for r in pair if not steps_to(r, SOLVED)]
        for run in single:
            last = run[-1]
            low, _ = wilson(last.goals, max(last.goals + last.adversaries, 1))
            if low > CHANCE:
                broken.append(f"{task}, 1 receptor, seed {run[0].seed}: better than chance")
    many, one = (
        {run[0].seed: run[-1] for run in runs.get(f"maze, {eyes}", [])} for eyes in ("10 x (1 x 4)", "1 x (1 x 4)")
    )
    for seed in sorted(many.keys() & one.keys()):
        for quantity, error in (("fitness", "fitness_error"), ("distance", "distance_error")):
            ahead = getattr(many[seed], quantity) - getattr(one[seed], quantity)
            if not ahead > 1.96 * math.hypot(getattr(many[seed], error), getattr(one[seed], error)):
                broken.append(f"maze, seed {seed}: ten eyes do not beat one ({quantity})")
    return broken


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the share of episodes with the goal first, over steps."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 4.5), layout="constrained")
    named = {"detection, 2 x (15 x 15)": OURS, "tracking, 2 x (15 x 15)": OURS_TOO}
    for name, runs in trainings(rows).items():
        if name.startswith("maze"):
            continue
        for i, run in enumerate(runs):
            x, y = [row.steps / 1e3 for row in run], [row.goals / row.episodes for row in run]
            axes.plot(x, y, color=named.get(name, MUTED), lw=1.5 if name in named else 0.8)
            if i == 0:
                axes.annotate(name, (x[-1], y[-1]), fontsize=7, xytext=(3, 0), textcoords="offset points", va="center")
    for level, label in ((SOLVED, "solved"), (CHANCE, "chance")):
        axes.axhline(level, color=MUTED, lw=0.6, ls=":")
        axes.annotate(label, (0, level), fontsize=7, va="bottom")
    axes.set(xlabel="steps [1000]", ylabel="fraction of episodes with the goal first", ylim=(0, 1), xlim=(0, None))
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested training, then write the page of all stored results."""
    options_parser = parser(__doc__ or "")
    options_parser.add_argument("--train", nargs="+", default=[], choices=CASES, metavar="CASE", help=" | ".join(CASES))
    options_parser.add_argument("--seeds", nargs="+", type=int, default=[0], help="seeds of the training runs")
    options_parser.add_argument("--steps", type=int, default=600_000, help="steps of each training run")
    options_parser.add_argument("--interval", type=int, default=50_000, help="steps between evaluations")
    options_parser.add_argument("--stored", type=Path, default=STORED, help="file of the stored training runs")
    options = options_parser.parse_args(arguments)
    for name in options.train:
        learning = replace(CASES[name].learning, total_steps=options.steps, eval_interval=options.interval)
        for seed in options.seeds:
            store(replace(CASES[name], learning=learning), seed, options.stored)
    rows = read_rows(options.stored)
    page = Page("learning_curves", __doc__ or "", table(rows), verdicts(rows))
    return page.publish(options, lambda path: draw(rows, path))


if __name__ == "__main__":
    sys.exit(main())
