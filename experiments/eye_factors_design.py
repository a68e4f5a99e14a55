"""Animals of the experiment on factors of eyes: a factorial design, and controls that each remove one explanation."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from experiments.designed import Design, Trained

__all__ = [
    "CAMERA",
    "COMPOUND",
    "FACTORS",
    "LEARNER",
    "OTHERS",
    "RUNS",
    "TASKS",
    "Control",
    "animals",
    "controls",
    "designs",
    "factorial",
    "has",
    "in_task",
    "runs_of",
]

TASKS = ("maze", "detection")
SIGMA = 0.01  # standard deviation of a receptor's noise
FOV_DEG = 45.0
# Settings of the learner, the same in all tasks. The cost of contact rises and the learning rate falls within the
# 151,552 training steps. Three settings were tried with one training run per animal. These gave the highest fitness
# over all tasks and animals.
LEARNER = (
    *("learning.total_steps=150000", "learning.eval_interval=50000", "learning.gamma=0.95", "learning.n_epochs=8"),
    *("learning.first_speed=0.25", "learning.contact_ramp=75000", "learning.decay_after=75000"),
    "learning.least_return=0",
)
LONGER = (
    "learning.total_steps=450000 learning.eval_interval=150000 learning.contact_ramp=225000 learning.decay_after=225000"
)
LAYOUTS = "world.layouts=family world.family_seed={seed}"  # layouts of navigators; each training run has its own family
RUNS = 12  # training runs of each animal in each task, at most
# Factors and their two levels: number of eyes, receptors across, angle over which eyes are spread, height of eyes.
FACTORS = {
    "n_eyes": (2, 10),
    "width": (4, 15),
    "placement_range_deg": (45.0, 135.0),
    "vertical_fov_deg": (11.25, 45.0),
}


def _eyes(n: int, across: int, arc: float) -> Design:
    """Return an animal with n square eyes of `across` x `across` receptors, spread over `arc` degrees."""
    return Design("maze", n, across, across, arc, SIGMA, 0, FOV_DEG, vertical_fov_deg=FOV_DEG)


COMPOUND, CAMERA = _eyes(10, 4, 135.0), _eyes(2, 15, 45.0)
OTHERS = (_eyes(5, 8, 90.0), _eyes(1, 15, 0.0), _eyes(20, 1, 135.0))


@dataclass(frozen=True)
class Control:
    """A comparison of many coarse eyes with few fine eyes in which another difference is removed."""

    name: str
    many: Design
    few: Design


def controls() -> tuple[Control, ...]:
    """Return the controls, preceded by the comparison without any control."""
    coarse, fine = _eyes(10, 4, 45.0), _eyes(2, 15, 135.0)
    blurred, repeated = "wiring.pool_side=4 wiring.repeat_side=15", "wiring.repeat_side=15"
    rays = "eye.rays_per_receptor=16 learning.rays_per_receptor=16"
    return (
        Control("ten of 4 x 4 over 135° - two of 15 x 15 over 45°", COMPOUND, CAMERA),
        Control("both over 45°", coarse, CAMERA),
        Control("both over 135°", COMPOUND, fine),
        Control("30 features in total", replace(COMPOUND, features=3), replace(CAMERA, features=15)),
        Control("160 features in total", COMPOUND, replace(CAMERA, features=80)),  # ten eyes have 16 features each
        Control("one encoder for all eyes", *_both("wiring.shared_encoder=true")),
        Control("fine eyes blurred to 4 x 4, same inputs", COMPOUND, replace(CAMERA, own=blurred)),
        Control("fine eyes pooled to 4 x 4 inputs", COMPOUND, replace(CAMERA, own="wiring.pool_side=4")),
        Control("coarse eyes repeated to 15 x 15 inputs", replace(COMPOUND, own=repeated), CAMERA),
        Control("step size 1e-3", *_both("learning.learning_rate=1e-3")),
        Control("step size 6e-3", *_both("learning.learning_rate=6e-3")),
        Control(
            "noise per solid angle, that of fine eyes", replace(COMPOUND, noise_sigma=round(SIGMA * 4 / 15, 6)), CAMERA
        ),
        Control(
            "noise per solid angle, that of coarse eyes",
            COMPOUND,
            replace(CAMERA, noise_sigma=round(SIGMA * 15 / 4, 6)),
        ),
        Control("discount of 0.9", *_both("learning.gamma=0.9")),
        Control("discount of 0.97", *_both("learning.gamma=0.97")),
        Control("fields that do not overlap", replace(_eyes(10, 4, 121.5), fov_deg=13.5), CAMERA),
        Control("32 receptors, both over 90°", _eyes(8, 2, 90.0), _eyes(2, 4, 90.0)),
        Control("128 receptors, both over 90°", _eyes(8, 4, 90.0), _eyes(2, 8, 90.0)),
        Control("450 receptors, both over 90°", _eyes(18, 5, 90.0), _eyes(2, 15, 90.0)),
        Control("16 rays per receptor throughout", *_both(rays)),
        Control("walls of 0.5 m", *_both("world.wall_height=0.5")),
        Control("three times as many training steps", *_both(LONGER)),
        Control("256 neurons per layer", *(replace(one, neurons=256, features=16) for one in (COMPOUND, CAMERA))),
        Control("32 training mazes", *_both("world.training_layouts=32")),
    )


def _both(own: str) -> tuple[Design, Design]:
    return replace(COMPOUND, own=own), replace(CAMERA, own=own)


def factorial() -> tuple[Design, ...]:
    """Return all combinations of the factors' levels."""
    cells = itertools.product(*FACTORS.values())
    return tuple(
        replace(_eyes(int(n), int(across), arc), vertical_fov_deg=float(height)) for n, across, arc, height in cells
    )


def animals() -> tuple[Design, ...]:
    """Return all animals, each once."""
    compared = [one for control in controls() for one in (control.many, control.few)]
    return tuple(dict.fromkeys((*factorial(), *OTHERS, *compared)))


def designs() -> list[Design]:
    """Return all training runs that the experiment may need.

    The first run of every animal comes before the second run of any animal.
    """
    trained = itertools.product(range(RUNS), TASKS, animals())
    return [in_task(animal, task, seed) for seed, task, animal in trained if has(task, animal)]


def has(task: str, animal: Design) -> bool:
    """Return whether an animal is trained in a task. Detection has neither walls of another height nor layouts."""
    return task != "detection" or not animal.own.startswith("world.")


def in_task(animal: Design, task: str, seed: int) -> Design:
    """Return the training run of an animal in a task with this seed, which also determines the layouts."""
    layouts = () if task == "detection" else (LAYOUTS.format(seed=seed),)
    return replace(animal, task=task, seed=seed, own=" ".join((*layouts, *filter(None, (animal.own,)))))


def runs_of(rows: Sequence[Trained], task: str, animal: Design) -> list[Trained]:
    """Return the training runs of an animal in a task, without failed ones."""
    wanted = {in_task(animal, task, seed) for seed in range(RUNS)}
    similar = [row for row in rows if (row.task, row.n_eyes, row.width) == (task, animal.n_eyes, animal.width)]  # quick
    return [row for row in similar if not row.failed and row.design in wanted]
