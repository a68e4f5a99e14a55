"""Shorter training runs: how well a single training run ranks animals with different eyes

python -m experiments.eye_schedules [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from experiments.designed import Design
from experiments.eye_factors_design import FOV_DEG, TASKS, animals, in_task

__all__ = ["ranked", "schedules"]

NAME = "eye_schedules"
SEEDS = (0, 1)


@dataclass(frozen=True)
class Schedule:
    """Settings of shorter training runs.

    own: settings that differ from those of the full training runs
    """

    name: str
    own: str


def schedules() -> tuple[Schedule, ...]:
    """Return the schedules of shorter training runs."""
    return (
        _scaled(50_000),
        _scaled(75_000),
        Schedule("first 50,000 steps of a full one", "learning.total_steps=50000"),
    )


def _scaled(steps: int) -> Schedule:
    own = f"total_steps={steps} eval_interval={steps} contact_ramp={steps // 2} decay_after={steps // 2}"
    return Schedule(f"{steps:,} steps, schedule scaled", " ".join(f"learning.{one}" for one in own.split()))


def ranked() -> tuple[Design, ...]:
    """Return the animals that could be candidates of the searches: square eyes, 45° high and wide."""
    usual = replace(animals()[0], vertical_fov_deg=FOV_DEG)
    shape = ("n_eyes", "height", "width", "placement_range_deg")
    return tuple(one for one in animals() if one == replace(usual, **{name: getattr(one, name) for name in shape}))


def designs() -> list[Design]:
    """Return all training runs."""
    return [
        in_task(replace(animal, own=schedule.own), task, seed)
        for seed in SEEDS
        for schedule in schedules()
        for task in TASKS
        for animal in ranked()
    ]
