"""Steps per second of worlds and models, and the share of rendering

How many steps per second do worlds and models reach, and what fraction of a step is rendering? With 64 worlds,
detection reaches 11701 steps per CPU second and the humanoid 1107. Rendering takes 49 % to 71 % of the time of physics
and rendering together.

**Method.** The benchmark uses two built-in tasks and two models of Gymnasium (ant and humanoid, with the MIT licence).
Each agent has two eyes of 15 x 15 receptors, which are 60° wide. Eyes have noise, and are rendered with 4 rays per
receptor in direct light and 4 bands. Actions are random, and episodes restart when they end. Rates are steps per CPU
second of one thread, as the median of a few rounds in one process. Each round measures physics with the rules of the
task, rendering alone, and whole steps, one after the other. Other work on the machine therefore affects all three in
the same way, and hardly changes their ratios.

**Table.** "render" is the rate of rendering alone and "step" is the rate of whole steps. "share" is the fraction of the
time of physics and rendering that is spent on rendering. "step/sum" is the time of a whole step relative to the sum of
the times for physics and for rendering.

**Bounds.** The bounds apply to every model with 64 worlds or more.

- Rendering per world is at least twice as fast as with a single world. Measured ratios are 2.7 to 3.7, because the
  worlds of a batch share one kernel launch.
- A whole step takes at most 1.25 times the sum of the times for physics alone and rendering alone. Measured ratios are
  at most 1.17. The ratio exceeds 1 because, within a step, physics and rendering displace each other's data from the
  processor's caches.

**Limits.** Absolute rates depend on the machine and on the code.

    python -m validation.benchmarks.steps_per_second [--only ant] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import drjit as dr
import numpy as np

import optics
import sim
from sim.envs.vec_env import EyesVecEnv
from validation.pages.page import Page, parser

SIZES = (1, 16, 64, 256)
LARGE = 64  # fewest worlds for which the bounds apply
PAYS, OVERHEAD = 2.0, 1.25
ROUNDS, SECONDS = 7, 0.15  # rounds, and their length [s], of each measurement
RESOLUTION, FOV_DEG = (15, 15), 60.0
PARTS = ("physics", "sight", "both")
LABELS = {"physics": "physics", "sight": "rendering", "both": "step"}


class Body(sim.Task):
    """One of Gymnasium's models, with episodes that end only if the simulation fails; rewards are irrelevant here."""

    eye, fidelity = optics.Eye(resolution=RESOLUTION, fov_deg=FOV_DEG), sim.Fidelity(4, bands=4)
    episode_steps = 1000

    def __init__(self, file: str, left: sim.Mount) -> None:
        spec = find_spec("gymnasium")
        assert spec is not None
        assert spec.origin is not None
        self.model = Path(spec.origin).parent / "envs" / "mujoco" / "assets" / file
        self.mounts = sim.both_sides([left])

    def rewards(self, data: object) -> dict[str, float]:
        return {"none": 0.0}


@dataclass(frozen=True)
class Row:
    """Rates of a model.

    worlds: number of worlds that are stepped together.
    rates: steps of one world per CPU second, for each part.
    """

    name: str
    worlds: int
    rates: dict[str, float]

    @property
    def overhead(self) -> float:
        """Time of a whole step, relative to the sum of the times for physics and for rendering."""
        return 1 / self.rates["both"] / (1 / self.rates["physics"] + 1 / self.rates["sight"])

    @property
    def share(self) -> float:
        """Share of rendering in the time of physics and rendering."""
        return 1 / self.rates["sight"] / (1 / self.rates["physics"] + 1 / self.rates["sight"])


def environments() -> dict[str, Callable[[int], EyesVecEnv]]:
    """Return functions, by name, that make an environment of a number of worlds."""
    eyes = sim.Eyes(n_eyes=2, resolution=RESOLUTION, fov_deg=FOV_DEG)
    ours = {
        name: lambda n, name=name: sim.make_vec_env(name, eyes, n, fidelity=sim.Fidelity(4, bands=4))
        for name in ("detection", "navigation")
    }
    left = {
        "ant": sim.Mount("torso", azimuth_deg=35, elevation_deg=-10, offset=(0.22, 0.15, 0.1)),
        "humanoid": sim.Mount("torso", azimuth_deg=20, offset=(0.1, 0.04, 0.2)),
    }
    theirs = {name: lambda n, name=name: sim.make_vec_env(Body(f"{name}.xml", left[name]), n_envs=n) for name in left}
    return {**ours, **theirs}


