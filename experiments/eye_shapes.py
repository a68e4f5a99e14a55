"""Animals of the experiment on eyes for tasks, with controls that separate the effects of fineness and height."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from experiments.designed import Design, Trained, crossed

__all__ = [
    "BRIGHT",
    "CAMERA",
    "COLORS",
    "COMPOUND",
    "CONTROLS",
    "FOV_DEG",
    "SHAPES",
    "TASKS",
    "designs",
    "eyes_of",
    "lights",
    "shape_name",
    "with_rows",
    "with_squares",
]

TASKS = ("navigation", "detection")
COLORS = {"navigation": "#D55E00", "detection": "#0072B2"}
BRIGHT, DIM = 0.01, (0.05, 0.15)
SEEDS, SEEDS_IN_DIM_LIGHT = range(6), range(3)
FOV_DEG = 45.0
# Number of eyes, receptors across each, and the arc over which eyes are spread: from compound eyes to a camera eye.
SHAPES = ((10, 4, 135.0), (5, 8, 90.0), (2, 15, 45.0), (2, 15, 30.0), (1, 15, 0.0))
COMPOUND, CAMERA = (10, 4), (2, 15)
# Controls in navigation: number of eyes, receptors (up, across) and arc. Rows of finer receptors are less tall. Most of
# the control's eyes are 45 degrees high instead, like the published eyes at any resolution.
CONTROLS = (
    (10, 4, 4, 135.0),
    (5, 8, 8, 90.0),
    (2, 15, 15, 45.0),
    (2, 15, 15, 30.0),
    (1, 15, 15, 0.0),
    (2, 5, 15, 45.0),
    (10, 1, 4, 45.0),
    (2, 1, 3, 45.0),
)


def designs() -> list[Design]:
    """Return all training runs: every animal in both tasks in bright light, in dimmer light, and the controls."""
    animals = [Design(TASKS[0], n, w, w, arc, BRIGHT, 0) for n, w, arc in SHAPES]
    return [
        *crossed(animals, TASKS, (BRIGHT,), SEEDS),
        *crossed(animals, TASKS, DIM, SEEDS_IN_DIM_LIGHT),
        *(Design("navigation", n, h, w, arc, BRIGHT, seed) for seed in SEEDS for n, h, w, arc in CONTROLS),
    ]


def with_rows(rows: Sequence[Trained]) -> list[Trained]:
    """Return the rows of the original design, in which navigators' eyes are one row of receptors."""
    return [
        row
        for row in rows
        if (row.task != "navigation" or row.height == 1) and (row.n_eyes, row.width, row.placement_range_deg) in SHAPES
    ]


def with_squares(rows: Sequence[Trained]) -> list[Trained]:
    """Return the rows in bright light with square eyes, which are equally high in both tasks."""
    return [row for row in rows if row.height == row.width and row.noise_sigma == BRIGHT]


def eyes_of(rows: Sequence[Trained], task: str, shape: tuple[int, int, int, float]) -> list[Trained]:
    """Return the rows in bright light with these eyes (number, receptors up, across, arc), except failed animals."""
    return [
        row
        for row in rows
        if not row.failed
        and (row.task, row.noise_sigma) == (task, BRIGHT)
        and (row.n_eyes, row.height, row.width, row.placement_range_deg) == shape
    ]


def shape_name(n: int, h: int, w: int, arc: float) -> str:
    return f"{n} of {h} x {w}" + (f" over {arc:g}°" if n > 1 else "")


def lights(rows: Iterable[Trained]) -> list[float]:
    return sorted({row.noise_sigma for row in rows})