def parts_of(env: EyesVecEnv) -> dict[str, Callable[[], object]]:
    """Return functions that run the measured parts of one step of all worlds, by name."""
    random = np.random.default_rng(0)

    def action() -> np.ndarray:
        return random.uniform(-1, 1, (env.num_envs, *env.action_space.shape)).astype(np.float32)

    simulation = env.simulation

    def judged() -> None:
        step = simulation.judge(simulation.move(action()))
        if step.done.any():
            simulation.restart(np.flatnonzero(step.done))

    return {
        "physics": judged,
        "sight": lambda: [frame.wait() for kinds in env.animals.launch() for frame in kinds.values()],
        "both": lambda: env.step(action()),
    }


def timed(part: Callable[[], object], steps: int) -> float:
    """Return the CPU seconds of one step."""
    began = time.process_time()
    for _ in range(steps):
        part()
    return (time.process_time() - began) / steps


def measured(name: str, env: EyesVecEnv) -> Row:
    """Measure the parts of a step in turn, and return their rates."""
    with contextlib.closing(env), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env.reset()
        parts = parts_of(env)
        for part in parts.values():  # records kernels
            for _ in range(3):
                part()
        steps = {what: max(1, int(SECONDS / max(timed(part, 2), 1e-6))) for what, part in parts.items()}
        rounds = [{what: timed(part, steps[what]) for what, part in parts.items()} for _ in range(ROUNDS)]
    medians = {what: float(np.median([one[what] for one in rounds])) for what in parts}
    return Row(name, env.num_envs, {what: env.num_envs / seconds for what, seconds in medians.items()})


def measure(only: str = "", sizes: Sequence[int] = SIZES) -> list[Row]:
    rows = []
    for name, make in environments().items():
        if only not in name:
            continue
        for n in sizes:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sim.MirrorWarning)
                rows.append(measured(name, make(n)))
            print(line(rows[-1]), flush=True)
    return rows


def line(row: Row) -> str:
    rates = " ".join(f"{row.rates[part]:9.0f}" for part in PARTS)
    return f"{row.name:<12} {row.worlds:6d} {rates} {row.share:7.0%} {row.overhead:9.2f}"


def table(rows: list[Row]) -> str:
    head = f"{'model':<12} {'worlds':>6} {'physics':>9} {'render':>9} {'step':>9} {'share':>7} {'step/sum':>9}"
    return "\n".join([head, *map(line, rows)])


def broken_bounds(rows: list[Row]) -> list[str]:
    alone = {row.name: row for row in rows if row.worlds == 1}
    broken = []
    for row in (row for row in rows if row.worlds >= LARGE):
        faster = row.rates["sight"] / alone[row.name].rates["sight"]
        if faster < PAYS:
            broken.append(f"{row.name}, {row.worlds} worlds: rendering is {faster:.1f} times as fast as for one world")
        if row.overhead > OVERHEAD:
            broken.append(f"{row.name}, {row.worlds} worlds: a step takes {row.overhead:.2f}x the sum of its parts")
    return broken


def draw_figure(rows: list[Row], path: Path) -> None:
    """Draw steps over the number of worlds, a panel for each model."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(row.name for row in rows))
    figure = Figure(figsize=(2.6 * len(names) + 1, 3.8), layout="constrained")
    panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
    for axes, name in zip(panels, names, strict=True):
        mine = [row for row in rows if row.name == name]
        for part, colour in zip(PARTS, ("#999999", "#0072B2", "#000000"), strict=True):
            rates = [row.rates[part] for row in mine]
            axes.loglog([row.worlds for row in mine], rates, "o-", ms=4, color=colour, label=LABELS[part])
        axes.set(xlabel="number of worlds", title=name)
    panels[0].set_ylabel("steps of a world per CPU second")
    panels[0].legend(frameon=False)
    figure.suptitle("Steps of many worlds together are faster; rendering takes about half of a step or more")
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    dr.set_thread_count(1)
    asked = parser(__doc__)
    asked.add_argument("--only", default="", help="only models whose names contain this")
    options: argparse.Namespace = asked.parse_args(arguments)
    rows = measure(options.only)
    if not rows:
        print("no such model: see --only", file=sys.stderr)
        return 2
    page = Page("steps_per_second", __doc__, table(rows), broken_bounds(rows))
    return page.publish(options, lambda path: draw_figure(rows, path))


if __name__ == "__main__":
    sys.exit(main())
